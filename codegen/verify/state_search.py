"""States at which a kernel is checked beyond the ordinary ones of `random_states`.

Far states have unknowns, parameters, data and coordinates at scales from 1e-3 to 1e3 of the
ordinary ones, of both signs; unknowns also as a linear field over the nodes, in which an element
stays sound at large strain. Steered states make the model change its behaviour: each condition is
met on both sides, far from it and near it, and the argument of each function that saturates or
repeats is below -4, near 0 and above 4 (beyond pi; tanh, erf and exp are constant there to 2 %).
They are found by a line search in doubles: along the argument by which a condition changes most,
then by bisection. Conditions that were found nowhere are `missing`.
"""

from __future__ import annotations

import operator
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from time import perf_counter
from typing import Any

from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.language.definition import Definition
from softehl.codegen.verify.arithmetics import Doubles
from softehl.codegen.verify.reference_evaluator import Evaluator, OutOfTimeError
from softehl.codegen.verify.sympy_program import Program, Switch

DRAWN = 96
"""Far states that are drawn; of those with real values `FAR` are compared."""
FAR = 24
BEYOND = 4.0
"""Beyond pi; tanh and erf are one there, exp(-x) is zero, to 2 %."""
NEAR = 1e-3
"""Of the length of a line: the distance from a condition that is called near."""
LINES = 4
"""Arguments along which a condition is sought, those that change it most."""

Target = tuple[int, str]
"""Number of a switch and the side wanted: below, near (functions) or above."""
Slopes = list[tuple[list[float], list[list[float]]]]
"""Directions of all arguments, and how fast the operands of every switch change along each."""


@dataclass
class ProbedState:
    """A state with real values and the targets that it meets."""

    state: EvaluationState
    values: list[list[float]]
    meets: set[Target]


