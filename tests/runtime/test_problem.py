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
from softehl.runtime.solve.arclength import Arclength
from softehl.runtime.solve.continuation import StepRule
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


def test_a_block_without_elements_or_coordinates_is_none_the_worse() -> None:
    p = problem()
    mesh, (solid, pull) = ring()
    none = replace(solid, name="none", coordinates=np.empty((0, 8)), dofs=solid.dofs[:0])
    bare = replace(pull, coordinates=np.empty(0))
    more = replace(
        p,
        assembler=Assembler.build(2 * len(mesh.points), [solid, bare, none]),
        parameters={**p.parameters, "none": SOLID},
    )
    assert solved(more) == pytest.approx(solved(p), rel=1e-12)
    assert "element" in more.where_not_finite(np.full(50, np.nan))


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


class Log(Force):
    """log(1 - u) = force: steps from 0 with a force above 1 leave the domain."""

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        return np.asarray(np.log(1.0 - dofs) + given["parameters"][0])

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        return self.residual(coordinates, dofs, **given), (-1.0 / (1.0 - dofs))[:, :, None]


def test_a_step_that_leaves_the_domain_names_the_element() -> None:
    block = ElementBlock("logs", Log(), np.zeros((2, 0)), np.array([[0], [1]]))
    p = Problem(Assembler.build(2, [block]), DofLayout.of(u=2), {"logs": [1e6]})
    solution = Newton().solve(p, np.zeros(2))
    assert solution.status is Status.NOT_FINITE
    assert "element 0 of block 'logs' and 1 more" in solution.message


class NoTangent(Force):
    """A residual whose tangent is not a number."""

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        n, k = dofs.shape
        return self.residual(coordinates, dofs, **given), np.full((n, k, k), np.nan)


def test_a_tangent_that_is_not_finite_names_the_element() -> None:
    block = ElementBlock("bad", NoTangent(), np.zeros((2, 0)), np.array([[0], [1]]))
    p = Problem(Assembler.build(2, [block]), DofLayout.of(u=2), {"bad": [1.0]})
    solution = Newton().solve(p, np.zeros(2))
    assert solution.status is Status.SINGULAR
    assert "not finite: element 0 of block 'bad'" in solution.message


# --- paths ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Arch(Spring):
    """u^3 - 3 u^2 + 2.5 u, which is largest at u = 1 - 1 / sqrt(6)."""

    parameters: tuple[str, ...] = ()

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        return dofs**3 - 3.0 * dofs**2 + 2.5 * dofs

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        return self.residual(coordinates, dofs), (3.0 * dofs**2 - 6.0 * dofs + 2.5)[:, :, None]


def test_a_path_of_problems_is_followed_by_arc_length_without_scales() -> None:
    place = np.zeros((1, 1), dtype=np.int64)
    kernels = {"a": Arch(), "f": Force()}
    blocks = [ElementBlock(n, kernel, np.zeros((1, 0)), place) for n, kernel in kernels.items()]
    p = Problem(Assembler.build(1, blocks), DofLayout.of(u=1), {"a": [], "f": [0.0]})
    arc = Arclength(Newton(), StepRule(0.05, 1e-4, 0.1))
    branch = arc.follow(
        lambda force: p.with_parameters(f={"force": force}),
        0.0,
        np.zeros(1),
        until=lambda branch: len(branch.limit_points) == 2,
    ).raise_for_status()
    for fold, u in zip(branch.limit_points, (1 - 6**-0.5, 1 + 6**-0.5), strict=True):
        assert fold.x[0] == pytest.approx(u, abs=1e-6)
        assert fold.parameter == pytest.approx(u**3 - 3 * u**2 + 2.5 * u, abs=1e-9)


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


def test_units_do_not_matter() -> None:
    """In N and mm, or in MN and m: the same iterations, the same norms, the same answer."""
    blocks = ring()[1]
    p = problem(4.0)
    scaled = [replace(block, coordinates=1e-3 * np.asarray(block.coordinates)) for block in blocks]
    q = replace(
        p,
        assembler=Assembler.build(50, scaled),
        parameters={
            "solid": SOLID,
            "pull": {"force": 4e-6},
        },
    )
    a, b = (Newton().solve(one, np.zeros(50)).raise_for_status() for one in (p, q))
    assert a.iterations == b.iterations
    assert 1e3 * b.x == pytest.approx(a.x, rel=1e-8, abs=1e-10)
    assert a.residual_norms[:-1] == pytest.approx(b.residual_norms[:-1], rel=1e-4)


def test_a_body_at_rest_that_was_moved_converges_although_only_rounding_is_left() -> None:
    """Every equation holds to rounding only, and nothing else is there to compare it with."""
    p = problem(0.0)
    moved = np.tile([0.125, 0.0], 25)  # along the axis, without a stress
    moving = replace(p, values=moved[p.fixed])
    for start in (np.zeros(50), moved):
        solution = Newton().solve(moving, start).raise_for_status()
        assert solution.x == pytest.approx(moved, abs=1e-12)
        assert solution.iterations <= 4


def test_a_body_that_a_step_threw_away_is_not_solved() -> None:
    """So far away that the rounding of its places is larger than its load."""
    p = problem(1e-3, fixed=np.empty(0, dtype=np.int64), values=np.empty(0))
    _, K = p.linearise(np.zeros(50))
    away = np.tile([1e17, 0.0], 25)
    assert p.measure(away, K) == p.measure(away, K, rounded=True) == 1.0


def test_prescribed_values_count_relative_to_themselves() -> None:
    p = problem(0.0)
    tiny = replace(p, values=np.full(len(p.fixed), 1e-13))
    solution = Newton().solve(tiny, np.zeros(50)).raise_for_status()
    assert solution.x[p.fixed] == pytest.approx(1e-13, rel=1e-9)


def test_a_field_without_a_scale_is_monitored() -> None:
    """An equation alone in its field, beside one that is solved from the start."""
    blocks = [
        ElementBlock(name, Spring(), np.zeros((1, 0)), np.array([[3 * k, 3 * k + 1, 3 * k + 2]]))
        for k, name in enumerate("ab")
    ]
    p = Problem(
        Assembler.build(6, blocks),
        DofLayout.of(u=3, v=3),
        dict.fromkeys("ab", np.array([1.0, 0.0])),
        scales={"u": 1.0},
        fixed=np.array([3]),
        values=np.array([0.7]),
    )
    x = solved(p)
    assert x[:3] == pytest.approx(0.0, abs=1e-12)
    assert p.assembler.residual(x, p.parameters)[[4, 5]] == pytest.approx(0.0, abs=1e-8)
    assert np.abs(x[4:]).min() > 0.01


def test_absolute_scales_measure_as_they_say() -> None:
    p = problem(4e-10, scales={"displacement": 1.0}, absolute=True)
    solution = Newton().solve(p, np.zeros(50)).raise_for_status()
    assert solution.iterations == 0
    assert solution.residual_norms[0] == pytest.approx(p.norm(p.residual(np.zeros(50))))
