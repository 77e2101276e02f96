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
from softehl.runtime.discretisation.matrix_free_products import (
    ElementNumbering,
    ElementProduct,
    NoProductError,
)
from softehl.runtime.mesh.cells import CELLS
from tests.codegen import field_pages


@softehl.page
def rubber(m: Fields) -> None:
    """Gradients alone, and products."""
    field_pages.rubber.write(m)
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
        *((rubber, kind) for kind in ("quad4", "quad9", "quad25", "hex8")),
        *(
            pytest.param(rubber, kind, marks=pytest.mark.slow)
            for kind in ("hex27", "hex64", "quad49", "hex216")
        ),
        (field_pages.heat, "hex8"),
        (field_pages.heat, "quad16"),
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


def test_what_has_no_product_is_refused(rng: np.random.Generator) -> None:
    for page, kind in ((field_pages.rubber, "quad9"), (field_pages.mixed, "quad9")):
        block = assembled(page, kind, rng)[0].block("b")
        with pytest.raises(NoProductError, match=r"says m\.offer\(product=True\)"):
            ElementNumbering.of(block, 1)
