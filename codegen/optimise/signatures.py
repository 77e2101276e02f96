"""Equality by numeric signature: values that are equal but written differently become one.

Every value is evaluated at random points in many digits.  Values that agree there, up to sign,
are merged after they have agreed again at fresh points: the chance of a false merge is that of
two different functions agreeing to 30 digits at all of them.  The first points have positive
arguments, where roots and logarithms have values; at the others every argument has a random sign,
which tells sqrt(x^2) from x.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import mpmath

from softehl.codegen.graph.arithmetic import number
from softehl.codegen.graph.graph import BOOLEAN, Graph, Input, Node, Op
from softehl.codegen.graph.traverse import reachable

DIGITS = 50
AGREE = 30
OPAQUE = (Op.INPUT, Op.SUM, Op.BRANCH, Op.ITEM)
"""Values that stand for themselves: a sample would see one side of a branch only."""
SMALL = mpmath.mpf(1) / 32
"""Size of the unknowns: near the undeformed state volumes are positive and roots have values."""
POINTS = 2
"""Points of the signature; as many fresh ones confirm each merge."""
SIGNED = 8
"""Points of either sign, where two equal values agree or have no value both."""


def merge_equal(g: Graph, roots: list[Node]) -> list[Node]:
    """Roots in which equal values are computed once (the first one written wins)."""
    nodes = reachable(roots)
    rng = random.Random(0)
    with mpmath.workdps(DIGITS):
        samples = [_sample(nodes, rng) for _ in range(2 * POINTS)]
        signed = [_sample(nodes, rng, signed=True) for _ in range(SIGNED)]
        first: dict[tuple[str, ...], Node] = {}
        same: dict[Node, tuple[Node, int]] = {}
        for n in nodes:
            if n.op in BOOLEAN or n.op in (Op.CONST, Op.PI, Op.CALL) or n.op in OPAQUE:
                continue
            key, sign = _signature([s[n] for s in samples[:POINTS]])
            if not key:
                continue
            leader = first.setdefault((str(n.varying), *key), n)
            if leader is not n:
                relative = sign * _signature([s[leader] for s in samples[:POINTS]])[1]
                fresh = samples[POINTS:]
                if _confirmed(fresh, leader, n, relative) and not _refuted(
                    signed, leader, n, relative
                ):
                    same[n] = (leader, relative)
    return _rebuilt(g, roots, same)


def _rebuilt(g: Graph, roots: Sequence[Node], same: dict[Node, tuple[Node, int]]) -> list[Node]:
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        if n in same:
            leader, sign = same[n]
            new[n] = new[leader] if sign > 0 else g.neg(new[leader])
        else:
            new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
    return [new[r] for r in roots]


Value = Any
"""An mpmath number, a truth value, or None where there is no value."""


def _sample(
    nodes: Sequence[Node], rng: random.Random, *, signed: bool = False
) -> dict[Node, Value]:
    """Values at one random point; None where there is none (a branch on complex numbers)."""
    values: dict[Node, Value] = {}
    for n in nodes:
        if n.op in OPAQUE:
            sign = rng.choice((-1, 1)) if signed else 1
            values[n] = sign * _random(rng) * (SMALL if _unknown(n) else 1)
        elif n.op is Op.CALL:
            values[n] = None
        else:
            args = [values[a] for a in n.args]
            values[n] = None if any(a is None for a in args) else _computed(n, args)
    return values


def _unknown(n: Node) -> bool:
    return isinstance(n.payload, Input) and n.payload.array in ("dofs", "interpolated")


def _random(rng: random.Random) -> mpmath.mpf:
    return mpmath.mpf(rng.getrandbits(160)) / 2**160 + mpmath.mpf(1) / 2


def _computed(n: Node, args: list[Value]) -> Value:
    try:
        return number(n, args)
    except (TypeError, ZeroDivisionError, ValueError):
        return None


def _signature(values: Sequence[Value]) -> tuple[tuple[str, ...], int]:
    """Leading digits of the values with the first one's sign taken out; empty for no value."""
    if any(v is None or isinstance(v, (bool, mpmath.mpc)) for v in values):
        return (), 1
    if any(v == 0 for v in values):
        return (), 1
    sign = 1 if values[0] > 0 else -1
    return tuple(mpmath.nstr(sign * v, AGREE) for v in values), sign


def _confirmed(samples: Sequence[dict[Node, Value]], a: Node, b: Node, sign: int) -> bool:
    for s in samples:
        x, y = s[a], s[b]
        if x is None or y is None or not _agree(x, sign * y):
            return False
    return True


def _refuted(samples: Sequence[dict[Node, Value]], a: Node, b: Node, sign: int) -> bool:
    """True where one of the two has a real value and the other has none, or another one."""
    for s in samples:
        real = [v is not None and not isinstance(v, mpmath.mpc) for v in (s[a], s[b])]
        if real[0] != real[1] or (all(real) and not _agree(s[a], sign * s[b])):
            return True
    return False


def _agree(x: Value, y: Value) -> bool:
    return bool(abs(x - y) <= mpmath.mpf(10) ** -AGREE * abs(x))
