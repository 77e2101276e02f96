"""Products by sum factorisation against assembled tangents."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Mesh
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.weak_form import Page
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_operator import coarse_matrix, without
from softehl.runtime.discretisation.matrix_free_products import (
    ElementNumbering,
    ElementProduct,
    NoProductError,
    require_product,
)
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.mesh.cells import CELLS
from tests.codegen import field_pages


@softehl.page
def rubber(m: Fields) -> None:
    """Gradients alone, and products."""
    field_pages.rubber.write(m)
    m.offer(product=True)


@softehl.page
def convected(m: Fields) -> None:
    """Values and gradients, a tangent that is not symmetric."""
    T = m.scalar("T")
    (k,) = m.parameters(k="conductivity")
    m.weak(k * m.grad(T), m.grad(T))
    m.weak(m.grad(T)[0] + 2 * T + T**2, T)
    m.offer(product=True)


def mesh_of(kind: str) -> Mesh:
    """Some distorted cells, no multiple of a group."""
    cell = CELLS[kind]
    if cell.dimension == 2:
        mesh = Mesh.rectangle(1, 1, cells=(3, 7), order=cell.order)
    else:
        mesh = Mesh.box((1, 1, 1), cells=(3, 2, 2), order=cell.order)
    return mesh.map(lambda x: x + 2.0 + 0.02 * np.sin(5 * x[:, ::-1]))


def assembled(page: Page, kind: str, rng: np.random.Generator) -> tuple[Assembler, Array, Array]:
    """Elements of a page with all that they need, a state, and parameters."""
    mesh = mesh_of(kind)
    kernel = softehl.load_kernel(page, cell=kind)
    nodes = mesh.cells[kind]
    names = list(dict.fromkeys(name for name, _ in kernel.places))
    count = len(mesh.points)
    columns = [
        nodes[:, node] + count * names.index(name)
        for name, node in kernel.places
        if node is not None
    ]
    n, points = len(nodes), len(kernel.default_rule.weights)
    given: dict[str, Any] = {}
    if kernel.data:
        given["data"] = rng.uniform(-0.05, 0.05, (n, len(kernel.data)))
    if kernel.point_data:
        given["point_data"] = rng.uniform(-0.02, 0.02, (n, points, len(kernel.point_data)))
    dofs: Integers = np.stack(columns, axis=1)
    block = ElementBlock("b", kernel, mesh.points[nodes].reshape(n, -1), dofs, **given)
    x = rng.uniform(-0.01, 0.01, count * len(names)) / CELLS[kind].order ** 2
    return Assembler.build(len(x), [block]), x, rng.uniform(0.5, 1.5, len(kernel.parameters))


@pytest.mark.parametrize(
    ("page", "kind"),
    [
        *((rubber, kind) for kind in ("quad4", "quad25", "hex8")),
        *(
            pytest.param(rubber, kind, marks=pytest.mark.slow)
            for kind in ("quad9", "hex27", "hex64", "quad49", "hex216")
        ),
        pytest.param(field_pages.heat, "hex8", marks=pytest.mark.slow),
        (field_pages.creep, "quad9"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_products_are_those_of_assembled_tangents(
    page: Page, kind: str, rng: np.random.Generator
) -> None:
    assembler, x, parameters = assembled(page, kind, rng)
    v = rng.uniform(-1, 1, len(x))
    K = assembler.linearise(x, {"b": parameters})[1]
    wanted: Array = np.asarray(K @ v)
    block = assembler.block("b")
    size = np.abs(wanted).max()
    for count in (1, 2):
        places = ElementNumbering.of(block, count)
        assert count == 1 or kind.startswith("hex") or all(a < b for a, b in places.runs)
        found = np.zeros(len(x))
        product = ElementProduct.of(block, x, parameters, places)
        assert product.cached.ctypes.data % 64 == 0, (
            "vectors of lanes lie in two lines of the cache"
        )
        product.add(v, found)
        assert np.abs(found - wanted).max() < 1e-12 * size
    other = np.zeros(len(x))
    ElementProduct.of(block, 1.1 * x, parameters, places).add(v, other)
    assert np.abs(other - wanted).max() > 1e-9 * size, "the state does not matter"


@pytest.mark.parametrize(
    ("page", "kind"),
    [
        *((rubber, kind) for kind in ("quad4", "quad9", "hex8")),
        *(
            pytest.param(rubber, kind, marks=pytest.mark.slow)
            for kind in ("quad25", "hex27", "hex64", "hex125")
        ),
        (field_pages.heat, "quad16"),
        (field_pages.creep, "quad9"),
        (convected, "quad9"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
@pytest.mark.parametrize("constrained", [0.0, 0.1])
def test_matrices_of_the_next_order_are_those_of_projected_tangents(
    page: Page, kind: str, constrained: float, rng: np.random.Generator
) -> None:
    """From moduli at the points, and as P' K P; the diagonal too. Constraints are anywhere."""
    assembler, x, parameters = assembled(page, kind, rng)
    block, points = assembler.block("b"), mesh_of(kind).points
    names = list(dict.fromkeys(name for name, _ in require_product(block).places))
    dofmap = {n: np.arange(len(points)) + len(points) * k for k, n in enumerate(names)}
    free = rng.uniform(size=len(x)) >= constrained
    K = assembler.linearise(x, {"b": parameters})[1]
    for threads in (1, 2):
        levels = MultigridLevels.of(
            points, dofmap, [block], order=CELLS[kind].order, size=len(x), threads=threads
        )
        numbering = levels.numberings["b"]
        product = ElementProduct.of(block, x, parameters, numbering)
        A, diagonal = coarse_matrix(block, product, x, levels, free)
        P = without(levels.steps[0], free[levels.unknowns[0]])
        R = without(P.T.tocsr(), free[levels.unknowns[1]])
        fine = K.tocsr()[levels.unknowns[0]][:, levels.unknowns[0]]
        wanted = R @ fine @ R.T
        assert abs(A - wanted).max() < 1e-12 * abs(wanted).max()
        assert np.abs(diagonal - K.diagonal()).max() < 1e-12 * np.abs(diagonal).max()
    product = ElementProduct.of(block, 1.1 * x, parameters, numbering)
    other, _ = coarse_matrix(block, product, 1.1 * x, levels, free)
    assert page is convected or page.name == "heat" or abs(other - wanted).max() > 1e-9


