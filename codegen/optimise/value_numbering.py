"""Value numbering: values that algebra proves equal become one.

Every value is computed once at a random point of a prime field (`graph.prime_field`): sums,
products, reciprocals and powers are those of the field.  Every other operation (a logarithm, a
branch, a sum over points) is a random number of its own, the same one only where operation and
arguments are the same.  Two values that agree there, up to sign, are equal as functions:

- A rational function that is not zero vanishes at a random point with a probability below
  degree / PRIME (Schwartz and Zippel), here below 1e-30.  Nothing depends on the size of an
  argument, so no state is near the point and none is far from it.
- A root of odd order is the root in the field: there it is the only one, as the positive root of a
  positive number is, and the same bound holds on the variety r^n = a.
- A root of even order is a number of its own, and its powers are powers of that number.

A formula need not have a value everywhere: 1/x has none at 0, log(x) none below.  Each value
carries the conditions of all operations below it.  It is replaced only by a value whose conditions
are among its own: sqrt(x) sqrt(y) and sqrt(x y) stay two values.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from softehl.codegen.graph.graph import BOOLEAN, ODD, Graph, Node, Op, Payload
from softehl.codegen.graph.prime_field import PRIME, image, root
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.graph.value_domain import EVERYWHERE

_EVERYWHERE = EVERYWHERE | BOOLEAN | {Op.CONST, Op.INPUT, Op.PI, Op.BRANCH, Op.ITEM}
"""Operations with a value for all arguments that have one."""
_APART = frozenset({Op.CONST, Op.PI, Op.CALL}) | BOOLEAN
"""What is never replaced: it costs nothing, or is no number."""


def merge_equal_values(g: Graph, roots: list[Node]) -> list[Node]:
    """Roots in which equal values are computed once (the first one written wins)."""
    values = _Values()
    leaders: dict[tuple[bool, int], list[Node]] = {}
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        values.add(n)
        value = values.of[n]
        if n.op not in _APART and value:
            same = leaders.setdefault((n.varying, min(value, PRIME - value)), [])
            leader = next((m for m in same if values.has_value_where(m, n)), None)
            if leader is not None:
                equal = values.of[leader] == value
                new[n] = new[leader] if equal else g.neg(new[leader])
                continue
            same.append(n)
        new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
    return [new[r] for r in roots]


Key = tuple[Op, Payload, tuple[int, ...]]


@dataclass
class _Values:
    """Of every node its value in the field and the conditions under which it has one (bits)."""

    of: dict[Node, int] = field(default_factory=dict)
    conditions: dict[Node, int] = field(default_factory=dict)
    atoms: dict[Key, int] = field(default_factory=dict)
    bits: dict[Key, int] = field(default_factory=dict)
    rng: random.Random = field(default_factory=lambda: random.Random(0))

    def has_value_where(self, a: Node, b: Node) -> bool:
        """True if `a` has a value wherever `b` has one, as far as conditions tell."""
        return self.conditions[a] & ~self.conditions[b] == 0

    def add(self, n: Node) -> None:
        """Value and conditions of a node whose operands have theirs."""
        below = 0
        for a in n.args:
            below |= self.conditions[a]
        self.of[n] = self._value(n, [self.of[a] for a in n.args])
        self.conditions[n] = below | self._own_conditions(n)

    def _value(self, n: Node, args: Sequence[int]) -> int:
        match n.op:
            case Op.CONST:
                exact = image(n.value)
                return self._atom(n, args) if exact is None else exact
            case Op.NAME:
                return args[0]
            case Op.ADD:
                return (args[0] + args[1]) % PRIME
            case Op.SUB:
                return (args[0] - args[1]) % PRIME
            case Op.MUL:
                return args[0] * args[1] % PRIME
            case Op.NEG:
                return -args[0] % PRIME
            case Op.RECIP | Op.SQRT | Op.CBRT | Op.RCBRT | Op.POW if args[0]:
                return self._power(n, args[0])
        return self._atom(n, args)

    def _power(self, n: Node, base: int) -> int:
        exponent = _exponent(n)
        order = exponent.denominator
        if order % 2:
            rooted = root(base, order)
        else:
            rooted = self._number((Op.POW, Fraction(1, order), (base,)))
        return pow(rooted, exponent.numerator, PRIME)

    def _atom(self, n: Node, args: Sequence[int]) -> int:
        """The number of an operation on these arguments; odd functions have that of one sign."""
        if n.op in (Op.SUM, Op.INPUT):
            return self._number((n.op, n.payload, (n.id,)))
        if n.op in ODD and args[0] > PRIME - args[0]:
            return PRIME - self._number((n.op, None, (PRIME - args[0],)))
        return self._number((n.op, n.payload, tuple(args)))

    def _number(self, key: Key) -> int:
        if key not in self.atoms:
            self.atoms[key] = self.rng.randrange(1, PRIME)
        return self.atoms[key]

    def _own_conditions(self, n: Node) -> int:
        if n.op in _EVERYWHERE:
            return 0
        if n.op in (Op.RECIP, Op.POW) and _exponent(n).denominator == 1:
            return self._nonzero(n.args[0]) if _exponent(n) < 0 else 0
        kind = Op.POW if n.op in (Op.SQRT, Op.CBRT, Op.RCBRT, Op.POW, Op.LOG) else n.op
        return self._bit((kind, None, tuple(self.of[a] for a in n.args)))

    def _nonzero(self, n: Node) -> int:
        """That a value is not zero: that none of its factors is."""
        bits = 0
        stack = [n]
        while stack:
            a = stack.pop()
            if a.op in (Op.MUL, Op.NEG):
                stack += a.args
            elif a.op is not Op.CONST:
                value = self.of[a]
                bits |= self._bit((Op.RECIP, None, (min(value, PRIME - value),)))
        return bits

    def _bit(self, key: Key) -> int:
        return self.bits.setdefault(key, 1 << len(self.bits))


_EXPONENTS = {
    Op.RECIP: Fraction(-1),
    Op.SQRT: Fraction(1, 2),
    Op.CBRT: Fraction(1, 3),
    Op.RCBRT: Fraction(-1, 3),
}


def _exponent(n: Node) -> Fraction:
    return n.payload if isinstance(n.payload, Fraction) else _EXPONENTS[n.op]
