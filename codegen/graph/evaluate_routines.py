"""The slow oracle's values of routines: nothing here knows how they are differentiated or printed.

Local unknowns are found by Newton's method with differences for slopes; derivatives of functions
of stretches are differences of the function of the matrix.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import mpmath
from mpmath.libmp import NoConvergence

from softehl.codegen.graph.arithmetic import number
from softehl.codegen.graph.graph import Input, Node, Op, Place, Routine
from softehl.codegen.graph.routines import Inverse, Isotropic, Newton, depends
from softehl.codegen.graph.traverse import reachable

Number = Any
Vector = list[Number]
Evaluate = Callable[[Sequence[Node], Vector, Vector], Vector]


def results(r: Routine, args: Vector, evaluate: Evaluate) -> Vector:
    """Results of a routine in the working precision of mpmath; not-a-number where it has none."""
    match r:
        case Newton():
            return _newton(r, args, evaluate)
        case Inverse():
            inverted = mpmath.matrix(r.size, r.size)
            for k, a in enumerate(args):
                inverted[k // r.size, k % r.size] = a
            inverted = inverted**-1
            return [inverted[i, j] for i in range(r.size) for j in range(r.size)]
        case Isotropic():
            return _isotropic(r, args, evaluate)
    raise TypeError(f"no value for {r}")


def _newton(r: Newton, args: Vector, evaluate: Evaluate) -> Vector:
    p, s = args[: r.inputs - r.outputs], args[r.inputs - r.outputs :]
    before, A = mpmath.inf, None
    for _ in range(200):
        A = A or _slopes(r, s, p, evaluate)
        try:
            step = mpmath.lu_solve(A, mpmath.matrix(evaluate(r.equations, s, p)))
        except ZeroDivisionError:
            break
        s = [v - step[i] for i, v in enumerate(s)]
        digits = mpmath.mpf(10) ** (8 - mpmath.mp.dps)
        changes = [abs(v) for v in step]
        near = all(c <= digits * abs(v) for c, v in zip(changes, s, strict=True))
        if near or digits * max(1, *map(abs, s)) >= max(changes) > before / 2:
            return s  # to its own digits, or to those that rounding leaves
        before = max(changes)
        if before > _CLOSE * max(map(abs, s)):  # else these slopes give eight digits a step
            A = None
    return [mpmath.nan] * len(s)


_CLOSE = 1e-8


def _slopes(r: Newton, s: Vector, p: Vector, evaluate: Evaluate) -> mpmath.matrix:
    """dg/ds by differences."""
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 3)
    A = mpmath.matrix(len(s), len(s))
    for j in range(len(s)):
        plus, minus = (
            evaluate(r.equations, [v + t * h * (i == j) for i, v in enumerate(s)], p)
            for t in (1, -1)
        )
        for i in range(len(s)):
            A[i, j] = (plus[i] - minus[i]) / (2 * h)
    return A


def _isotropic(r: Isotropic, args: Vector, evaluate: Evaluate) -> Vector:
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 4)

    def derivative(entries: Vector, path: tuple[int, ...]) -> Number:
        if not path:
            return _energy(r, [*entries, *args[6:]], evaluate)
        plus, minus = (
            derivative([v + t * h * (i == path[0]) for i, v in enumerate(entries)], path[1:])
            for t in (1, -1)
        )
        return (plus - minus) / (2 * h)

    paths: list[tuple[int, ...]] = [()]
    if r.order == 1:
        paths = [(i,) for i in range(6)]
    elif r.order == 2:
        paths = [(i, j) for i in range(6) for j in range(i, 6)]
    return [derivative(args[:6], path) for path in paths]


def _energy(r: Isotropic, args: Vector, evaluate: Evaluate) -> Number:
    a, b, c, d, e, f = args[:6]
    eigenvalues = mpmath.eigsy(mpmath.matrix([[a, d, e], [d, b, f], [e, f, c]]), eigvals_only=True)
    return evaluate([r.energy], list(eigenvalues), args[6:])[0]


def symmetric(value: Node, unknowns: Sequence[Node]) -> bool:
    """True when `value` does not change under exchanges of `unknowns`.

    It is compared at random points between 1/64 and 64, where a function that is one-sided far
    from 1 shows it; points without a real value are left out.
    """
    rng = random.Random(0)
    inside = depends([value], unknowns)
    leaves = (Op.INPUT, Op.SUM, Op.ITEM)
    inputs = [n for n in reachable([value]) if n.op in leaves and n not in inside]
    with mpmath.workdps(30):
        for width in (0.5, 2, 4, 6, 6, 6, 6, 6):
            point = [mpmath.mpf(2) ** rng.uniform(-width, width) for _ in unknowns]
            at = {n: mpmath.mpf(2) ** rng.uniform(-width, width) for n in inputs}
            turns = [list(reversed(point))]
            turns += [[*point[k:], *point[:k]] for k in range(len(unknowns))]
            found = [_value_at(value, {**at, **dict(zip(unknowns, t, strict=True))}) for t in turns]
            if any(v is None for v in found):
                if any(v is not None for v in found):
                    return False
            elif any(abs(v - found[0]) > 1e-20 * (1 + abs(found[0])) for v in found):
                return False
    return True


def alike(a: Node, b: Node) -> bool:
    """True when two values are equal at random values of all that enters them."""
    rng = random.Random(1)
    leaves = [n for n in reachable([a, b]) if n.op in (Op.INPUT, Op.SUM, Op.ITEM)]
    with mpmath.workdps(30):
        at = {n: mpmath.mpf(rng.uniform(-1, 1)) for n in leaves}
        one, other = _value_at(a, dict(at)), _value_at(b, dict(at))
        return None in (one, other) or abs(one - other) <= 1e-20 * (1 + abs(one))


def _value_at(value: Node, at: dict[Node, Any]) -> Any:
    """A value from those of the inputs; None where it is not real."""
    for n in reachable([value], stop=at.__contains__):
        if n not in at:
            try:
                at[n] = _operation(n, [at[a] for a in n.args])
            except (ArithmeticError, TypeError, ValueError, NoConvergence):
                return None
    real = not isinstance(at[value], mpmath.mpc) and not mpmath.isnan(at[value])
    return at[value] if real else None


def _operation(n: Node, args: Vector) -> Any:
    if n.op is Op.ITEM:
        assert isinstance(n.payload, Place)
        return args[0][n.payload.index]
    if n.op is Op.CALL:
        assert isinstance(n.payload, Routine)
        return results(n.payload, args, _localised)
    return number(n, args)


def _localised(values: Sequence[Node], local: Vector, external: Vector) -> Vector:
    """Values of a routine from its arguments."""
    at: dict[Node, Any] = {}
    arrays = {"local": local, "external": external}
    found = []
    for n in reachable(values):
        if n.op is Op.INPUT:
            assert isinstance(n.payload, Input)
            at[n] = arrays[n.payload.array][n.payload.index]
    for value in values:
        found.append(_value_at(value, at))
        if found[-1] is None:
            raise ValueError("a local equation has no real value")
    return found
