"""Domains of values: which are never negative, which may be not-a-number for finite arguments.

Both answers are one-sided: True of `positive`, `nonnegative` and `exists` is certain, False is not.
"""

from __future__ import annotations

from fractions import Fraction

from softehl.codegen.graph.graph import BOOLEAN, Graph, InputEntry, Node, Op
from softehl.codegen.graph.traversal import reachable

Known = frozenset[Node]
"""Nodes that the sides of branches around a value say to be positive."""
EVERYWHERE = frozenset(
    {Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.NAME, Op.SUM, Op.EXP, Op.SIN, Op.COS, Op.TAN, Op.ATAN}
    | {Op.SINH, Op.COSH, Op.TANH, Op.ASINH, Op.ERF, Op.ERFC, Op.ATAN2}
)
"""Operations with a value for all arguments that have one."""
_WIDER = (Op.LOG, Op.ATANH)
"""Functions whose derivative has values where they have none."""
_PLAIN = (Op.NAME, Op.NEG, Op.ADD, Op.SUB)
WHOLE = frozenset(map(Fraction, range(1, 10)))
"""Exponents of powers that are products: they have a value everywhere."""
_GIVEN = {"parameters", "data", "point data", "rule", "coordinates"}
"""Arguments that a model may divide by: who gives them knows that they are not zero."""
_DEEP = 50
"""Levels that are looked at, so that Python's stack holds them."""


class Domain:
    """Answers about the nodes of one graph, remembered."""

    def __init__(self, g: Graph) -> None:
        self.zero = g.zero
        self._signs: dict[tuple[Node, Known], int] = {}
        self._exist: dict[tuple[Node, Known], bool] = {}
        self._fixed: dict[Node, bool] = {}

    def positive(self, n: Node, assumed: Known = frozenset()) -> bool:
        """True if a value, where it exists, is > 0."""
        return self._sign(n, assumed) == 2

    def nonnegative(self, n: Node, assumed: Known = frozenset()) -> bool:
        """True if a value, where it exists, is >= 0."""
        return self._sign(n, assumed) >= 1

    def exists(self, n: Node, assumed: Known = frozenset(), depth: int = 0) -> bool:
        """True if a value is a number for all finite arguments (overflow apart)."""
        key = (n, assumed)
        if key not in self._exist:
            self._exist[key] = depth < _DEEP and self._exists(n, assumed, depth + 1)
        return self._exist[key]

    def _exists(self, n: Node, assumed: Known, depth: int) -> bool:
        if n.op in (Op.ITEM, Op.CALL):  # where it has no result the whole element has none
            return True
        if n.op is Op.BRANCH:
            sides = (
                (1, assumed | self._says(n.args[0], True)),
                (2, assumed | self._says(n.args[0])),
            )
            return all(self.exists(n.args[k], side, depth) for k, side in sides)
        if not all(a.op in BOOLEAN or self.exists(a, assumed, depth) for a in n.args):
            return False
        return n.op in EVERYWHERE or not n.args or self._allowed(n, assumed)

    def _allowed(self, n: Node, assumed: Known) -> bool:
        """True if the argument of a function lies in its domain."""
        a = n.args[0]
        match n.op:
            case Op.SQRT:
                return self.nonnegative(a, assumed)
            case Op.CBRT:
                return True
            case Op.RECIP:
                return self.positive(a, assumed) or (self._is_condition(a) and a is not self.zero)
            case Op.LOG | Op.RCBRT | Op.POWER:
                return self.positive(a, assumed)
            case Op.POW:
                e = n.payload
                assert isinstance(e, Fraction)
                if e.denominator == 1 and e > 0:
                    return True
                if e.denominator == 1 and self._is_condition(a):
                    return True
                from_zero = e > 0 and e.denominator != 3  # a^(1/3) is a (a^(-1/3))^2
                return self.positive(a, assumed) or (from_zero and self.nonnegative(a, assumed))
        return False

    def _is_condition(self, n: Node) -> bool:
        """True if a value comes from parameters, data and constants alone."""
        if n not in self._fixed:
            sources = {m.payload.array for m in reachable([n]) if isinstance(m.payload, InputEntry)}
            called = any(m.op is Op.CALL for m in reachable([n]))
            self._fixed[n] = sources <= _GIVEN and not called
        return self._fixed[n]

    def propagates(self, otherwise: Node, a: Node) -> bool:
        """True if `otherwise` and its derivatives are not-a-number wherever `a` is."""
        strict = set(reachable([otherwise], stop=lambda n: n.op is Op.BRANCH))
        cores = self._cores(a)
        wider = any(m.op in _WIDER for m in reachable(cores))
        return not wider and all(core in strict for core in cores)

    def _cores(self, a: Node) -> list[Node]:
        """Values in `a` one of which is not-a-number where `a` is."""
        cores, stack, seen = [], [a], set[Node]()
        while stack:
            n = stack.pop()
            if n in seen or self.exists(n):
                continue
            seen.add(n)
            if n.op is Op.BRANCH and self._is_absolute(n):
                stack.append(n.args[2])
            elif self._is_plain(n):
                stack += n.args
            else:
                cores.append(n)
        return cores

    def _sign(self, n: Node, assumed: Known, depth: int = 0) -> int:
        """2 for positive, 1 for not negative, 0 for no idea."""
        if n in assumed:
            return 2
        key = (n, assumed)
        if key not in self._signs:
            self._signs[key] = self._compute(n, assumed, depth + 1) if depth < _DEEP else 0
        return self._signs[key]

    def _compute(self, n: Node, assumed: Known, depth: int) -> int:
        def signs() -> list[int]:
            return [self._sign(a, assumed, depth) for a in n.args]

        match n.op:
            case Op.CONST:
                return 2 if n.value > 0 else int(n.value == 0)
            case Op.PI | Op.EXP | Op.COSH:
                return 2
            case Op.NAME | Op.RECIP | Op.SUM | Op.RCBRT | Op.CBRT | Op.SQRT:
                return signs()[0] or int(n.op is Op.SQRT)
            case Op.ADD:
                sign = signs()
                return max(sign) if min(sign) else 0
            case Op.MUL:
                return max(min(signs()), int(n.args[0] is n.args[1]))
            case Op.POW | Op.POWER:
                e = n.payload
                even = isinstance(e, Fraction) and e.numerator % 2 == 0
                return max(signs()[0], int(even))
            case Op.BRANCH:
                c, a, b = n.args
                if self._is_absolute(n):
                    return 1
                return min(
                    self._sign(a, assumed | self._says(c, True), depth),
                    self._sign(b, assumed | self._says(c), depth),
                )
        return 0

    def _is_plain(self, n: Node) -> bool:
        """True if a value is a number for finite operands."""
        integer_power = n.op is Op.POW and n.payload in WHOLE
        product = n.op is Op.MUL and all(a.op is not Op.RECIP for a in n.args)
        return n.op in _PLAIN or integer_power or product

    def _is_absolute(self, n: Node) -> bool:
        c, a, b = n.args
        same = c.op is Op.LT and c.args[0] is b and c.args[1] is self.zero
        return same and a.op is Op.NEG and a.args[0] is b

    def _says(self, c: Node, holds: bool = False) -> Known:
        """Values that are positive if a condition holds, or if it does not."""
        if holds and c.op is Op.AND:
            return self._says(c.args[0], True) | self._says(c.args[1], True)
        if not holds and c.op is Op.OR:
            return self._says(c.args[0]) | self._says(c.args[1])
        if c.op is Op.NOT:
            return self._says(c.args[0], not holds)
        if c.op is (Op.LT if holds else Op.LE):
            a, b = c.args if holds else c.args[::-1]
            return frozenset({b}) if self.nonnegative(a) else frozenset()
        return frozenset()