def test_a_failed_local_iteration_spoils_the_product(rng: np.random.Generator) -> None:
    assembler, x, parameters = assembled(field_pages.creep, "quad9", rng)
    block = assembler.block("b")
    assert block.point_data is not None
    block.point_data[3] = np.nan
    found = np.zeros(len(x))
    ElementProduct.of(block, x, parameters, ElementNumbering.of(block, 1)).add(
        np.ones(len(x)), found
    )
    assert np.isnan(found[block.dofs[3]]).all()
    assert np.isfinite(found).any()
    numbering = ElementNumbering.of(block, 1)
    product = ElementProduct.of(block, x, parameters, numbering)
    diagonals, tangents = product.coarse(require_product(block))
    spoilt = numbering.order == 3
    assert np.isnan(diagonals[spoilt]).all()
    assert np.isnan(tangents[spoilt]).all()
    assert np.isfinite(diagonals[~spoilt]).all()
    assert np.isfinite(tangents[~spoilt]).all()


def test_what_has_no_product_is_refused(rng: np.random.Generator) -> None:
    for page, kind in ((field_pages.rubber, "quad9"), (field_pages.mixed, "quad9")):
        block = assembled(page, kind, rng)[0].block("b")
        with pytest.raises(NoProductError, match=r"says m\.offer\(product=True\)"):
            ElementNumbering.of(block, 1)
