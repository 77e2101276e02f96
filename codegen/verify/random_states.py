"""Random admissible states of one element of any model, for checking its kernel.

Without further words: nodes on the unit cell (a line, square, cube, triangle, tetrahedron, moved
by 1 from every axis, so that it is a ring in axisymmetry too) and slightly off it, unknowns of a
few per cent, parameters and data (of points, too) about 1.  Values of a model's `example` are used
instead, also varied by a few per cent.  A state is admissible if the potential and the fields are
real numbers there: no logarithm or root of something negative, no division by zero.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import mpmath
from mpmath.libmp import NoConvergence

from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.graph.graph import BOOLEAN, Node, Op, Routine
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition, functions_of_user
from softehl.codegen.verify.arithmetics import Doubles
from softehl.codegen.verify.reference_evaluator import Evaluator
from softehl.codegen.verify.sympy_program import program
from softehl.errors import SoftehlError

ATTEMPTS = 40
STATES = 5
"""Of the check of derivatives that a user gives."""
DIGITS = 30
SPREAD = 0.05
"""Size of the random unknowns, and of the relative variation of what is given."""

CELLS: dict[tuple[int, int], tuple[tuple[float, ...], ...]] = {
    **{(1, k): ((0,) * k,) for k in (1, 2, 3)},
    **{(2, k): ((0,) * k, (1,) + (0,) * (k - 1)) for k in (1, 2, 3)},
    **{(3, k): ((0,) * k, (1,) + (0,) * (k - 1), (0.5,) + (0,) * (k - 1)) for k in (1, 2)},
}
"""Unit cells of elements without an integral, by number of nodes and of coordinates."""


def unit_cell(d: Definition) -> tuple[tuple[float, ...], ...] | None:
    """Places of the nodes of the element that a model is written for, between 0 and 1."""
    width = len(d.coordinates)
    for kind in ELEMENTS.values():
        if (len(kind.nodes), kind.dimension) == (d.nodes, d.rule.dimension) and width:
            low, size = min(min(p) for p in kind.nodes), max(map(max, kind.nodes))
            points = [[float((c - low) / (size - low)) for c in node] for node in kind.nodes]
            return tuple(tuple((p + [0.0] * width)[:width]) for p in points)
    return CELLS.get((d.nodes, width))


class NoStateError(SoftehlError, ValueError):
    """No admissible state of a model was found; the message says what the model must give."""


def admissible_states(definition: Definition, count: int) -> list[EvaluationState]:
    """`count` random admissible states with the same parameters, the same ones in every run.

    Raises `NoStateError`, with what to say in the model, if there are none.
    """
    addresses = dict(definition.addresses)
    unknown = [name for name in definition.functions if name not in addresses]
    if unknown:
        raise NoStateError(
            f"{definition.name} cannot be checked: it gets the address of {unknown[0]} when it is "
            "called; name its C text, m.external(..., source=...)"
        )
    rng = random.Random(definition.name)
    evaluator = Evaluator(program(definition), Doubles())
    states: list[EvaluationState] = []
    for attempt in range(ATTEMPTS + count):
        state = draw(definition, rng, attempt)
        if states:  # the states of a call share its parameters
            state = replace(
                state,
                parameters=states[0].parameters,
                arrays=states[0].arrays,
                array_rates=states[0].array_rates,
            )
        if evaluator.at(state).real():
            states.append(state)
        if len(states) == count:
            break
    else:
        name = fault(definition, draw(definition, random.Random(definition.name), ATTEMPTS))
        raise NoStateError(
            f"{definition.name} cannot be checked: {name or 'it'} has no real value at "
            "random states near the undeformed element with parameters about 1; say where it has "
            f"one, e.g. m.example({suggestion(definition)})"
        )
    return states


def check_external_functions(definition: Definition) -> None:
    """Compare derivatives of C functions of the user with differences at admissible states.

    Raises `ExternalFunctionError`, and `BuildError` where one cannot be compiled.
    """
    functions = set(functions_of_user(definition).values())
    if functions:
        with suppress(NoStateError):
            admissible_states(definition, STATES)
    for f in functions:
        f.check()


def draw(d: Definition, rng: random.Random, attempt: int = 0) -> EvaluationState:
    """One random state; the later the attempt, the smaller the variation."""
    deviation = SPREAD * 0.93 ** min(attempt, ATTEMPTS)
    example = dict(d.example)

    def vary(value: float) -> float:
        return value + deviation * (abs(value) or 1.0) * rng.uniform(-1, 1)

    def about_one(name: str) -> float:
        return vary(example[name]) if name in example else rng.uniform(0.5, 1.5)

    unknowns = [*d.unknowns, *(name for name in _fields(d) for _ in range(2))]
    dofs = [vary(example[n]) if n in example else deviation * rng.uniform(-1, 1) for n in unknowns]
    rule, addresses = _rule(d), dict(d.addresses)
    arrays = [a.layout.sample(rng) for a in d.arrays]
    return EvaluationState(
        coordinates=_coordinates(d, rng, deviation),
        dofs=dofs,
        data=[about_one(a.name) for a in d.data],
        parameters=[addresses.get(a.name) or about_one(a.name) for a in d.parameters],
        rule=rule,
        basis=[_linear(float(p[0]), len(_fields(d))) for p in rule] if d.interpolated else (),
        point_data=[[about_one(a.name) for a in d.point_data] for _ in rule],
        arrays=arrays,
        term_history=_term_history(d, rng, arrays),
        array_rates=[a.layout.rate(rng, v) for a, v in zip(d.arrays, arrays, strict=True)],
    )


def _term_history(
    d: Definition, rng: random.Random, arrays: Sequence[Sequence[float]]
) -> list[list[list[float]]]:
    """History of each term, and its rates where the model has some: numbers about 1."""
    if not d.term_history:
        return []
    lengths = [len(arrays[h.array]) for h in d.term_history] * (2 if d.point_rates else 1)
    return [[[rng.uniform(0.5, 1.5) for _ in range(n)] for n in lengths] for _ in d.rule.points]


def _coordinates(d: Definition, rng: random.Random, deviation: float) -> list[float]:
    example = dict(d.example)
    corners = unit_cell(d)
    out = []
    for a in range(d.nodes):
        for c, name in enumerate(d.coordinates):
            label = f"{name}{a + 1}"
            if label in example:
                coordinates = example[label]
            elif corners is None:
                raise NoStateError(
                    f"{d.name} cannot be checked: no cell of {d.nodes} nodes in "
                    f"{len(d.coordinates)} coordinates is known; say where the nodes may be: "
                    f"m.example({label}=...)"
                )
            else:
                coordinates = 1 + corners[a][c]
            out.append(coordinates + deviation * rng.uniform(-1, 1))
    return out


def _rule(d: Definition) -> list[tuple[float, ...]]:
    pairs = zip(d.rule.points, d.rule.weights, strict=True)
    return [tuple(float(v) for v in (*p, w)) for p, w in pairs]


def _fields(d: Definition) -> list[str]:
    """Names of the interpolated fields."""
    return d.interpolated.split(", ") if d.interpolated else []


def _linear(xi: float, fields: int) -> list[tuple[float, ...]]:
    """Values and derivatives of the linear shape functions of each field, zero for the others."""
    shapes = ((1 - xi) / 2, -0.5), ((1 + xi) / 2, 0.5)
    none = (0.0, 0.0)
    return [
        (*none * k, *shape, *none * (fields - 1 - k)) for k in range(fields) for shape in shapes
    ]


def fault(definition: Definition, state: EvaluationState) -> str | None:
    """The first operation without a real value at a state; None if everything has one."""
    return first_fault([definition.potential, *(n for _, n in definition.fields)], state)


def first_fault(roots: Sequence[Node], state: EvaluationState) -> str | None:
    """The first operation below `roots` without a real value at a state."""
    with mpmath.workdps(DIGITS):
        walk = Walk(state, {})
        bad = [n for n in roots if not _real(walk, n, state)]
        nodes = (n for n in reachable(bad) if n.op not in (*BOOLEAN, Op.CALL))
        first = next((n for n in nodes if not _real(walk, n, state)), None)
    return None if first is None else _described(first)


def _described(n: Node) -> str:
    """An operation and the last named quantity that it uses, for the author of the model."""
    if n.op is Op.ITEM and isinstance(n.args[0].payload, Routine):
        return n.args[0].payload.name
    names = [str(a.payload) for a in reachable(n.args) if a.op is Op.NAME]
    return f"{n.op}(.. {names[-1]} ..)" if names else str(n.op)


def _real(walk: Walk, n: Node, state: EvaluationState) -> bool:
    try:
        values: list[Any] = [walk.at(n, q) for q in range(len(state.rule) if n.varying else 1)]
    except (ArithmeticError, ValueError, TypeError, NoConvergence):
        # TypeError: complex numbers have no order
        return False
    return all(isinstance(v, mpmath.mpf) and mpmath.isfinite(v) for v in values)


def suggestion(d: Definition) -> str:
    """Arguments of `example` that a model may need."""
    names = [a.name for a in (*d.parameters, *d.data, *d.point_data)] or list(d.unknowns[:2])
    return ", ".join(f"{n}=..." for n in names)
