"""Problems: their blocks and unknowns, assembly, bodies that nothing holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import csc_array, lil_array

from softehl import Definition, Model, Study, kinematics, quadrature, shapes
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation import element_blocks
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.dofmap import DofLayout, ElementUnknowns, Numbering, Slot
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.discretisation.sparsity import build_pattern
from softehl.runtime.discretisation.step_bounds import KeepsOrientation, StaysPositive
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.singularity_check import unconstrained_unknown
from softehl.runtime.solve.solution import NotConverged, Status
from tests.runtime import solid_page as pages
from tests.runtime.springs import Spring
from tests.runtime.test_newton import bar

# --- Nothing silently wrong: every mistake in a problem is an error that names it, and ------------


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


# --- Sparse assembly against a dense loop, prescribed unknowns, norms and guards ------------------


SIZE, ELEMENTS = 12, 25
PARAMETERS = {"a": np.array([1.5, 0.0]), "b": np.array([0.3, 0.0])}


def _blocks(rng: np.random.Generator) -> list[ElementBlock]:
    def block(name: str, n: int) -> ElementBlock:
        dofs = np.stack([rng.permutation(SIZE)[:3] for _ in range(n)])
        return ElementBlock(name, Spring(), np.zeros((n, 2)), dofs, rng.uniform(1, 2, (n, 1)))

    return [block("a", ELEMENTS), block("b", 7)]


def _dense(blocks: list[ElementBlock], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r, K = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    for block in blocks:
        local, tangents = block.tangent(x, PARAMETERS[block.name])
        for e, dofs in enumerate(block.dofs):
            for i, row in enumerate(dofs):
                r[row] += local[e, i]
                for j, column in enumerate(dofs):
                    K[row, column] += tangents[e, i, j]
    return r, K


def test_assembly_equals_a_dense_loop(rng: np.random.Generator) -> None:
    blocks, x = _blocks(rng), rng.normal(size=SIZE)
    r, K = Assembler.build(SIZE, blocks).linearise(x, PARAMETERS)
    dense_r, dense_K = _dense(blocks, x)
    assert r == pytest.approx(dense_r, rel=1e-13, abs=1e-13)
    assert K.toarray() == pytest.approx(dense_K, rel=1e-13, abs=1e-13)
    assert Assembler.build(SIZE, blocks).residual(x, PARAMETERS) == pytest.approx(r, rel=1e-14)


def test_a_wrong_scatter_is_seen(rng: np.random.Generator) -> None:
    blocks, x = _blocks(rng), rng.normal(size=SIZE)
    assembler = Assembler.build(SIZE, blocks)
    first = assembler.pattern.scatter[0].reshape(ELEMENTS, 3, 3)
    transposed = first.transpose(0, 2, 1).ravel()
    pattern = replace(assembler.pattern, scatter=(transposed, *assembler.pattern.scatter[1:]))
    vars(assembler.structure)["pattern"] = pattern
    _, K = assembler.linearise(x, PARAMETERS)
    assert np.abs(K.toarray() - _dense(blocks, x)[1]).max() > 0.1


def _pattern_by_sorting(size: int, dof_maps: list[Integers]) -> tuple[Integers, Integers]:
    """Places column * size + row of all entries, and the position of each element entry."""
    keys = [np.arange(size) * (size + 1)]
    keys += [(dofs[:, None, :] * size + dofs[:, :, None]).ravel() for dofs in dof_maps]
    stored, where = np.unique(np.concatenate(keys), return_inverse=True)
    return stored, where[size:]


def test_pattern_is_that_of_a_sort(rng: np.random.Generator) -> None:
    def some(n: int, k: int) -> Integers:
        return np.stack([rng.permutation(SIZE)[:k] for _ in range(n)])

    first, other = some(9, 4), some(5, 3)
    longer = np.concatenate([first, np.full((9, 1), SIZE)], axis=1)
    longest = np.concatenate([longer, np.full((9, 1), SIZE + 1)], axis=1)
    twice = np.array([[0, 3, 0], [5, 5, 2]])  # an unknown may occur twice in an element
    nothing = np.empty((0, 4), dtype=np.int64)
    one = some(9, 1)
    maps = [first, other, longer, first.copy(), nothing, twice, longest, one, other, nothing]
    pattern = build_pattern(SIZE + 2, maps)
    stored, where = _pattern_by_sorting(SIZE + 2, maps)
    columns = np.repeat(np.arange(SIZE + 2), np.diff(pattern.indptr))
    assert np.array_equal(columns * (SIZE + 2) + pattern.indices, stored)
    assert np.array_equal(np.concatenate(pattern.scatter), where)
    assert [len(part) for part in pattern.scatter] == [m.shape[0] * m.shape[1] ** 2 for m in maps]
    assert pattern.indices.dtype == pattern.indptr.dtype == np.int32
    # a map of which one entry differs is another one
    first[3, 1] = (first[3, 1] + 1) % SIZE
    changed = build_pattern(SIZE + 2, maps)
    assert not np.array_equal(np.concatenate(changed.scatter)[:144], where[:144])


def test_pieces_of_a_block_add_up_to_it(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocks, x = _blocks(rng), rng.normal(size=SIZE)
    assembler = Assembler.build(SIZE, blocks)
    whole = assembler.linearise(x, PARAMETERS)
    monkeypatch.setattr(element_blocks, "_PIECE", 9 * 4)  # 4 of the 25 elements at a time
    monkeypatch.setattr(element_blocks, "_GROUP", 1)
    pieces = [piece for piece, _ in blocks[0].pieces(assembler.pattern.scatter[0])]
    assert [len(piece.dofs) for piece in pieces] == [4] * 6 + [1]
    r, K = assembler.linearise(x, PARAMETERS)
    assert r == pytest.approx(whole[0], rel=1e-14, abs=1e-13)
    assert K.data == pytest.approx(whole[1].data, rel=1e-14, abs=1e-13)


def test_rows_and_columns_of_some_unknowns(rng: np.random.Generator) -> None:
    assembler = Assembler.build(SIZE, _blocks(rng))
    for fixed in (np.array([3, 7]), np.array([7]), np.array([3, 7]), np.empty(0, dtype=np.int64)):
        data = np.ones(assembler.pattern.nnz)
        data[assembler.cross(fixed)] = 0.0
        expected = assembler.pattern.matrix(np.ones(len(data))).toarray()
        expected[fixed] = 0.0
        expected[:, fixed] = 0.0
        assert np.array_equal(assembler.pattern.matrix(data).toarray(), expected)
    for number in range(SIZE):
        assembler.cross(np.array([number]))
    assert len(assembler.memo.crosses) <= 4


def test_misuse_is_refused(rng: np.random.Generator) -> None:
    blocks = _blocks(rng)
    with pytest.raises(ValueError, match="same name"):
        Assembler.build(SIZE, [blocks[0], blocks[0]])
    with pytest.raises(ValueError, match="outside the 5 unknowns"):
        Assembler.build(5, blocks)
    with pytest.raises(KeyError, match="no block 'c'; there are a, b"):
        Assembler.build(SIZE, blocks).block("c")


def _problem(rng: np.random.Generator) -> Problem:
    layout = DofLayout.of(u=8, p=4)
    assembler = Assembler.build(SIZE, _blocks(rng))
    return Problem(assembler, layout, PARAMETERS, {"u": 2.0, "p": 0.5})


def test_elimination_gives_the_newton_step_of_the_whole_system(rng: np.random.Generator) -> None:
    problem = _problem(rng).with_fixed([np.array([1, 9])], [np.array([0.2, -0.1])])
    x = rng.normal(size=SIZE)
    r, K = problem.linearise(x)
    full_r, full_K = problem.assembler.linearise(x, PARAMETERS)
    rows, dense = full_r.copy(), full_K.toarray()
    rows[[1, 9]] = x[[1, 9]] - [0.2, -0.1]
    dense[[1, 9]] = np.eye(SIZE)[[1, 9]]
    step = np.linalg.solve(K.toarray(), r)
    assert step == pytest.approx(np.linalg.solve(dense, rows), rel=1e-10, abs=1e-12)
    assert problem.residual(x) == pytest.approx(rows, rel=1e-13)


def test_norm_weighs_each_field_by_its_reference(rng: np.random.Generator) -> None:
    r = np.zeros(SIZE)
    r[0], r[8] = 6.0, 2.0
    assert _problem(rng).norm(r) == pytest.approx(5.0)  # 6 / 2 and 2 / 0.5


def test_film_may_lose_only_a_fraction() -> None:
    guard = StaysPositive(np.array([1, 3]), np.array([0.5, 0.0]), fraction=0.8)
    x = np.array([0.0, 0.5, 0.0, 2.0])
    assert guard.limit(x, np.array([9.0, 1.0, -9.0, 3.0])) == 1.0
    limit = guard.limit(x, np.array([0.0, -2.0, 0.0, -1.0]))
    assert limit == pytest.approx(0.4)
    assert x[1] + 0.5 + limit * -2.0 == pytest.approx(0.2)


def test_elements_may_not_fold() -> None:
    square = np.array([[0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 0.0, 2.0]])
    guard = KeepsOrientation(square, np.arange(8)[None])
    dx = np.zeros(8)
    dx[4] = -3.0  # moves corner 3 across the square
    limit = guard.limit(np.zeros(8), dx)
    assert limit == 0.25
    assert guard.limit(np.zeros(8), 0.1 * dx) == 1.0


def test_a_constant_tangent_is_evaluated_once_for_each_set_of_parameters() -> None:
    calls: list[float] = []

    class Counting(Spring):
        def tangent(self, *args: Any, **given: Any) -> tuple[Array, Array]:
            calls.append(given["parameters"][0])
            r, K = super().tangent(*args, **given)
            return r, K

    dofs = np.array([[0, 1, 2], [2, 1, 3]])
    blocks = [
        ElementBlock("spring", kernel, np.zeros((2, 2)), dofs, constant=constant)
        for kernel, constant in ((Counting(), True), (Spring(), False))
    ]
    constant, usual = (Assembler.build(4, [block]) for block in blocks)
    x = np.arange(4.0)
    for stiffness in (2.0, 2.0, 3.0):
        given = {"spring": np.array([stiffness, 0.0])}
        r, K = constant.linearise(x, given)
        expected, _ = usual.linearise(x, given)
        _, at_zero = usual.linearise(np.zeros(4), given)
        assert r == pytest.approx(expected)  # the residual is never remembered
        assert K.toarray() == pytest.approx(at_zero.toarray())
    assert calls == [2.0, 3.0]


# --- Numbers of unknowns by name: at nodes, of elements, shared, and along elements ---------------


CHAIN = np.array([[0, 1], [1, 2]])
DISPLACED = tuple(Slot(name, node) for node in (0, 1) for name in ("u", "w"))


def test_unknowns_of_a_field_are_numbered_node_by_node() -> None:
    body = ElementUnknowns("body", CHAIN, (*DISPLACED, Slot("force", None)), frozenset({"force"}))
    plain = Numbering.of(4, [body])
    assert plain.layout.names == ("u", "w", "force")
    assert plain.dofs["body"].tolist() == [[0, 3, 1, 4, 6], [1, 4, 2, 5, 6]]
    fields = {"hold": ("force",), "nobody has it": ("q",), "displacement": ("u", "w")}
    together = Numbering.of(4, [body], fields)
    assert (together.layout.names, together.layout.counts) == (("hold", "displacement"), (1, 6))
    assert together.dofs["body"].tolist() == [[1, 2, 3, 4, 0], [3, 4, 5, 6, 0]]
    assert together.nodal["w"].tolist() == [2, 4, 6, -1]
    assert together.at(("u", "w"), CHAIN).tolist() == together.rows("body", "displacement").tolist()


def test_fields_along_elements_have_unknowns_at_places_that_blocks_share() -> None:
    """Pressures of order 2 that are continuous, and an element at each of their places."""
    film = ElementUnknowns("film", CHAIN, DISPLACED, along={"p": np.array([[0, 1, 2], [2, 3, 4]])})
    each = ElementUnknowns(
        "each", np.empty((5, 0), np.int64), (), along={"p": np.arange(5)[:, None]}
    )
    found = Numbering.of(3, [film, each])
    assert found.layout.counts == (3, 3, 5)
    assert found.rows("film", "p").tolist() == [[6, 7, 8], [8, 9, 10]]
    assert found.dofs["film"][:, 4:].tolist() == found.rows("film", "p").tolist()
    assert found.dofs["each"][:, 0].tolist() == [6, 7, 8, 9, 10]


@pytest.mark.parametrize(
    ("second", "fields", "words"),
    [
        (
            ElementUnknowns("b", CHAIN, (Slot("u", None),)),
            None,
            "u: an unknown of nodes in one block",
        ),
        (ElementUnknowns("b", CHAIN, (), along={"u": CHAIN}), None, "u: an unknown of nodes"),
        (
            ElementUnknowns("b", CHAIN, (Slot("p", None),), along={"p": CHAIN}),
            None,
            "p: an unknown of elements and a field along them",
        ),
        (ElementUnknowns("b", CHAIN, (Slot("p", None),)), {"f": ("u", "p")}, "not all at nodes"),
        (
            ElementUnknowns("b", CHAIN, (Slot("p", None),)),
            {"p": ("u", "w")},
            "is not in it has this name",
        ),
    ],
)
def test_names_that_do_not_fit_together_are_refused(
    second: ElementUnknowns, fields: dict[str, tuple[str, ...]] | None, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Numbering.of(3, [ElementUnknowns("a", CHAIN, DISPLACED), second], fields)


# --- A body that floats is refused, whatever rounding makes of its matrix; one that is held is ----


RUBBER: dict[str, Any] = {"mu": 0.4, "lame": 2.0, "thickness": 1.0}


def pulled() -> Study:
    """A rectangle pulled at both ends."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), **RUBBER)
    study.load("left", u_x=-0.05)
    study.load("right", u_x=0.05)
    return study


