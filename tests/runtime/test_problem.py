"""Nothing silently wrong: every mistake in a problem is an error that names it, and Newton's method
stops relative to the loads and reactions of the problem.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.dofmap import DofLayout
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Status
from tests.runtime.springs import Spring

SOLID = {"mu_1": 3.0, "mu_2": 0.6, "kappa": 500.0}
RADIUS = 20.0  # of the inside of the ring


@dataclass(frozen=True)
class Force(Spring):
    """Forces on unknowns, which share what the one parameter says."""

    parameters: tuple[str, ...] = ("force",)

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        return np.full(dofs.shape, -given["parameters"][0] / len(dofs))

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        n, k = dofs.shape
        return self.residual(coordinates, dofs, **given), np.zeros((n, k, k))


def ring(cells: int = 4, turned: bool = False) -> tuple[Mesh, list[ElementBlock]]:
    """A ring of a square section, clamped at z = 0 and pulled at z = 1 in the radial direction."""
    mesh = Mesh.rectangle(1.0, 1.0, cells=(cells, cells)).map(lambda x: x + np.array([0.0, RADIUS]))
    quads = mesh.cells["quad4"][:, ::-1] if turned else mesh.cells["quad4"]
    dofs: Integers = np.stack([2 * quads, 2 * quads + 1], axis=2).reshape(-1, 8)
    solid = ElementBlock("solid", load_kernel("solid_q4"), mesh.points[quads].reshape(-1, 8), dofs)
    pulled = 2 * mesh.nodes("right")[:, None] + 1
    return mesh, [solid, ElementBlock("pull", Force(), np.zeros((len(pulled), 0)), pulled)]


def problem(force: float = 1.0, **changes: Any) -> Problem:
    mesh, blocks = ring()
    fixed = (2 * mesh.nodes("left")[:, None] + [0, 1]).ravel()
    given: dict[str, Any] = {
        "assembler": Assembler.build(2 * len(mesh.points), blocks),
        "layout": DofLayout.of(displacement=2 * len(mesh.points)),
        "parameters": {"solid": SOLID, "pull": {"force": force}},
        "fixed": fixed,
        "values": np.zeros(len(fixed)),
    }
    return Problem(**{**given, **changes})


def solved(p: Problem) -> Array:
    return Newton().solve(p, np.zeros(p.layout.total)).raise_for_status().x


# --- names ---------------------------------------------------------------------------------------


def test_a_misspelt_block_is_named() -> None:
    message = r"no block 'sold' \(did you mean 'solid'\?\); there are solid, pull"
    with pytest.raises(ProblemError, match=message):
        problem(parameters={"sold": SOLID, "pull": [1.0]})
    with pytest.raises(ProblemError, match=message):
        problem().with_parameters(sold={"mu_1": 2.0})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({**SOLID, "mu1": 1.0}, r"no parameter of block 'solid' 'mu1' \(did you mean 'mu_1'\?\)"),
        ({"mu_1": 3.0, "kappa": 5.0}, "block 'solid' needs mu_2 too"),
        ([3.0, 0.6], r"must be 3 numbers \(mu_1, mu_2, kappa\)"),
        (["mu_1", "mu_2", "kappa"], "must be 3 numbers"),
        ([3.0, np.nan, 500.0], "block 'solid': mu_2 = nan, must be finite"),
    ],
)
def test_parameters_that_do_not_fit_are_named(given: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem(parameters={"solid": given, "pull": [1.0]})


def test_parameters_by_name_can_be_changed() -> None:
    stiffer = problem().with_parameters(solid={"mu_2": 9.0})
    assert stiffer.parameters["solid"].tolist() == [3.0, 9.0, 500.0]
    assert stiffer.parameters["solid"].dtype == np.float64
    by_order = problem(parameters={"solid": np.array([3.0, 9.0, 500.0]), "pull": [1.0]})
    assert solved(stiffer) == pytest.approx(solved(by_order), rel=1e-12)
    with pytest.raises(ProblemError, match="no parameter of block 'solid' 'mu'"):
        problem().with_parameters(solid={"mu": 9.0})


def test_an_unknown_scale_is_named_and_a_missing_one_is_derived() -> None:
    with pytest.raises(ProblemError, match=r"no field 'displacment' .*'displacement'"):
        problem(scales={"displacment": 1.0})
    x = solved(problem(scales={"displacement": 1.0}))
    assert solved(problem()) == pytest.approx(x, rel=1e-8)
    with pytest.raises(ProblemError, match="absolute scales: displacement has none"):
        problem(absolute=True)
    with pytest.raises(ProblemError, match="field 'displacement' has no scale"):
        problem().norm(x)


# --- prescribed values ---------------------------------------------------------------------------


def test_an_unknown_that_is_prescribed_twice_is_named() -> None:
    p = problem()
    message = r"unknown 7 of field 'displacement' \(u_r\d of element .*twice, to 1 and to 5"
    with pytest.raises(ProblemError, match=message):
        p.with_fixed([np.array([0, 7]), np.array([7])], [1.0, 5.0])
    again = p.with_fixed([p.fixed, p.fixed[:3]], [0.0, 0.0])  # the same value twice is none
    assert solved(again) == pytest.approx(solved(p), rel=1e-12)


@pytest.mark.parametrize(
    ("fixed", "values", "message"),
    [
        ([0, 50], [0.0, 0.0], "numbered from 0 to 49"),
        ([0, -1], [0.0, 0.0], "numbered from 0 to 49"),
        ([0, 1], [0.0], "lists of one length"),
        ([0, 1], [0.0, np.nan], "unknown 1 of field .* prescribed to a value that is not finite"),
    ],
)
def test_prescribed_values_that_do_not_fit(fixed: Any, values: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem(fixed=np.array(fixed), values=np.array(values))


# --- elements ------------------------------------------------------------------------------------


def test_elements_numbered_clockwise_are_refused() -> None:
    message = r"element \d+ of block 'solid' at \(.*is inside out .* 16 of 16.*counterclockwise"
    with pytest.raises(ProblemError, match=message):
        Assembler.build(50, ring(turned=True)[1])


def test_one_element_inside_out_is_named() -> None:
    _, (solid, _) = ring()
    coordinates = solid.coordinates.copy()
    coordinates[5] = coordinates[5].reshape(4, 2)[::-1].ravel()
    wrong = replace(solid, coordinates=coordinates)
    message = r"element 5 of block 'solid' at \(0.375, 20.38\) is inside out.* 1 of 16"
    with pytest.raises(ProblemError, match=message):
        Assembler.build(50, [wrong])
    Assembler.build(50, [replace(wrong, check_orientation=False)])


def test_coordinates_that_are_not_finite_are_named() -> None:
    _, (solid, _) = ring()
    coordinates = solid.coordinates.copy()
    coordinates[3, 1] = np.nan
    with pytest.raises(ProblemError, match=r"element 3 of block 'solid'.*coordinates are not"):
        Assembler.build(50, [replace(solid, coordinates=coordinates)])


def test_sizes_that_do_not_fit_are_named() -> None:
    solid = ring()[1][0]
    with pytest.raises(ProblemError, match="coordinates of 15 elements and dofs of 16"):
        Assembler.build(50, [replace(solid, coordinates=solid.coordinates[1:])])
    with pytest.raises(ProblemError, match="the layout has 48 unknowns, the assembler 50"):
        problem(layout=DofLayout.of(displacement=48))


# --- unknowns that nothing determines ------------------------------------------------------------


def test_an_unknown_that_occurs_in_no_block_is_named() -> None:
    p = problem()
    more = replace(
        p,
        assembler=Assembler.build(52, p.assembler.blocks),
        layout=DofLayout.of(displacement=50, spare=2),
    )
    with pytest.raises(ProblemError, match=r"unknown 50 of field 'spare' \(and 1 more\) occurs in"):
        solved(more)
    assert solved(more.with_fixed([p.fixed, np.array([50, 51])], [0.0, 0.0]))[50] == 0.0
    with pytest.raises(ProblemError, match=r"unknown \d+ .*occurs in no block that is switched on"):
        solved(p.with_parameters(solid=None))


@dataclass(frozen=True)
class Flat(Spring):
    """A spring between the first two unknowns of each element; the third is not resisted."""

    matrix: tuple[tuple[float, ...], ...] = ((1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (0.0, 0.0, 0.0))

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        return np.asarray(given["parameters"][0] * dofs @ np.array(self.matrix).T)

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        K = given["parameters"][0] * np.tile(np.array(self.matrix), (len(dofs), 1, 1))
        return self.residual(coordinates, dofs, **given), K


def test_an_unknown_that_no_equation_determines_is_named() -> None:
    block = ElementBlock("floor", Flat(), np.zeros((1, 0)), np.array([[0, 1, 2]]))
    p = Problem(
        Assembler.build(3, [block]),
        DofLayout.of(u=2, w=1),
        {"floor": {"stiffness": 2.0, "unused": 0.0}},
        fixed=np.array([0]),
        values=np.array([0.5]),
    )
    solution = Newton().solve(p, np.zeros(3))
    assert solution.status is Status.SINGULAR
    named = r"no equation determines unknown 2 of field 'w' \(element 0 of block 'floor'\)"
    with pytest.raises(NotConverged, match=named):
        solution.raise_for_status()


# --- not a number --------------------------------------------------------------------------------


def test_a_residual_that_is_not_finite_names_block_element_and_place() -> None:
    p = problem()
    x = np.zeros(50)
    x[20:24] = np.nan
    solution = Newton().solve(p, x)
    assert solution.status is Status.NOT_FINITE
    named = r"at the start is not finite: element \d+ of block 'solid' at \(.*\) and \d more"
    with pytest.raises(NotConverged, match=named):
        solution.raise_for_status()


# --- paths ---------------------------------------------------------------------------------------


# --- the criterion -------------------------------------------------------------------------------


@pytest.mark.parametrize("scales", [{}, {"displacement": 1.0}, {"displacement": 1e6}])
@pytest.mark.parametrize("force", [4e-10, 4e-4, 4.0])
def test_small_loads_are_solved_as_well_as_large_ones(
    force: float, scales: Mapping[str, float]
) -> None:
    p = problem(force, scales=scales)
    solution = Newton().solve(p, np.zeros(50)).raise_for_status()
    assert solution.iterations >= 1
    r, size = p.assembler.residual_and_size(solution.x, p.parameters)
    free = np.setdiff1d(np.arange(50), p.fixed)
    first, K = p.linearise(np.zeros(50))
    linear = -np.linalg.solve(K.toarray(), first)
    if force > 1e-3:
        assert np.linalg.norm(r[free]) <= 1e-9 * np.linalg.norm(size)
    else:  # the last digit of the coordinates is 4e-15 mm
        off = 2e-14 + 10.0 * np.abs(linear).max() ** 2
        assert solution.x == pytest.approx(linear, rel=1e-6, abs=off)
        assert np.abs(linear).max() > 10.0 * off


def test_a_body_that_a_step_threw_away_is_not_solved() -> None:
    """So far away that the rounding of its places is larger than its load."""
    p = problem(1e-3, fixed=np.empty(0, dtype=np.int64), values=np.empty(0))
    _, K = p.linearise(np.zeros(50))
    away = np.tile([1e17, 0.0], 25)
    assert p.measure(away, K) == p.measure(away, K, rounded=True) == 1.0