@dataclass
class StateSearch:
    """Far and steered states of one model, from an ordinary one."""

    program: Program
    nominal: Sequence[EvaluationState]
    unreal: int = 0
    late: bool = False
    missing: list[Target] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.d: Definition = self.program.definition
        self.evaluator = Evaluator(self.program, Doubles())
        self.rng = random.Random(f"{self.d.name} far")
        self.pool: list[ProbedState] = []

    def states(self, seconds: float) -> Iterator[EvaluationState]:
        """States in the order in which they are worth comparing; so long is searched at most."""
        self.evaluator.deadline = perf_counter() + seconds
        probed = [f for s in self.nominal[:1] if (f := self.probe(s))]
        if not probed:
            return
        self._draw()
        open_targets = self._targets() - probed[0].meets
        for f in self._cover(open_targets):
            yield f.state
            open_targets -= f.meets
        if open_targets:
            for f in self._steered(probed[0], open_targets):
                yield f.state
                open_targets -= f.meets
        conditions = [self.program.switches[k].condition for k, _ in sorted(open_targets)]
        pairs = zip(sorted(open_targets), conditions, strict=True)
        self.missing = [t for t, condition in pairs if condition or t[1] == "near"]
        yield from self._near_conditions([*probed, *self.pool])
        yield from (f.state for f in self.pool[:FAR])

    def text(self, target: Target) -> str:
        """Description of a target."""
        number, side = target
        switch = self.program.switches[number]
        text = switch.text if len(switch.text) < 60 else switch.text[:57] + "..."
        if switch.condition:
            return f"{text} {'true' if side == 'above' else 'false'}"
        return f"{text} where its argument is near 0"

    # probing ------------------------------------------------------------------------------------

    def probe(self, state: EvaluationState) -> ProbedState | None:
        """The state in doubles; None without real values, or if the model forbids it."""
        self.late = self.late or perf_counter() > self.evaluator.deadline
        if self.late or not _allowed(self.d, state):
            return None
        try:
            at = self.evaluator.at(state)
        except OutOfTimeError:
            self.late = True
            return None
        if not at.real():
            return None
        values = [_values(switch, at.rows) for switch in self.program.switches]
        meets = {
            (k, side)
            for k, switch in enumerate(self.program.switches)
            for side in _sides(switch, values[k])
        }
        return ProbedState(state, values, meets)

    def _targets(self) -> set[Target]:
        targets = set()
        for k, switch in enumerate(self.program.switches):
            sides = ("below", "above") if switch.condition else ("below", "near", "above")
            targets |= {(k, side) for side in sides}
        return targets

    # far ----------------------------------------------------------------------------------------

    def _draw(self) -> None:
        for k in range(DRAWN):
            if self.late:
                break
            probed = self.probe(self._far(k))
            if probed is None:
                self.unreal += not self.late
            else:
                self.pool.append(probed)

    def _far(self, k: int) -> EvaluationState:
        """The k-th far state: modes in turn, at scales that fill 1e-3 to 1e3 evenly."""
        base = self.nominal[k % len(self.nominal)]
        scale = 10 ** (6 * (k * 0.6180339887 % 1) - 3)
        mode = k % 6
        if mode == 5:
            size = 10 ** self.rng.uniform(-2, 2)
            shift = self.rng.choice((0, 0, -3))
            base = replace(base, coordinates=[size * (v + shift) for v in base.coordinates])
        dofs = self._random(base, scale) if mode in (0, 4) else self._linear(base, scale)
        if mode in (2, 3) and k % 4 < 2:
            dofs = list(base.dofs)
        state = replace(base, dofs=dofs)
        if mode == 2:
            return self._one_argument(state, k // 6)
        return self._arguments(state, signs=mode == 4) if mode in (3, 4) else state

    def _size(self, k: int, value: Any) -> float:
        """Size of an unknown: that of the model's example, or 1."""
        names = self.d.unknowns
        return abs(float(value)) if k < len(names) and names[k] in dict(self.d.example) else 1.0

    def _random(self, s: EvaluationState, scale: float) -> list[float]:
        pairs = enumerate(s.dofs)
        return [v + scale * (self._size(k, v) or 1) * self.rng.uniform(-1, 1) for k, v in pairs]

    def _linear(self, s: EvaluationState, scale: float) -> list[float]:
        """Unknowns of one name as a linear field over the nodes."""
        width = len(self.d.coordinates)
        extent = max(
            [abs(float(a) - float(b)) for a in s.coordinates for b in s.coordinates] or [1]
        )
        gradients: dict[str, list[float]] = {}
        out = []
        for k, v in enumerate(s.dofs):
            name, node = self.d.dof_nodes[k] if k < len(self.d.dof_nodes) else ("", None)
            if name not in gradients:
                gradients[name] = [scale * self.rng.uniform(-1, 1) for _ in range(width + 1)]
            first, *offsets = gradients[name]
            point = s.coordinates[width * (node or 0) : width * ((node or 0) + 1)]
            origin = s.coordinates[:width]
            moved = sum(
                c * (float(x) - float(o)) / (extent or 1)
                for c, x, o in zip(offsets, point, origin, strict=True)
            )
            out.append(v + (self._size(k, v) or 1) * (first + moved))
        return out

    def _one_argument(self, s: EvaluationState, k: int) -> EvaluationState:
        count = len(s.parameters) + len(s.data) + sum(map(len, s.point_data))
        factors = [1.0] * count
        if count:
            sign = -1 if k // count % 2 else 1
            factors[k % count] = sign * 10 ** self.rng.uniform(-3, 3)
        return _scaled(s, factors)

    def _arguments(self, s: EvaluationState, *, signs: bool) -> EvaluationState:
        count = len(s.parameters) + len(s.data) + sum(map(len, s.point_data))
        draw = [10 ** self.rng.uniform(-3, 3) for _ in range(count)]
        return _scaled(s, [f * (self.rng.choice((-1, 1)) if signs else 1) for f in draw])

    # steered ------------------------------------------------------------------------------------

    def _cover(self, open_targets: set[Target]) -> Iterator[ProbedState]:
        """States of the pool, each the one that meets most of what the others do not."""
        left = set(open_targets)
        while left and self.pool:
            best = max(self.pool, key=lambda f: len(f.meets & left))
            if not best.meets & left:
                return
            left -= best.meets
            self.pool.remove(best)
            yield best

    def _steered(self, start: ProbedState, open_targets: set[Target]) -> Iterator[ProbedState]:
        """States by line searches, from the first state at which the switch has a value."""
        left = set(open_targets)
        gradients: dict[int, Slopes] = {}
        for target in sorted(open_targets):
            starts = [f for f in (start, *self.pool) if f.values[target[0]]]
            if target not in left or not starts:
                continue
            if id(starts[0]) not in gradients:
                gradients[id(starts[0])] = self._gradient(starts[0])
            reached = self._along_lines(starts[0], target, gradients[id(starts[0])])
            if reached is not None:
                left -= reached.meets
                yield reached

    def _gradient(self, start: ProbedState) -> Slopes:
        """Directions, and by how much they change the operands of every switch."""
        base = _flat(start.state)
        out = []
        for direction in self._directions(start.state):
            h = 1e-6
            moved = self.probe(_state(start.state, _plus(base, h, direction)))
            if moved is not None:
                change = [
                    [(b - a) / h for a, b in zip(x, y, strict=False)]
                    for x, y in zip(start.values, moved.values, strict=True)
                ]
                out.append((direction, change))
        return out

    def _directions(self, s: EvaluationState) -> Iterator[list[float]]:
        """Every unknown of one name together, then every argument alone."""
        base, first = _flat(s), len(s.coordinates)
        count = len(s.dofs)
        names = [n for n, _ in self.d.dof_nodes] + [""] * (count - len(self.d.dof_nodes))
        order = sorted(range(count), key=lambda k: names[k])
        groups = [list(g) for _, g in groupby(order, key=lambda k: names[k])]
        for members in [g for g in groups if len(g) > 1] + [[k] for k in range(count)]:
            yield [float(k - first in members) for k in range(len(base))]
        for j, v in enumerate(base):
            if not first <= j < first + count:
                yield [(abs(v) or 1.0) * (k == j) for k in range(len(base))]

    def _along_lines(
        self, start: ProbedState, target: Target, gradient: Slopes
    ) -> ProbedState | None:
        """A state that meets a target, along the directions that change its switch most."""
        number, side = target
        switch, values = self.program.switches[number], start.values[number]
        if not values:
            return None
        edge = 0.0 if switch.condition or side == "near" else BEYOND
        level = {"below": -edge, "near": 0.0, "above": edge}[side]
        ranked = sorted(gradient, key=lambda x: -max(map(abs, x[1][number]), default=0))
        base = _flat(start.state)
        for direction, change in ranked[:LINES]:
            rates = [(v, c) for v, c in zip(values, change[number], strict=False) if c]
            steps = [(level - v) / c for v, c in rates][:1]
            steps = [
                t * f for t in steps for f in ((1, 0.97, 1.03) if side == "near" else (1.1, 2))
            ]
            steps += [sign * 10.0**k for k in range(-2, 5) for sign in (1, -1)]
            last = start
            for t in steps:
                probed = self.probe(_state(start.state, _plus(base, t, direction)))
                if probed is None:
                    continue
                if target in probed.meets:
                    return probed
                if side == "near" and (f := self._between(last, probed, target)):
                    return f
        return None

    def _between(self, a: ProbedState, b: ProbedState, target: Target) -> ProbedState | None:
        """A state near zero of a switch between two on different sides of it."""
        x, y = (f.values[target[0]] for f in (a, b))
        if not x or not y or (x[0] > 0) == (y[0] > 0):
            return None
        for f in self._bisected(a, b, target[0], 60):
            if target in f.meets:
                return f
        return None

    def _bisected(
        self, a: ProbedState, b: ProbedState, number: int, times: int
    ) -> Iterator[ProbedState]:
        """States on the line between two, ever closer to where the first value changes sign."""
        for _ in range(times):
            half = [(p + q) / 2 for p, q in zip(_flat(a.state), _flat(b.state), strict=True)]
            c = self.probe(_state(a.state, half))
            if c is None or not c.values[number]:
                return
            yield c
            above = c.values[number][0] > 0
            a, b = (c, b) if (a.values[number][0] > 0) == above else (a, c)

    def _near_conditions(self, pool: Sequence[ProbedState]) -> Iterator[EvaluationState]:
        """On both sides of every condition, close to it."""
        for k, switch in enumerate(self.program.switches):
            sides: dict[bool, ProbedState] = {}
            for f in pool if switch.condition else ():
                if f.values[k]:
                    sides.setdefault(f.values[k][0] > 0, f)
            if len(sides) == 2:
                times = 10  # halves: NEAR of the line
                close_states = {
                    f.values[k][0] > 0: f
                    for f in self._bisected(sides[False], sides[True], k, times)
                }
                yield from (f.state for f in close_states.values())


def _values(switch: Switch, rows: Sequence[list[Any]]) -> list[float]:
    """Operands of a switch at the points where they have values."""
    out = []
    for row in rows:
        a, b = row[switch.slot], 0.0 if switch.other is None else row[switch.other]
        if a is not None and b is not None and not isinstance(a, bool):
            out.append(float(a) - float(b))
    return out


def _sides(switch: Switch, values: Sequence[float]) -> Iterator[str]:
    if not values:
        return
    edge = 0.0 if switch.condition else BEYOND
    if min(values) < -edge:
        yield "below"
    if max(values) > edge:
        yield "above"
    if not switch.condition and min(map(abs, values)) < 1:
        yield "near"


_RELATIONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def _allowed(d: Definition, s: EvaluationState) -> bool:
    """True if the conditions of the model on parameters and data hold."""
    named = {a.name: [v] for a, v in zip(d.parameters, s.parameters, strict=True)}
    named |= {a.name: [v] for a, v in zip(d.data, s.data, strict=True)}
    named |= {a.name: [row[k] for row in s.point_data] for k, a in enumerate(d.point_data)}
    return all(_RELATIONS[c.relation](v, c.bound) for c in d.conditions for v in named[c.name])


def _scaled(s: EvaluationState, factors: Sequence[float]) -> EvaluationState:
    """Parameters, data and data of points times factors."""
    remaining = iter(factors)
    parameters = [v * next(remaining) for v in s.parameters]
    data = [v * next(remaining) for v in s.data]
    points = [[v * next(remaining) for v in row] for row in s.point_data]
    return replace(s, parameters=parameters, data=data, point_data=points)


def _flat(s: EvaluationState) -> list[float]:
    rows = [v for row in s.point_data for v in row]
    return [float(v) for v in (*s.coordinates, *s.dofs, *s.data, *s.parameters, *rows)]


def _state(like: EvaluationState, values: Sequence[float]) -> EvaluationState:
    """A state of the same shape."""
    remaining = list(values)

    def take(count: int) -> list[float]:
        head = remaining[:count]
        del remaining[:count]
        return head

    return replace(
        like,
        coordinates=take(len(like.coordinates)),
        dofs=take(len(like.dofs)),
        data=take(len(like.data)),
        parameters=take(len(like.parameters)),
        point_data=[take(len(row)) for row in like.point_data],
    )


def _plus(base: Sequence[float], t: float, direction: Sequence[float]) -> list[float]:
    return [v + t * w for v, w in zip(base, direction, strict=True)]