WAYS: dict[str, Callable[[Study], object]] = {
    "solve": Study.solve,
    "march": lambda study: list(study.march(dt=0.5, until=1.0)),
    "follow": lambda study: study.follow(step=0.5, until=lambda r: r.t > 1.0),
}


@pytest.mark.parametrize("held", [{}, {"u_x": 0.0}, {"u_y": 0.0}])
@pytest.mark.parametrize("way", WAYS)
def test_a_body_in_balance_that_nothing_holds(held: dict[str, float], way: str) -> None:
    study = pulled()
    if held:
        study.fix((0.0, 0.0), **held)
    with pytest.raises(NotConverged):
        WAYS[way](study)


FREE: dict[str, tuple[Callable[[Study], object], str]] = {
    "nothing": (lambda s: None, "a translation along x, a translation along y, a rotation[.]"),
    "a roller": (lambda s: s.fix("bottom", u_y=0.0), "a translation along x[.]"),
    "a pin": (lambda s: s.fix((2.0, 1.0), u_x=0.0, u_y=0.0), r"a rotation about \(2, 1\)[.]"),
    "a spring": (
        lambda s: s.spring((2.0, 1.0), u_x=1e-3, u_y=1e-3),
        r"a rotation about \(2, 1\)[.]",
    ),
    "ties": (
        lambda s: s.tie("right", "left", "u_x", "u_y"),
        "a translation along x, a translation along y[.]",
    ),
}


