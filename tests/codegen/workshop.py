"""Plumbing of the generator's tests: small graphs, their derivatives, throw-away kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

from softehl.codegen import pipeline
from softehl.codegen.abi import Task
from softehl.codegen.derive import task_outputs
from softehl.codegen.derive.output_entries import OutputSlot
from softehl.codegen.graph.evaluation import EvaluationState, evaluate
from softehl.codegen.graph.graph import Graph, Node
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import build, output_files
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.kernels.array_data import data_of
from softehl.runtime.kernels.kernel import Kernel, load_kernel

Number = Any
Inputs = Mapping[tuple[str, int], Number]
DIGITS = 50


def inputs(*values: Number) -> dict[tuple[str, int], Number]:
    """Values of `dofs[0]`, `dofs[1]`, ... for `codegen.graph.evaluation.evaluate`."""
    return {("dofs", k): v for k, v in enumerate(values)}


def unknowns(g: Graph, count: int) -> list[Node]:
    """Input nodes `dofs[0]`, `dofs[1]`, ..."""
    return [g.input("dofs", k) for k in range(count)]


def close(a: Number, b: Number, tolerance: float = 1e-30) -> bool:
    """Equality to 30 digits, relative to the larger of 1 and the expected value; NaN is unequal."""
    with mpmath.workdps(DIGITS):
        return bool(abs(mpmath.mpmathify(a) - b) <= tolerance * max(1, abs(b)))


def same_value(a: Node, b: Node, at: Inputs) -> bool:
    """The two graphs agree to 40 of their 50 digits."""
    return close(evaluate(a, at, DIGITS), evaluate(b, at, DIGITS), 1e-40)


def difference(root: Node, at: Inputs, k: int) -> Number:
    """Central difference of `root` with respect to `dofs[k]`: 150 digits, error about 1e-80."""
    with mpmath.workdps(150):
        h = mpmath.mpf(10) ** -40
        plus, minus = (
            evaluate(root, {**at, ("dofs", k): mpmath.mpf(at["dofs", k]) + s * h}, 150)
            for s in (1, -1)
        )
        return (plus - minus) / (2 * h)


# ------------------------------------------------------------------------------------------ models


def value(d: Definition, node: Node, state: EvaluationState) -> Number:
    """Value of a node that does not vary with the point."""
    return Oracle(replace(d, potential=node)).potential(state)


def at_points(d: Definition, node: Node, state: EvaluationState) -> list[Number]:
    """Values of a node at the points of `state.rule`."""
    return [row[0] for row in Oracle(replace(d, fields=(("it", node),))).fields(state)]


def linearised(d: Definition, state: EvaluationState) -> tuple[list[Number], list[list[Number]]]:
    """Residual and tangent that the *unoptimised* output graphs of a model say, without any C."""
    ndof = len(state.dofs)
    with mpmath.workdps(90):
        R = [mpmath.mpf(0)] * ndof
        K = [[mpmath.mpf(0)] * ndof for _ in range(ndof)]
        for x in task_outputs.outputs(d, Task.TANGENT):
            for i, row in _shapes(d, x.row, state):
                if x.column is None:
                    R[i] += _contracted(d, x.node, state, [row])
                    continue
                for j, column in _shapes(d, x.column, state):
                    K[i][j] += _contracted(d, x.node, state, [row, column])
        return R, K


Shape = list[Number] | None


def _shapes(d: Definition, slot: OutputSlot, state: EvaluationState) -> list[tuple[int, Shape]]:
    """Unknowns behind a slot with the value of their shape function at every point."""
    if not slot.basis:
        return [(slot.position, None)]
    modes = len(state.basis[0])
    return [
        (len(d.unknowns) + m, [mpmath.mpf(b[m][slot.position]) for b in state.basis])
        for m in range(modes)
    ]


def _contracted(
    d: Definition, node: Node, state: EvaluationState, shapes: Sequence[Shape]
) -> Number:
    if all(s is None for s in shapes):
        return value(d, node, state)
    values = at_points(d, node, state)
    for s in shapes:
        values = [v * (1 if s is None else s[q]) for q, v in enumerate(values)]
    return mpmath.fsum(values)


def write(d: Definition, directory: Path) -> None:
    """All files of one model, as `softehl generate` writes them."""
    directory.mkdir(exist_ok=True)
    for name, text in output_files.files([pipeline.compile_model(d)]).items():
        (directory / name).write_text(text, encoding="utf-8")


def compiled(d: Definition, directory: Path, level: str = "-O0") -> Kernel:
    """The kernel of a throw-away model, compiled without optimisation (a quarter of the time)."""
    write(d, directory)
    build.build(directory, extra=(*build.STRICT, level))
    return load_kernel(d.name, directory)


def element_state(kernel: Kernel, coordinates: Any, dofs: Any, **given: Any) -> EvaluationState:
    """One element's arguments for the oracle, from those of the kernel's methods."""
    rule = given.get("rule") or kernel.default_rule
    table = np.column_stack([rule.points.reshape(len(rule.weights), -1), rule.weights])
    parameters, arrays = given.get("parameters", ()), list[list[float]]()
    if isinstance(parameters, Mapping):
        arrays = [data_of(a, parameters[a.name]).numbers.tolist() for a in kernel.arrays]
        parameters = [parameters[p] for p in kernel.parameters]
    rows, terms = np.asarray(given.get("point_data", ())), list[Any]()
    if kernel.term_history:
        of = {a.name: len(v) for a, v in zip(kernel.arrays, arrays, strict=True)}
        rows, history = rows[:, : len(kernel.point_data)], rows[:, len(kernel.point_data) :]
        ends = np.cumsum([of[array] for _, array in kernel.term_history])[:-1]
        terms = [[part.tolist() for part in np.split(row, ends)] for row in history]
    return EvaluationState(
        np.ravel(coordinates).tolist(),
        np.ravel(dofs).tolist(),
        np.ravel(given.get("data", ())).tolist(),
        list(parameters),
        table.tolist(),
        () if rule.basis is None else rule.basis.tolist(),
        rows.tolist(),
        arrays,
        term_history=terms,
    )


def off(found: Any, exact: Any) -> float:
    """Largest difference relative to the largest exact entry; infinite for not-a-number."""
    expected = np.array(exact, dtype=object).astype(np.float64)
    difference = np.abs(np.asarray(found) - expected)
    assert difference.shape == expected.shape
    if np.isnan(difference).any():
        return np.inf
    return float(difference.max() / max(np.abs(expected).max(), 1e-300))


def tangent_errors(d: Definition, kernel: Kernel, coordinates: Any, dofs: Any, **given: Any) -> Any:
    """Errors of residual and of tangent times a random vector against the oracle (see `off`)."""
    at = element_state(kernel, coordinates, dofs, **given)
    batched = {k: np.array([v]) if k.endswith("data") else v for k, v in given.items()}
    R, K = kernel.tangent(np.reshape(coordinates, (1, -1)), np.reshape(dofs, (1, -1)), **batched)
    oracle = Oracle(d)
    v = np.random.default_rng(11).uniform(0.5, 1.5, len(at.dofs))
    return off(R[0], oracle.residual(at)), off(K[0] @ v, oracle.product(at, v.tolist()))
