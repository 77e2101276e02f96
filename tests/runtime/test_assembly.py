"""Sparse assembly against a dense loop, prescribed unknowns, norms and guards."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation import element_blocks
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.dofmap import DofLayout
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.sparsity import build_pattern
from softehl.runtime.discretisation.step_bounds import KeepsOrientation, StaysPositive
from tests.runtime.springs import Spring

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