@pytest.mark.parametrize("held", FREE)
@pytest.mark.parametrize("load", [0.0, 1e-12, 0.05])
def test_the_free_motion_is_named_before_anything_is_solved(held: str, load: float) -> None:
    support, words = FREE[held]
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), **RUBBER)
    study.load("right", u_x=load)
    support(study)
    with pytest.raises(NotConverged, match=f"not held: nothing prevents {words}"):
        study.solve()


@pytest.mark.filterwarnings("ignore:4 of 12 cells of the mesh have no elements")  # between them
def test_the_one_of_two_bodies_that_is_free_is_named() -> None:
    mesh = Mesh.rectangle(3.0, 1.0, cells=(6, 2)).with_group("a", lambda x: x[:, 0] < 1.1)
    study = Study(mesh.with_group("b", lambda x: x[:, 0] > 1.9))
    for name in "ab":
        study.add(name, pages.solid(), cells=name, **RUBBER)
    study.fix("left", u_x=0.0, u_y=0.0)
    with pytest.raises(NotConverged, match=r"a rotation of the part with node 4 \(2, 0\)"):
        study.solve()


def test_a_temperature_that_nothing_sets_is_named() -> None:
    study = Study(Mesh.line(1.0, cells=4))
    study.add("bar", bar(), k=1.0)
    with pytest.raises(NotConverged, match=r"nothing prevents a constant added to T[.]"):
        study.solve()
    study.spring("left", T=1e-6)
    study.load("right", T=1e-6)
    assert study.solve().at((0.0,))["T"] == pytest.approx(1.0)