def decidable(
    g: Graph, domain: Domain, c: Node, otherwise: Node | None = None
) -> tuple[Node | None, list[Node]]:
    """Condition under which `c` is decidable, although it may compare a not-a-number.

    None: everywhere.  Also the differences of what is compared, for the comparisons that may not
    be decidable.  `a and b` is false where one of them is, whatever the other one is.

    otherwise: the value where a comparison is false, as it is of what is not-a-number; where that
    is not-a-number as well, nothing has to be decided.
    """
    if c.op is Op.NOT:
        return decidable(g, domain, c.args[0])
    if c.op not in (Op.AND, Op.OR):
        unsure = [a for a in c.args if not domain.exists(a)]
        if otherwise is not None:
            unsure = [a for a in unsure if not domain.propagates(otherwise, a)]
        existence = [g.compare(Op.EQ, a, a) for a in unsure]
        if not existence:
            return None, []
        both = existence[0] if len(existence) == 1 else g.node(Op.AND, (existence[0], existence[1]))
        return both, [g.sub(*c.args)]
    (one, first), (other, second) = (decidable(g, domain, a) for a in c.args)
    # one of the two decides alone where it is false in `and`, true in `or`
    alone = [a if c.op is Op.OR else g.node(Op.NOT, (a,)) for a in c.args]
    differences = [*first, *second]
    if one is None or other is None:
        remaining, decides = (other, alone[0]) if one is None else (one, alone[1])
        return None if remaining is None else g.node(Op.OR, (remaining, decides)), differences
    either = [g.node(Op.AND, pair) for pair in ((one, alone[0]), (other, alone[1]))]
    both = g.node(Op.AND, (one, other))
    return g.node(Op.OR, (both, g.node(Op.OR, (either[0], either[1])))), differences
