"""Lowering of SymPy expressions to graph nodes: exact numbers, no expansion, one node per value.

`Symbols` hold the node that each symbol of a model stands for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

from softehl.codegen.graph.graph import Graph, InputEntry, Node, Op
from softehl.codegen.graph.length_derivatives import length
from softehl.codegen.graph.traversal import Recursion, recursion
from softehl.codegen.graph.value_domain import Domain, decidable
from softehl.codegen.language.definition import Statement
from softehl.codegen.language.errors import ModelError, page_line
from softehl.codegen.language.flatten import Entries
from softehl.codegen.language.named_symbols import named
from softehl.codegen.language.sympy_tape import SympyTape

_FUNCTIONS: dict[type, Op] = {
    sp.log: Op.LOG,
    sp.exp: Op.EXP,
    sp.sin: Op.SIN,
    sp.cos: Op.COS,
    sp.tan: Op.TAN,
    sp.asin: Op.ASIN,
    sp.acos: Op.ACOS,
    sp.atan: Op.ATAN,
    sp.sinh: Op.SINH,
    sp.cosh: Op.COSH,
    sp.tanh: Op.TANH,
    sp.asinh: Op.ASINH,
    sp.acosh: Op.ACOSH,
    sp.atanh: Op.ATANH,
    sp.erf: Op.ERF,
    sp.erfc: Op.ERFC,
}
SUPPORTED = (
    "+ - * / **, sqrt, cbrt, log, exp, sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, "
    "asinh, acosh, atanh, erf, erfc, Abs, sign, Heaviside, Min, Max, Piecewise"
)


def _decimal(e: sp.Float) -> Fraction:
    """The decimal as which a float was written, exactly.

    A result of rounding has more digits than anybody writes: 1 / 3, 0.1 + 0.2.
    """
    text = str(e)
    if not e.is_finite or sp.Float(text, precision=e._prec) != e:
        raise ModelError(
            f"{sp.N(e, 17)} is a rounded number; write an exact one, e.g. Rational(1, 3) for 1 / 3 "
            "or Rational('0.1') where decimals are added or multiplied"
        )
    return Fraction(text)


PIECES = 60
"""Pieces of one Piecewise: each is a branch inside the one before."""


class Lowering:
    """Converts SymPy expressions whose symbols are bound to nodes in `bound`."""

    def __init__(self, graph: Graph, bound: Mapping[sp.Symbol, Node]) -> None:
        self.g = graph
        self.bound = bound
        self._memo: dict[Any, Node] = {}
        self.domain = Domain(graph)
        self._rules: list[tuple[Any, Callable[[Any], Recursion[Node]]]] = [
            (sp.Add, self._add),
            (sp.Mul, self._mul),
            (sp.exp, lambda e: self._call(Op.EXP, e)),
            (sp.Pow, self._pow),
            (sp.Piecewise, self._pieces),
            ((sp.Max, sp.Min), self._extremum),
            (sp.Abs, self._absolute),
            (sp.sign, lambda e: self._step(e.args[0], (-1, 0, 1))),
            (sp.Heaviside, lambda e: self._step(e.args[0], (0, e.args[1], 1))),
            (sp.atan2, self._arctangent),
            (sp.core.relational.Relational, self._relation),
            ((sp.And, sp.Or, sp.Not), self._logic),
            (sp.ITE, self._choice),
        ]

    def __call__(self, expression: Any) -> Node:
        try:
            return recursion(self._lower(expression))
        except RecursionError:
            raise ModelError(
                "an expression is nested too deeply for SymPy: name its parts with m.define"
            ) from None

    def _lower(self, expression: Any) -> Recursion[Node]:
        try:
            e = sp.sympify(expression)
        except (sp.SympifyError, TypeError, ValueError):
            raise ModelError(f"{expression!r} is no mathematical expression") from None
        existing = self._memo.get(e)
        if existing is None:
            existing = self._memo[e] = yield self._convert(e)
        return existing

    def _convert(self, e: Any) -> Recursion[Node]:
        if isinstance(e, sp.Symbol):
            return self._symbol(e)
        if isinstance(e, sp.Rational):
            return self.g.const(Fraction(int(e.p), int(e.q)))
        if e is sp.pi:
            return self.g.pi()
        if e is sp.E:
            return self.g.call(Op.EXP, self.g.one)
        if isinstance(e, sp.Float):
            return self.g.const(_decimal(e))
        if e in self.bound:  # a name that is written out
            return self.bound[e]
        if hasattr(e, "definition"):
            return (yield self._lower(e.definition))
        for kind, rule in self._rules:
            if isinstance(e, kind):
                return (yield rule(e))
        operation = _FUNCTIONS.get(type(e))
        if operation is not None:
            return (yield self._call(operation, e))
        if isinstance(e, sp.MatrixBase):
            raise ModelError(f"a matrix of shape {e.shape} where a scalar is needed")
        if e in (sp.zoo, sp.nan, sp.oo, -sp.oo):
            raise ModelError(f"{e} is no number: something is divided by zero, or is infinite")
        if isinstance(e, (sp.Derivative, sp.Integral)):
            raise ModelError(f"{e} is not carried out: use m.derivative or m.integral")
        if e is sp.I or isinstance(e, (sp.re, sp.im, sp.conjugate)):
            raise ModelError(f"{e} has no kernel operation: kernels compute with real numbers")
        raise ModelError(
            f"{type(e).__name__} in {e} has no kernel operation; there are {SUPPORTED}"
        )

    def _symbol(self, e: Any) -> Node:
        if e not in self.bound:
            alike = any(str(e) == str(s) for s in self.bound)
            hint = ": use the symbol that the model returned" if alike else ""
            raise ModelError(f"symbol {e} is not declared in the model{hint}")
        return self.bound[e]

    def _add(self, e: Any) -> Recursion[Node]:
        result = self.g.zero
        for term in e.args:
            result = self.g.add(result, (yield self._lower(term)))
        return result

    def _mul(self, e: Any) -> Recursion[Node]:
        top, bottom = self.g.one, self.g.one
        for factor in e.args:
            if isinstance(factor, sp.Pow) and factor.exp.is_Rational and factor.exp < 0:
                inverted = yield self._lower(factor.base**-factor.exp)
                bottom = self.g.mul(bottom, inverted)
            else:
                top = self.g.mul(top, (yield self._lower(factor)))
        return self.g.div(top, self._divisor(bottom, e))

    def _divisor(self, n: Node, e: Any) -> Node:
        value = n
        while value.op is Op.NAME:
            value = value.args[0]
        if value is self.g.zero:
            raise ModelError(f"{e} divides by zero")
        return n

    def _pow(self, e: Any) -> Recursion[Node]:
        base, exponent = e.base, e.exp
        if isinstance(base, sp.Abs) and isinstance(exponent, sp.Rational) and exponent < 1:
            # SymPy makes |x|^(2/3) of (x^2)^(1/3); the square needs no branch
            base, exponent = base.args[0] ** 2, exponent / 2
        base = yield self._lower(base)
        if exponent.is_negative:
            self._divisor(base, e)
        if isinstance(exponent, sp.Float):
            return self._fixed_power(base, _decimal(exponent))
        if isinstance(exponent, sp.Rational):
            return self._fixed_power(base, Fraction(int(exponent.p), int(exponent.q)))
        power = yield self._lower(exponent)
        if e.base.is_positive or self.domain.positive(base):
            return self.g.call(Op.EXP, self.g.mul(power, self.g.call(Op.LOG, base)))
        if self._may_end(base):
            return self.g.general_power(length(self.g, base), self.g.mul(self.g.const(2), power))
        return self.g.general_power(base, power)

    def _fixed_power(self, base: Node, e: Fraction) -> Node:
        if e > 1 and e.denominator > 1 and self._may_end(base):
            return self.g.power(length(self.g, base), 2 * e)
        return self.g.power(base, e)

    def _may_end(self, base: Node) -> bool:
        """True for a sum of squares: at zero, derivatives of its powers are those of a length."""
        while base.op is Op.NAME:
            base = base.args[0]
        squares = base.op is Op.ADD and self.domain.nonnegative(base)
        return squares and not self.domain.positive(base)

    def _pieces(self, e: Any) -> Recursion[Node]:
        if len(e.args) > PIECES:
            raise ModelError(
                f"a Piecewise of {len(e.args)} pieces; at most {PIECES} are allowed: use fewer"
            )
        return (yield self._piecewise(list(e.args), e))

    def _piecewise(self, pairs: list[Any], expression: Any) -> Recursion[Node]:
        value, condition = pairs[0].args
        if condition is sp.true:
            return (yield self._side(value))
        if len(pairs) == 1:
            raise ModelError(
                f"a branch without a last condition: {expression}; end it with (.., True)"
            )
        decides, then = (yield self._lower(condition)), (yield self._side(value))
        otherwise = yield self._piecewise(pairs[1:], expression)
        return self._decided(decides, self.g.branch(decides, then, otherwise))

    def _side(self, value: Any) -> Recursion[Node]:
        """A side; SymPy makes zoo of 1 / Piecewise((a, c), (0, True)) where c does not hold."""
        if value is sp.zoo:
            return self.g.node(Op.RECIP, (self.g.zero,))
        return (yield self._lower(value))

    def _decided(self, condition: Node, value: Node) -> Node:
        """`value`, or not-a-number where its condition compares not-a-number.

        The power of three is so in the first and second derivatives, too.
        """
        if value.op is not Op.BRANCH:
            return value
        otherwise = value.args[2] if value.args[0] is condition else None
        existence, differences = decidable(self.g, self.domain, condition, otherwise)
        if existence is None:
            return value
        total = self.g.zero
        for d in differences:
            total = self.g.add(total, d)
        return self.g.branch(existence, value, self.g.power(total, 3))

    def _extremum(self, e: Any) -> Recursion[Node]:
        result = yield self._lower(e.args[0])
        for a in e.args[1:]:
            other = yield self._lower(a)
            less = self.g.compare(Op.LT, result, other)
            first, second = (other, result) if isinstance(e, sp.Max) else (result, other)
            result = self._decided(less, self.g.branch(less, first, second))
        return result

    def _absolute(self, e: Any) -> Recursion[Node]:
        a = yield self._lower(e.args[0])
        return self.g.branch(self.g.compare(Op.LT, a, self.g.zero), self.g.neg(a), a)

    def _call(self, op: Op, e: Any) -> Recursion[Node]:
        return self.g.call(op, (yield self._lower(e.args[0])))

    def _arctangent(self, e: Any) -> Recursion[Node]:
        y, x = (yield self._lower(e.args[0])), (yield self._lower(e.args[1]))
        return self.g.node(Op.ATAN2, (y, x))

    def _step(self, argument: Any, values: tuple[Any, Any, Any]) -> Recursion[Node]:
        """One value below zero, one at zero, one above."""
        a = yield self._lower(argument)
        below = yield self._lower(values[0])
        at = yield self._lower(values[1])
        above = yield self._lower(values[2])
        zero = self.g.zero
        upper = self.g.branch(self.g.compare(Op.LT, zero, a), above, at)
        less = self.g.compare(Op.LT, a, zero)
        return self._decided(less, self.g.branch(less, below, upper))

    def _relation(self, e: Any) -> Recursion[Node]:
        a, b = (yield self._lower(e.lhs)), (yield self._lower(e.rhs))
        match e.rel_op:
            case "<":
                return self.g.compare(Op.LT, a, b)
            case "<=":
                return self.g.compare(Op.LE, a, b)
            case ">":
                return self.g.compare(Op.LT, b, a)
            case ">=":
                return self.g.compare(Op.LE, b, a)
            case "==":
                return self.g.compare(Op.EQ, a, b)
        return self.g.node(Op.NOT, (self.g.compare(Op.EQ, a, b),))

    def _logic(self, e: Any) -> Recursion[Node]:
        if isinstance(e, sp.Not):
            return self.g.node(Op.NOT, ((yield self._lower(e.args[0])),))
        op = Op.AND if isinstance(e, sp.And) else Op.OR
        result = yield self._lower(e.args[0])
        for a in e.args[1:]:
            result = self.g.node(op, (result, (yield self._lower(a))))
        return result

    def _choice(self, e: Any) -> Recursion[Node]:
        """Condition on a branch as SymPy writes it: (c and a) or (not c and b)."""
        c, a, b = e.args
        return (yield self._lower(sp.Or(sp.And(c, a), sp.And(sp.Not(c), b))))


class Symbols:
    """All symbols of one model, its graph, and the record of the model; each label is used once."""

    def __init__(self, model: str) -> None:
        self.model = model
        self.graph = Graph()
        self.record = SympyTape()
        self.bound: dict[sp.Symbol, Node] = {}
        self.lower = Lowering(self.graph, self.bound)
        self.statements: list[Statement] = []
        self._counts: dict[str, int] = {}
        self.routines: dict[Any, Any] = {}
        """Routines of run-time arrays, and labels of their values by their arguments."""
        self._by_label: dict[str, Any] = {}

    def __contains__(self, label: str) -> bool:
        return label in self._by_label

    def inputs(self) -> set[str]:
        """Labels of all arguments."""
        return {
            str(s)
            for s, n in self.bound.items()
            if isinstance(n.payload, InputEntry) and n.payload.array != "arrays"
        }

    def numbered(self, label: str) -> str:
        """The label with the number of those before it."""
        self._counts[label] = self._counts.get(label, 0) + 1
        return f"{label}_{self._counts[label]}"

    def label_of(self, node: Node) -> str | None:
        """Label of the first symbol of a node."""
        return next((str(s) for s, n in self.bound.items() if n is node), None)

    def input(self, label: str, array: str, index: int, *, varying: bool = False) -> sp.Symbol:
        """The symbol of an entry of an array of arguments."""
        node = self.graph.input(array, index, varying=varying)
        symbol: sp.Symbol = self._bind(sp.Symbol(label, real=True), node)
        return symbol

    def name(self, label: str, node: Node, value: Any, **how: Any) -> Any:
        """A name that SymPy differentiates through (`names.named`); the old one for an old node."""
        existing = self._by_label.get(label)
        symbol = existing if existing is not None else named(label, value, **how)
        return self._bind(symbol, node)

    def named(self, label: str, like: Entries, nodes: Sequence[Node], below: list[Any]) -> Any:
        """Names for `nodes` that depend on `below`, arranged like other values."""
        labels = [label + suffix for suffix in like.suffixes]
        symbols = [
            self.name(entry, self.graph.name(entry, n), below, has_definition=False)
            for entry, n in zip(labels, nodes, strict=True)
        ]
        return Entries(symbols, like.suffixes, like.arrange).shaped()

    def state(self, label: str, node: Node) -> None:
        """Note a value with its line on the page; label: empty for an equation."""
        self.statements.append(Statement(label, node, page_line()))

    def placeholders(self, label: str, symbols: Entries) -> list[Node]:
        """Inputs in place of local unknowns while their equations are recorded."""
        nodes = [self.graph.input(f"local {label}", k) for k in range(len(symbols.values))]
        self.bound.update(zip(symbols.values, nodes, strict=True))
        return nodes

    def _bind(self, symbol: Any, node: Node) -> Any:
        label = str(symbol)
        previous = self.bound.get(self._by_label.setdefault(label, symbol), node)
        if previous is not node:
            kinds = " and ".join(dict.fromkeys(map(_kind, (previous, node))))
            raise ModelError(
                f"the name {label} is used twice in model {self.model}, for {kinds}: rename one"
            )
        is_bound = symbol in self.bound
        self.bound[symbol] = node
        if isinstance(node.payload, InputEntry):
            self.record.inputs[symbol] = (node.payload.array, node.payload.index)
        elif not is_bound:
            self.state(label, node)
        return symbol


_KINDS = {
    "dofs": "an unknown",
    "coordinates": "a coordinate",
    "parameters": "a parameter",
    "rule": "the quadrature",
}


def _kind(node: Node) -> str:
    """Kind of a named quantity, for messages."""
    if not isinstance(node.payload, InputEntry):
        return "an intermediate"
    return _KINDS.get(node.payload.array, node.payload.array)