def test_a_floor_holds_what_is_pressed_into_it() -> None:
    """It holds at the start already: its nodes are a little below."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)).map(lambda x: x - np.array([0.0, 1e-3])))
    study.add("body", pages.solid(), **RUBBER)
    study.add("floor", pages.floor(), on="bottom", k=10.0)
    study.fix((0.0, -1e-3), u_x=0.0)
    study.load("top", u_y=lambda x, t: np.full(len(x), -1e-2))
    assert 0.0 < study.solve().at((0.0, -1e-3))["u_y"] < 1e-3


def chain(n: int, ground: float) -> csc_array[np.float64]:
    """A chain of n springs of stiffness 1, whose first is held by another."""
    K = lil_array((n, n))
    K.setdiag(np.full(n, 2.0))
    K.setdiag(-np.ones(n - 1), 1)
    K.setdiag(-np.ones(n - 1), -1)
    K[0, 0], K[n - 1, n - 1] = 1.0 + ground, 1.0
    return csc_array(K)


@pytest.mark.parametrize(("n", "ground"), [(10, 1.0), (20_000, 1.0), (10, 1e-8)])
def test_badly_conditioned_is_not_loose(n: int, ground: float) -> None:
    K = chain(n, ground)
    assert unconstrained_unknown(K, SuperLU().factorise(K)) is None


def test_held_by_rounding_is_loose() -> None:
    K = chain(10, 1e-15)
    assert unconstrained_unknown(K, SuperLU().factorise(K)) is not None


def springy() -> Definition:
    """A linear elastic brick."""
    m = Model("brick", nodes=8, rule=quadrature.gauss(2, 3))
    X, u = m.coordinates("X", "Y", "Z"), m.nodal_unknowns("u_x", "u_y", "u_z")
    e = kinematics.isoparametric(m, X, shapes.hex8_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    eps = (F + F.T) / 2 - sp.eye(3)
    m.potential(m.integral("Pi", (eps.trace() ** 2 + (eps.T * eps).trace()) * e.detJ))
    return m.finish()


def test_a_body_of_three_dimensions_on_a_hinge() -> None:
    study = Study(Mesh.box((1.0, 2.0, 1.0), cells=(1, 2, 1)))
    study.add("body", springy())
    study.fix(lambda x: (x[:, 0] == 0.0) & (x[:, 2] == 1.0), u_x=0.0, u_y=0.0, u_z=0.0)
    with pytest.raises(NotConverged, match=r"a rotation about y through \(0, 1, 1\)[.]"):
        study.solve()
