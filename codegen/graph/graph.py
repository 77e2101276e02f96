"""Hash-consed expression graph with exact numbers.

A `Graph` interns `Node` values, so that equal expressions are one node and `is` compares them.
Node ids grow from operands to users: ascending ids are a topological order.  The constructors
apply only identities that never cost anything (zero, one, signs pulled outwards, exact constant
arithmetic); everything else is a named pass (`codegen.optimise.passes`).

A node *varies* when its value depends on the quadrature point; `SUM` adds its operand over the
points of the element and does not vary.

A `CALL` runs a `Routine`, a function of its own with several results, on its operands; `ITEM`
is one of the results.  The routine says how it is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import Any


class Op(StrEnum):
    """Operations of the graph; `codegen.graph.verifier` has the rules for their operands."""

    CONST = "const"
    PI = "pi"
    INPUT = "input"
    NAME = "name"
    ADD = "add"
    SUB = "sub"
    MUL = "mul"
    NEG = "neg"
    RECIP = "recip"
    POW = "pow"
    SQRT = "sqrt"
    CBRT = "cbrt"
    RCBRT = "rcbrt"
    LOG = "log"
    EXP = "exp"
    SIN = "sin"
    COS = "cos"
    TAN = "tan"
    ASIN = "asin"
    ACOS = "acos"
    ATAN = "atan"
    SINH = "sinh"
    COSH = "cosh"
    TANH = "tanh"
    ASINH = "asinh"
    ACOSH = "acosh"
    ATANH = "atanh"
    ERF = "erf"
    ERFC = "erfc"
    ATAN2 = "atan2"
    POWER = "power"
    LT = "lt"
    LE = "le"
    EQ = "eq"
    AND = "and"
    OR = "or"
    NOT = "not"
    BRANCH = "branch"
    SUM = "sum"
    CALL = "call"
    ITEM = "item"


BOOLEAN = frozenset({Op.LT, Op.LE, Op.EQ, Op.AND, Op.OR, Op.NOT})
ODD = frozenset(
    {Op.TAN, Op.ASIN, Op.ATAN, Op.SINH, Op.TANH, Op.ASINH, Op.ATANH, Op.ERF},
)
ELEMENTARY = ODD | {Op.ACOS, Op.COSH, Op.ACOSH, Op.ERFC}
"""Functions of one argument that are those of the C library and nothing more."""
_CONST, _ADD, _SUB, _MUL, _NEG, _RECIP = Op.CONST, Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.RECIP
"""Read once: Python 3.11 takes 80 ns to look up a member of an enum, as long as a whole rule."""
_CALLS = frozenset({Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP, Op.SIN, Op.COS, *ELEMENTARY})
FREE = frozenset({Op.CONST, Op.PI, Op.INPUT, Op.NAME})
"""Operations that cost nothing at run time."""


@dataclass(frozen=True)
class InputEntry:
    """One scalar argument of a kernel: `array[index]`, at the point when it varies."""

    array: str
    index: int
    varying: bool = False


@dataclass(frozen=True)
class ResultIndex:
    """Position of an `ITEM` among the results of its routine."""

    index: int


@dataclass(frozen=True, eq=False)
class Routine:
    """A function with several results that the graph calls and does not look into.

    `name` is unique in a model; `inputs` and `outputs` are the numbers of operands and results.
    """

    name: str
    inputs: int
    outputs: int

    def partials(self, g: Graph, item: Node) -> list[tuple[Node, Node]]:
        """Derivatives of one result with respect to the operands it depends on."""
        raise NotImplementedError

    def pullback(self, g: Graph, call: Node, seeds: Mapping[int, Node]) -> list[tuple[Node, Node]]:
        """Adjoints of the operands from those of all results, if it is `joint`."""
        raise NotImplementedError

    @property
    def joint(self) -> bool:
        """True if adjoints of operands come from those of all results at once (`pullback`)."""
        return False

    def along(self, g: Graph, item: Node, rates: Mapping[Node, Node]) -> Node | None:
        """Rate of a result from those of the operands; None: the sum of `partials` times these."""
        return None

    def divided(self, between: Any, call: Node) -> list[Node]:
        """Divided differences of all results between two states; see `divided_difference`."""
        raise NotImplementedError


Payload = Fraction | InputEntry | str | ResultIndex | Routine | None


class Node:
    """One interned value.  Compare with `is`; `id` orders operands before users."""

    __slots__ = ("args", "id", "op", "payload", "varying")

    def __init__(
        self, ident: int, op: Op, args: tuple[Node, ...], payload: Payload, varying: bool
    ) -> None:
        self.id = ident
        self.op = op
        self.args = args
        self.payload = payload
        self.varying = varying

    def __repr__(self) -> str:
        inner = ", ".join(f"#{a.id}" for a in self.args)
        return f"#{self.id} {self.op}({inner}){'' if self.payload is None else f' {self.payload}'}"

    @property
    def value(self) -> Fraction:
        """The exact number of a constant."""
        assert isinstance(self.payload, Fraction)
        return self.payload


class Graph:
    """Arena of interned nodes and their constructors."""

    def __init__(self) -> None:
        self._table: dict[tuple[Op, tuple[Node, ...], Payload], Node] = {}
        self._constants: dict[tuple[int, int], Node] = {}
        self.zero = self.const(0)
        self.one = self.const(1)
        self._makers: dict[Op, Callable[..., Node]] = {
            Op.ADD: self.add,
            Op.SUB: self.sub,
            Op.MUL: self.mul,
            Op.NEG: self.neg,
            Op.RECIP: self.recip,
            Op.BRANCH: self.branch,
            Op.SUM: self.sum,
            Op.POWER: self.general_power,
        }

    def __len__(self) -> int:
        return len(self._table)

    def node(self, op: Op, args: tuple[Node, ...] = (), payload: Payload = None) -> Node:
        """Intern a node without any rewriting."""
        key = (op, args, payload)
        existing = self._table.get(key)
        if existing is None:
            varying = (isinstance(payload, InputEntry) and payload.varying) or (
                op is not Op.SUM and any(a.varying for a in args)
            )
            existing = self._table[key] = Node(len(self._table), op, args, payload, varying)
        return existing

    # leaves -------------------------------------------------------------------------------------

    def const(self, value: int | Fraction) -> Node:
        ratio = value.as_integer_ratio()
        found = self._constants.get(ratio)
        if found is None:
            found = self._constants[ratio] = self.node(_CONST, (), Fraction(value))
        return found

    def pi(self) -> Node:
        return self.node(Op.PI)

    def input(self, array: str, index: int, *, varying: bool = False) -> Node:
        return self.node(Op.INPUT, (), InputEntry(array, index, varying))

    def name(self, label: str, value: Node) -> Node:
        """Give `value` an identity that differentiation can refer to."""
        return self.node(Op.NAME, (value,), label)

    # arithmetic ---------------------------------------------------------------------------------

    def neg(self, a: Node) -> Node:
        if a.op is _CONST:
            return self.const(-a.value)
        if a.op is _NEG:
            return a.args[0]
        if a.op is _SUB:
            return self.sub(a.args[1], a.args[0])
        return self.node(_NEG, (a,))

    def add(self, a: Node, b: Node) -> Node:
        if a is self.zero:
            return b
        if b is self.zero:
            return a
        if a.op is _CONST and b.op is _CONST:
            return self.const(a.value + b.value)
        if b.op is _NEG:
            return self.sub(a, b.args[0])
        if a.op is _NEG:
            return self.sub(b, a.args[0])
        if a is b:
            return self.mul(self.const(2), a)
        return self.node(_ADD, _ordered(a, b))

    def sub(self, a: Node, b: Node) -> Node:
        if b is self.zero:
            return a
        if a is self.zero:
            return self.neg(b)
        if a is b:
            return self.zero
        if a.op is _CONST and b.op is _CONST:
            return self.const(a.value - b.value)
        if b.op is _NEG:
            return self.add(a, b.args[0])
        if a.op is _NEG:
            return self.neg(self.add(a.args[0], b))
        return self.node(_SUB, (a, b))

    def mul(self, a: Node, b: Node) -> Node:
        if a is self.zero or b is self.zero:
            return self.zero
        if a is self.one:
            return b
        if b is self.one:
            return a
        if a.op is _NEG:
            return self.neg(self.mul(a.args[0], b))
        if b.op is _NEG:
            return self.neg(self.mul(a, b.args[0]))
        if b.op is _CONST:
            a, b = b, a
        if a.op is _CONST:
            return self._scaled(a.value, b)
        if (a.op is _RECIP and a.args[0] is b) or (b.op is _RECIP and b.args[0] is a):
            return self.one
        return self.node(_MUL, _ordered(a, b))

    def _scaled(self, factor: Fraction, b: Node) -> Node:
        if b.op is _CONST:
            return self.const(factor * b.value)
        if b.op is _MUL and b.args[0].op is _CONST:
            return self.mul(self.const(factor * b.args[0].value), b.args[1])
        if factor < 0:
            return self.neg(self.mul(self.const(-factor), b))
        return self.node(_MUL, (self.const(factor), b))

    def recip(self, a: Node) -> Node:
        if a.op is _CONST:
            if a.value == 0:
                raise ZeroDivisionError("division by an exact zero")
            return self.const(1 / a.value)
        if a.op is _RECIP:
            return a.args[0]
        if a.op is _NEG:
            return self.neg(self.recip(a.args[0]))
        return self.node(_RECIP, (a,))

    def div(self, a: Node, b: Node) -> Node:
        return self.mul(a, self.recip(b))

    def power(self, a: Node, exponent: Fraction | int) -> Node:
        e = Fraction(exponent)
        if e == 0:
            return self.one
        if e == 1:
            return a
        if e == -1:
            return self.recip(a)
        if a.op is _CONST and e.denominator == 1:
            return self.const(a.value ** int(e))
        if a.op is Op.POW and e.denominator == 1:
            inner = a.payload
            assert isinstance(inner, Fraction)
            return self.power(a.args[0], inner * e)
        return self.node(Op.POW, (a,), e)

    def general_power(self, a: Node, exponent: Node) -> Node:
        """Power whose exponent is a value; as C has it: of a < 0 for whole exponents only."""
        if exponent.op is _CONST:
            return self.power(a, exponent.value)
        return self.node(Op.POWER, (a, exponent))

    def call(self, op: Op, a: Node) -> Node:
        """A function of one argument: SQRT, CBRT, RCBRT = 1/CBRT, LOG, EXP, SIN, ..."""
        if op is Op.LOG and a is self.one:
            return self.zero
        if op is Op.LOG and a.op is Op.EXP:
            return a.args[0]
        if op is Op.EXP and a is self.zero:
            return self.one
        if a is self.zero and op in ODD:
            return a
        if op in (Op.SQRT, Op.CBRT) and a in (self.zero, self.one):
            return a
        if op is Op.RCBRT and a is self.one:
            return a
        return self.node(op, (a,))

    # logic and loops ----------------------------------------------------------------------------

    def compare(self, op: Op, a: Node, b: Node) -> Node:
        return self.node(op, (a, b))

    def branch(self, condition: Node, then: Node, otherwise: Node) -> Node:
        """`then` where the condition holds; only the taken side is ever evaluated."""
        if then is otherwise:
            return then
        holds = truth(condition)
        if holds is not None:
            return then if holds else otherwise
        if condition.op is Op.NOT:
            return self.branch(condition.args[0], otherwise, then)
        return self.node(Op.BRANCH, (condition, then, otherwise))

    def sum(self, body: Node) -> Node:
        """Sum of `body` over the quadrature points."""
        if body is self.zero:
            return body
        if body.op is _NEG:
            return self.neg(self.sum(body.args[0]))
        return self.node(Op.SUM, (body,))

    def run(self, routine: Routine, args: Sequence[Node]) -> list[Node]:
        """The results of a routine."""
        call = self.node(Op.CALL, tuple(args), routine)
        return [self.node(Op.ITEM, (call,), ResultIndex(k)) for k in range(routine.outputs)]

    def rebuild(self, op: Op, args: Sequence[Node], payload: Payload) -> Node:
        """The constructor of `op`, with its identities, on new operands.

        A division by zero stays what it is: it may stand on a side that is never taken.
        """
        try:
            return self._rebuilt(op, args, payload)
        except ZeroDivisionError:
            return self.node(op, tuple(args), payload)

    def _rebuilt(self, op: Op, args: Sequence[Node], payload: Payload) -> Node:
        maker = self._makers.get(op)
        if maker is not None:
            return maker(*args)
        if op in FREE and op is not Op.NAME:
            return self.node(op, (), payload)
        if op is Op.POW:
            assert isinstance(payload, Fraction)
            return self.power(args[0], payload)
        if op is Op.NAME:
            assert isinstance(payload, str)
            return self.name(payload, args[0])
        if op in _CALLS:
            return self.call(op, args[0])
        return self.node(op, tuple(args), payload)


def truth(condition: Node) -> bool | None:
    """Value of a condition on constants; None for others."""
    match condition.op:
        case Op.NOT:
            inner = truth(condition.args[0])
            return None if inner is None else not inner
        case Op.AND | Op.OR:
            decides = condition.op is Op.OR
            sides = [truth(a) for a in condition.args]
            return decides if decides in sides else None if None in sides else not decides
    if any(a.op is not Op.CONST for a in condition.args):
        return None
    a, b = (x.value for x in condition.args)
    return {Op.LT: a < b, Op.LE: a <= b, Op.EQ: a == b}[condition.op]


def _ordered(a: Node, b: Node) -> tuple[Node, Node]:
    return (a, b) if a.id <= b.id else (b, a)
