"""Plumbing of the generator's tests: small graphs, their derivatives, throw-away kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath

from codegen import build, linearise, pipeline
from codegen.abi import Task
from codegen.emit_c import Slot
from codegen.evaluate import Oracle, State, evaluate
from codegen.graph import Graph, Node
from codegen.model import Definition
from runtime.kernels import Kernel, load_kernel

Number = Any
Inputs = Mapping[tuple[str, int], Number]
DIGITS = 50


def inputs(*values: Number) -> dict[tuple[str, int], Number]:
    """Values of `dofs[0]`, `dofs[1]`, ... for `codegen.evaluate.evaluate`."""
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
    """Central difference of `root` with respect to `dofs[k]`: 90 digits, error about 1e-40."""
    with mpmath.workdps(90):
        h = mpmath.mpf(10) ** -20
        plus, minus = (
            evaluate(root, {**at, ("dofs", k): mpmath.mpf(at["dofs", k]) + s * h}, 90)
            for s in (1, -1)
        )
        return (plus - minus) / (2 * h)


# ------------------------------------------------------------------------------------------ models


def value(d: Definition, node: Node, state: State) -> Number:
    """Value of a node that does not vary with the point."""
    return Oracle(replace(d, potential=node)).potential(state)


def at_points(d: Definition, node: Node, state: State) -> list[Number]:
    """Values of a node at the points of `state.rule`."""
    return [row[0] for row in Oracle(replace(d, fields=(("it", node),))).fields(state)]


def linearised(d: Definition, state: State) -> tuple[list[Number], list[list[Number]]]:
    """Residual and tangent that the *unoptimised* output graphs of a model say, without any C."""
    ndof = len(state.dofs)
    with mpmath.workdps(90):
        R = [mpmath.mpf(0)] * ndof
        K = [[mpmath.mpf(0)] * ndof for _ in range(ndof)]
        for x in linearise.outputs(d, Task.TANGENT):
            for i, row in _shapes(d, x.row, state):
                if x.column is None:
                    R[i] += _contracted(d, x.node, state, [row])
                    continue
                for j, column in _shapes(d, x.column, state):
                    K[i][j] += _contracted(d, x.node, state, [row, column])
        return R, K


Shape = list[Number] | None


def _shapes(d: Definition, slot: Slot, state: State) -> list[tuple[int, Shape]]:
    """Unknowns behind a slot with the value of their shape function at every point."""
    if not slot.basis:
        return [(slot.position, None)]
    modes = len(state.basis[0])
    return [
        (len(d.unknowns) + m, [mpmath.mpf(b[m][slot.position]) for b in state.basis])
        for m in range(modes)
    ]


def _contracted(d: Definition, node: Node, state: State, shapes: Sequence[Shape]) -> Number:
    if all(s is None for s in shapes):
        return value(d, node, state)
    values = at_points(d, node, state)
    for s in shapes:
        values = [v * (1 if s is None else s[q]) for q, v in enumerate(values)]
    return mpmath.fsum(values)


def write(d: Definition, directory: Path) -> None:
    """All files of one model, as `softehl generate` writes them."""
    for name, text in pipeline.files([pipeline.compile_model(d)]).items():
        (directory / name).write_text(text, encoding="utf-8")


def compiled(d: Definition, directory: Path, level: str = "-O1") -> Kernel:
    """The kernel of a throw-away model, compiled with little optimisation (it is faster)."""
    write(d, directory)
    build.build(directory, extra=(*build.STRICT, level))
    return load_kernel(d.name, directory)
