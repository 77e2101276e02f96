"""Pages of fields: loops around a point against whole elements, the page and digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen import pipeline
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.weak_form import Form, Page
from softehl.codegen.tools import build
from softehl.codegen.verify import verification
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from softehl.runtime.mesh.cells import CELLS
from tests.codegen import field_pages
from tests.codegen.workshop import compiled, write

N = 11
"""Elements: a full group of lanes and a remainder, with four lanes and with eight."""


def made(page: Page, cell: str, geometry: str | None, form: Form, folder: Path) -> Kernel:
    """A kernel in one of the two forms."""
    d = replace(page, form=form, name=f"{page.name}_{form}").definition(cell, geometry)
    assert pipeline.form(d).at_points is (form == "point")
    folder.mkdir(exist_ok=True)
    return compiled(d, folder / form)


def state(kernel: Kernel, cell: str, rng: np.random.Generator) -> tuple[Array, Array, Any]:
    """Coordinates, unknowns and the other arguments of some distorted elements."""
    nodes = CELLS[cell].nodes
    X = nodes[None] + 2.0 + rng.uniform(-0.05, 0.05, (N, *nodes.shape))
    dofs = rng.uniform(-0.05, 0.05, (N, len(kernel.unknowns)))
    given: dict[str, Array] = {"parameters": rng.uniform(0.5, 1.5, len(kernel.parameters))}
    if kernel.data:
        given["data"] = rng.uniform(-0.05, 0.05, (N, len(kernel.data)))
    if kernel.point_data:
        points = len(kernel.default_rule.weights)
        given["point_data"] = rng.uniform(-0.02, 0.02, (N, points, len(kernel.point_data)))
    return X.reshape(N, -1), dofs, given


def called(kernel: Kernel, task: str, X: Array, dofs: Array, given: Any) -> list[Array]:
    """What a task writes, along a direction that is the same for every form."""
    design = X.shape[1] + len(kernel.data) + len(kernel.parameters)
    width = {"product": dofs.shape[1], "pseudo_load": design}.get(task, design + dofs.shape[1])
    direction = np.cos(np.arange(N * width, dtype=np.float64)).reshape(N, width)
    if task.startswith("d_"):
        return [kernel.derivative(task[2:], X, dofs, **given)]
    if task in ("product", "pseudo_load", "fields_rate"):
        return [getattr(kernel, task)(X, dofs, direction, **given)]
    found = getattr(kernel, "fields_at" if task == "fields" else task)(X, dofs, **given)
    return list(found) if isinstance(found, tuple) else [found]


@pytest.mark.parametrize(
    ("page", "cell", "geometry"),
    [
        (field_pages.mixed, "tri6", "plane strain"),
        (field_pages.constant_pressure, "quad4", "plane strain"),
        (field_pages.heat, "quad4", "plane strain"),
        (field_pages.creep, "quad4", "axisymmetric"),
        pytest.param(field_pages.fbar, "tri6", "plane strain", marks=pytest.mark.slow),
        pytest.param(field_pages.mixed, "quad9", "axisymmetric", marks=pytest.mark.slow),
        pytest.param(field_pages.mixed, "quad16", "plane strain", marks=pytest.mark.slow),
        pytest.param(field_pages.mixed, "tet10", "solid", marks=pytest.mark.slow),
        pytest.param(field_pages.mixed, "hex27", "solid", marks=pytest.mark.slow),
        pytest.param(field_pages.creep, "wedge6", "solid", marks=pytest.mark.slow),
        pytest.param(field_pages.creep, "hex20", "solid", marks=pytest.mark.slow),
        pytest.param(field_pages.fbar, "quad4", "axisymmetric", marks=pytest.mark.slow),
        pytest.param(field_pages.fbar, "hex8", "solid", marks=pytest.mark.slow),
        pytest.param(field_pages.fbar, "wedge6", "solid", marks=pytest.mark.slow),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_loops_around_a_point_are_the_whole_element(
    page: Page, cell: str, geometry: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    whole, point = (made(page, cell, geometry, form, tmp_path) for form in ("whole", "point"))
    X, dofs, given = state(whole, cell, rng)
    assert whole.tasks == point.tasks
    assert len(whole.tasks) >= 7
    for task in whole.tasks:
        pairs = zip(*(called(k, task, X, dofs, given) for k in (whole, point)), strict=True)
        for a, b in pairs:
            assert np.abs(a).max() > 0.0
            assert np.abs(a - b).max() < 1e-13 * max(1.0, np.abs(a).max()), task


@pytest.mark.parametrize("lanes", [1, 4])
def test_groups_of_one_and_of_four_elements_are_the_same(
    lanes: int, tmp_path: Path, rng: np.random.Generator
) -> None:
    d = replace(field_pages.creep, form="point").definition("tri3")
    folders = [tmp_path / "usual", tmp_path / "other"]
    usual = compiled(d, folders[0])
    write(d, folders[1])
    build.build(folders[1], extra=(*build.STRICT, "-O0", f"-DSOFTEHL_LANES={lanes}"))
    other = load_kernel(d.name, folders[1])
    X, dofs, given = state(usual, "tri3", rng)
    for task in usual.tasks:
        pairs = (called(k, task, X, dofs, given) for k in (usual, other))
        for a, b in zip(*pairs, strict=True):
            assert np.abs(a - b).max() < 1e-13 * np.abs(a).max(), task


def test_a_local_iteration_that_fails_spoils_its_element_alone(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    kernel = made(field_pages.creep, "tri3", None, "point", tmp_path)
    X, dofs, given = state(kernel, "tri3", rng)
    given["point_data"][3] = np.nan
    residual, tangent = kernel.tangent(X, dofs, **given)
    assert np.isnan(residual[3]).all()
    assert np.isnan(tangent[3]).all()
    others = np.arange(N) != 3
    assert np.isfinite(residual[others]).all()
    assert np.isfinite(tangent[others]).all()


# ------------------------------------------------------------------- independent of the compiler


def energy(X: Any, u: Any, mu: Any, K: Any) -> Any:
    """Energy of a plane quad4 of `field_pages.rubber`, with arithmetic of mpmath alone."""
    total, corners = mpmath.mpf(0), ((-1, -1), (1, -1), (1, 1), (-1, 1))
    for p in corners:
        xi, eta = (c / mpmath.sqrt(3) for c in p)
        slopes = [(a * (1 + b * eta) / 4, b * (1 + a * xi) / 4) for a, b in corners]
        J = mpmath.matrix(2, 2)
        H = mpmath.matrix(2, 2)
        for n, slope in enumerate(slopes):
            for i in range(2):
                for k in range(2):
                    J[i, k] += X[2 * n + i] * slope[k]
                    H[i, k] += u[2 * n + i] * slope[k]
        F = mpmath.eye(2) + H * J**-1
        det = mpmath.det(F)
        trace = sum(F[i, k] ** 2 for i in range(2) for k in range(2)) + 1
        W = mu / 2 * (trace - 3 - 2 * mpmath.log(det)) + K / 2 * (det - 1) ** 2
        total += W * mpmath.det(J)
    return total


def differences(function: Callable[[Any], Any], at: Any) -> tuple[Array, Array]:
    """First and second central differences in 50 digits, as doubles."""
    h, size = mpmath.mpf(10) ** -12, len(at)

    def moved(*steps: tuple[int, int]) -> Any:
        x = list(at)
        for k, sign in steps:
            x[k] += sign * h
        return function(x)

    ends = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    first = [(moved((i, 1)) - moved((i, -1))) / (2 * h) for i in range(size)]
    second = [
        [sum(s * t * moved((i, s), (j, t)) for s, t in ends) / (4 * h * h) for j in range(size)]
        for i in range(size)
    ]
    return np.array(first, dtype=np.float64), np.array(second, dtype=np.float64)


def test_tangents_are_differences_of_the_energy_in_50_digits(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    kernel = made(field_pages.rubber, "quad4", None, "point", tmp_path)
    X, dofs, _ = state(kernel, "quad4", rng)
    parameters = np.array([0.4, 0.9])
    with mpmath.workdps(50):
        x, u = ([mpmath.mpf(v) for v in row[-1]] for row in (X, dofs))
        mu, K = (mpmath.mpf(v) for v in parameters)
        R, tangent = differences(lambda v: energy(x, v, mu, K), u)
        _, wrong = differences(lambda v: energy(x, v, mu, K * (1 + mpmath.mpf(10) ** -9)), u)
    found_R, found = kernel.tangent(X, dofs, parameters=parameters)
    assert np.abs(found_R[-1] - R).max() < 1e-13 * np.abs(tangent).max()
    assert np.abs(found[-1] - tangent).max() < 1e-13 * np.abs(tangent).max()
    assert np.abs(found[-1] - wrong).max() > 1e-11 * np.abs(tangent).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "cell",
    ["tri3", "tri6", "quad4", "quad9", "tet4", "tet10", "wedge6", "hex8", "hex20", "hex27"],
)
def test_one_page_has_exact_derivatives_on_ten_cells(cell: str, tmp_path: Path) -> None:
    d = field_pages.rubber.definition(cell)
    compiled(d, tmp_path)
    tasks = ["residual", "tangent", "fields"]
    errors = verification.check(d, tasks, tmp_path / build.LIBRARY).errors
    assert sorted(errors) == sorted(tasks)
    assert max(errors.values()) < 1e-13


# ----------------------------------------------------------------------------------- the choice


def test_moduli_of_a_weak_form_that_are_symmetric_are_found_to_be() -> None:
    def symmetric(write: Callable[[Fields], Any]) -> bool:
        d = Page("flow", write, form="point").definition("quad9")
        shared = pipeline.compile_model(d).shared
        (text,) = shared.values()
        return "V (*restrict S)[3]" in text

    def flux(m: Fields, power: int) -> None:
        g = m.grad(m.scalar("T"))
        m.weak(g * g.dot(g) ** power, g)

    def turned(m: Fields) -> None:
        g = m.grad(m.scalar("T"))
        m.weak(sp.Matrix([g[0] + g[1], g[1]]), g)

    assert symmetric(lambda m: flux(m, 2))
    assert not symmetric(turned)


# --------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (lambda m: m.minimise(m.scalar("p", order=2)), "order = 2 on quad4; allowed is 0 or 1"),
        (lambda m: m.rate(m.scalar("p", order=0)), "steps before are known at nodes only"),
        (lambda m: m.weak(m.grad(m.scalar("T")), m.scalar("S")), "a flux of 2 entries"),
        (lambda m: m.grad(m.parameters(k="a")[0]), "grad of k: it is no field"),
        (lambda m: m.grad(m.scalar("T") * m.data(q="a")[0]), "grad of T[*]q: q is no field"),
        (lambda m: m.previous(m.position[0]), "is no field"),
        (lambda m: m.deformation_gradient(m.scalar("T")), "a vector of 2 is needed"),
        (lambda m: m.integral("I", 1), "element-wide integrals need softehl.Model"),
        (lambda m: m.minimise(m.vector("u")[1]), r'u_x1? is never used: .* m.scalar\("u_y"\)'),
        (lambda m: m.vector("u"), "neither a potential nor a weak form"),
        (lambda: None, "wrong: its function gets 1 argument, and cannot take it"),
    ],
)
def test_what_a_page_cannot_say_is_told(write: Callable[[Fields], Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Page("wrong", write).definition("quad4")


def returned(m: Fields) -> Any:
    return m.scalar("T") ** 2


def one_in_a_list(m: Fields) -> None:
    k: Any = m.parameters(k="conductivity")
    m.minimise(k / 2 * m.scalar("T") ** 2)


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (returned, r"LINE: .* returned returns a value, .* say m.minimise"),
        (one_in_a_list, r"LINE+2: TypeError: .* give a list: \(mu,\) = m.parameters"),
        (lambda m: m.weak(m.grad(m.vector("u")) + sp.eye(3), 1), "LINE: ShapeError: .* is 3 x 3"),
        (lambda m: 1 if m.scalar("T") < 1 else 2, "LINE: a condition on symbols .*Piecewise"),
        (lambda m: np.log(m.scalar("T")), "LINE: np.log computes with numbers.* sp.log"),
        (lambda: None, r"LINE: .* cannot take it; write `def wrong\(m\):`"),
    ],
)
def test_what_goes_wrong_in_a_page_of_a_script_is_told_with_its_line(
    write: Callable[..., Any], words: str
) -> None:
    first = write.__code__.co_firstlineno
    words = words.replace("LINE+2", str(first + 2)).replace("LINE", str(first))
    with pytest.raises(ValueError, match=f"test_fields.py:{words}"):
        softehl.load_kernel(Page(write.__name__.replace("<lambda>", "wrong"), write), cell="quad4")


def test_cells_geometries_and_forms_are_checked() -> None:
    with pytest.raises(ModelError, match='in 3-D; allowed is "solid"'):
        field_pages.rubber.definition("hex8", "plane strain")
    with pytest.raises(ModelError, match="on a side there are values of fields"):
        field_pages.rubber.definition("quad4", "solid")
    with pytest.raises(ModelError, match="only sides have normals"):
        Page("wrong", lambda m: m.normal).definition("quad4")
    with pytest.raises(ValueError, match="no element 'hex9'; there are"):
        field_pages.rubber.definition("hex9")
    with pytest.raises(ModelError, match="say which, as in"):
        softehl.load_kernel(field_pages.rubber)
    with pytest.raises(ModelError, match='allowed are "whole" and "point"'):
        softehl.page(form="fast")  # type: ignore[call-overload]


def test_a_name_for_two_things_says_which() -> None:
    def page(m: Fields) -> None:
        p = m.scalar("p")
        m.minimise(p**2 * m.parameters(p="pressure outside")[0])

    with pytest.raises(ModelError, match=r"name p is used twice .* an unknown and a parameter"):
        softehl.page(page).definition("quad4")
