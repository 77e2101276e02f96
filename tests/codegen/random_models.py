"""Random models: an expression language for hypothesis, and what such a model means in 50 digits.

The meaning shares no code with the compiler: SymPy differentiates the expressions as they were
written, `Digits` evaluates them with mpmath and carries a first-order bound of the rounding that
an evaluation in floating point may commit, so that "equal" can be scaled by the conditioning.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import mpmath
import sympy as sp
from hypothesis import strategies as st

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

DIGITS = 50
UNKNOWNS = tuple(sp.symbols("x y z", real=True))
K, XI = sp.Symbol("k", real=True), sp.Symbol("xi", real=True)
Q = sp.Rational


class OutsideError(ArithmeticError):
    """A state where the model has no value, or is too close to a branch to tell the side."""


# ------------------------------------------------------------------------------------- expressions


_WIDE_ONE: list[Callable[[Any], Any]] = [
    lambda a: 1 + 9 / (1 + sp.exp((1000 - a) / 10)),
    lambda a: sp.tanh(50 * (a + 2)),
    lambda a: sp.asin(sp.sin(a)),
    lambda a: sp.acos(sp.cos(a) / 2),
    lambda a: sp.atan(a / 3),
    lambda a: sp.sqrt(a**2 - 10 * a + 26),
    lambda a: (1 - sp.exp(-((a + 2) ** 2))) ** 2,
    lambda a: sp.sign(a + 50) * a,
    lambda a: sp.erf(a / 20),
]
_WIDE_TWO: list[Callable[[Any, Any], Any]] = [
    sp.atan2,
    lambda a, b: a * sp.Heaviside(b - 100, 0),
    lambda a, b: sp.Piecewise((a, a < -20), (b, a < 7), (a * b, True)),
]
"""Functions that are constant, smooth or one-sided near the state of rest and not far from it."""


def _grow(child: st.SearchStrategy[Any], wide: bool = False) -> st.SearchStrategy[Any]:
    one: list[Callable[[Any], Any]] = [
        lambda a: a**2,
        lambda a: a**3,
        lambda a: (1 + a**2) ** Q(-3, 2),
        lambda a: (2 + a**2) ** Q(1, 3),
        lambda a: (1 + a**2) ** Q(-2, 3),
        lambda a: (1 + a**2) ** Q(2, 7),
        lambda a: sp.sqrt(1 + a**2),
        lambda a: sp.log(2 + a**2),
        lambda a: sp.exp(sp.sin(a)),
        sp.cos,
        sp.Abs,
    ]
    two: list[Callable[[Any, Any], Any]] = [
        lambda a, b: a + b,
        lambda a, b: a - b,
        lambda a, b: a * b,
        lambda a, b: a / (1 + b**2),
        sp.Max,
        sp.Min,
        # one side of each has no value where the other one is taken
        lambda a, b: sp.Piecewise((sp.log(a) * b, a > 0), (b**2, True)),
        lambda a, b: sp.Piecewise((b / a, a > Q(1, 10)), (a * b, True)),
        lambda a, b: sp.Piecewise((sp.sqrt(a), a > 0), (b, True)),
    ]
    one, two = (_WIDE_ONE + one, _WIDE_TWO + two) if wide else (one, two)
    return st.one_of(
        st.tuples(st.sampled_from(one), child).map(lambda t: t[0](t[1])),
        st.tuples(st.sampled_from(two), child, child).map(lambda t: t[0](t[1], t[2])),
        st.tuples(child, child, child, child).map(
            lambda t: sp.Piecewise((t[0], t[1] < t[2]), (t[3], True))
        ),
        st.tuples(child, child, child).map(
            lambda t: sp.Piecewise((t[0], sp.And(t[1] > 0, t[2] <= 1)), (t[1] * t[2], True))
        ),
    )


def expressions(
    symbols: tuple[Any, ...], leaves: int = 6, *, wide: bool = False
) -> st.SearchStrategy[Any]:
    """Expressions over `symbols` with real values wherever they are evaluated."""
    numbers = st.sampled_from([Q(1, 3), Q(2), Q(-3, 2), Q(7, 5)])
    leaf = st.one_of(st.sampled_from(symbols), st.sampled_from(symbols), numbers)
    grown = st.recursive(leaf, lambda child: _grow(child, wide), max_leaves=leaves)
    return grown.filter(lambda e: not e.has(sp.zoo, sp.nan, sp.oo, sp.I))


@dataclass(frozen=True)
class Recipe:
    """A model in writing: named values, an integral, a potential, an exception to its derivative.

    `named` holds (symbol, expression, interface) in order, `inside` such ones that vary with xi.
    """

    named: tuple[tuple[Any, Any, bool], ...]
    inside: tuple[tuple[Any, Any, bool], ...]
    integrand: Any
    potential: Any
    exception: str
    given: Any
    unroll: bool

    def definition(self, name: str) -> Definition:
        """The same in the language of the generator."""
        m = Model(name, nodes=1, rule=quadrature.gauss(2, 1), unroll=self.unroll, doc="Random.")
        for u in UNKNOWNS:
            m.unknown(str(u))
        m.parameters(k="a parameter")
        m.point()
        of_model: dict[Any, Any] = {}
        for s, e, interface in (*self.named, *self.inside):
            slope = {UNKNOWNS[0]: self.given} if (s, "given") == (A, self.exception) else None
            e = e.xreplace(of_model)
            of_model[s] = m.define(str(s), e, interface=interface, derivative=slope)
        of_model[TOTAL] = m.integral(str(TOTAL), self.integrand.xreplace(of_model))
        frozen = {"constant": [A], "constant inside": [B]}.get(self.exception, [])
        held = [of_model[s] for s in frozen]
        m.potential(self.potential.xreplace(of_model), constant=held)
        return m.finish()


A, C, B, TOTAL = (sp.Symbol(s, real=True) for s in ("named_a", "named_c", "inside_b", "total"))


@st.composite
def recipes(draw: st.DrawFn, wide: bool = False) -> Recipe:
    """Every symbol of a model is used, so that no derivative vanishes for want of a dependence."""
    basis = (*UNKNOWNS, K)
    a, c = draw(expressions(basis, wide=wide)), draw(expressions((*basis, A), 4, wide=wide))
    b = draw(expressions((*UNKNOWNS, XI, A), 4, wide=wide))
    integrand = draw(expressions((*basis, XI, B, C), 5, wide=wide)) + B * XI + B
    outer = draw(expressions((*basis, C, TOTAL), 5, wide=wide))
    flag = st.booleans()
    return Recipe(
        named=((A, a + UNKNOWNS[0] / 7, draw(flag)), (C, c + A * UNKNOWNS[1] / 5, draw(flag))),
        inside=((B, b + UNKNOWNS[2] * XI / 3, draw(flag)),),
        integrand=integrand,
        potential=outer + TOTAL + C + A * K + sum(u**2 for u in UNKNOWNS) / 4,
        exception=draw(st.sampled_from(["", "", "constant", "constant inside", "given"])),
        given=draw(expressions(basis, 3, wide=wide)),
        unroll=draw(flag),
    )


# ------------------------------------------------------------------------------------ the meaning


@dataclass
class Meaning:
    """Derivatives of a recipe by the chain rule over its named symbols; SymPy differentiates each.

    Derivatives of the integral are integrals with names of their own.
    """

    recipe: Recipe
    integrals: dict[Any, Any] = field(default_factory=dict)
    _known: dict[Any, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        r = self.recipe
        self.values = {s: e for s, e, _ in (*r.named, *r.inside)}
        self.integrals[TOTAL] = r.integrand
        self.potential = r.potential
        self.frozen = {"constant": A, "constant inside": B}.get(r.exception)

    def residual(self, i: int) -> Any:
        """dPi/du_i with the constant held."""
        return self.slope(self.potential, i, self.frozen)

    def tangent(self, i: int, j: int) -> Any:
        """The constant follows the unknowns here."""
        return self.slope(self.residual(i), j, None)

    def slope(self, e: Any, j: int, frozen: Any) -> Any:
        key = (e, j, frozen)
        if key not in self._known:
            e = _without_extrema(e)
            out = sp.diff(e, UNKNOWNS[j])
            for s in sorted(e.free_symbols & {*self.values, *self.integrals}, key=str):
                if s is not frozen:
                    out += sp.diff(e, s) * self._named(s, j, frozen)
            self._known[key] = out
        return self._known[key]

    def _named(self, s: Any, j: int, frozen: Any) -> Any:
        if s in self.integrals:
            mark = "" if frozen is None else "_frozen"
            new = sp.Symbol(f"{s}_{j}{mark}", real=True)
            self.integrals.setdefault(new, self.slope(self.integrals[s], j, frozen))
            return new
        if (s, self.recipe.exception) == (A, "given"):
            return self.recipe.given if j == 0 else sp.Integer(0)
        return self.slope(self.values[s], j, frozen)


def _without_extrema(e: Any) -> Any:
    """Absolute values and extrema as branches: their derivative is that of the side taken."""
    e = e.replace(sp.sign, lambda a: sp.Piecewise((-1, a < 0), (1, True)))
    e = e.replace(sp.Heaviside, lambda a, _: sp.Piecewise((0, a < 0), (1, True)))
    e = e.replace(sp.Abs, lambda a: sp.Piecewise((-a, a < 0), (a, True)))
    for kind, less in ((sp.Max, True), (sp.Min, False)):

        def chosen(*args: Any, less: bool = less) -> Any:
            best = args[0]
            for a in args[1:]:
                best = sp.Piecewise((a, best < a if less else a < best), (best, True))
            return best

        e = e.replace(kind, chosen)
    return e


Pair = tuple[Any, Any]
"""A value and the bound of its rounding, in units of the floating-point epsilon."""


class Digits:
    """Values of a meaning at one state, in `DIGITS` digits."""

    def __init__(self, meaning: Meaning, state: Mapping[Any, float]) -> None:
        self.meaning = meaning
        self.state: dict[Any, Pair] = {s: (mpmath.mpf(v), 0) for s, v in state.items()}
        self.outer: dict[Any, Pair] = {}

    def __call__(self, e: Any) -> Pair:
        """Value and rounding bound of an expression that does not vary with xi."""
        with mpmath.workdps(DIGITS):
            return self._at(sp.sympify(e), self.outer, None)

    def _at(self, e: Any, memo: dict[Any, Pair], xi: Any) -> Pair:
        if e not in memo:
            memo[e] = self._compute(e, memo, xi)
        return memo[e]

    def _compute(self, e: Any, memo: dict[Any, Pair], xi: Any) -> Pair:
        if e.is_Symbol:
            return self._symbol(e, memo, xi)
        if e.is_Rational:
            v = mpmath.mpf(int(e.p)) / int(e.q)
            return v, abs(v)
        if e.is_NumberSymbol:
            v = mpmath.mpf(sp.N(e, DIGITS + 5))
            return v, abs(v)
        if isinstance(e, sp.Piecewise):
            for value, condition in e.args:
                if self._holds(condition, memo, xi):
                    return self._at(value, memo, xi)
            raise AssertionError("no side of a branch holds")
        if isinstance(e, sp.Pow):
            return _power(self._at(e.base, memo, xi), e.exp)
        pairs = [self._at(a, memo, xi) for a in e.args]
        return _operation(e, pairs)

    def _symbol(self, s: Any, memo: dict[Any, Pair], xi: Any) -> Pair:
        if s in self.state:
            return self.state[s]
        if s == XI:
            return xi, abs(xi)
        if s in self.meaning.values:
            return self._at(self.meaning.values[s], memo, xi)
        root = 1 / mpmath.sqrt(3)
        integrand = self.meaning.integrals[s]
        v, bound = zip(*(self._at(integrand, {}, p) for p in (-root, root)), strict=True)
        return v[0] + v[1], bound[0] + bound[1] + abs(v[0]) + abs(v[1])

    def _holds(self, c: Any, memo: dict[Any, Pair], xi: Any) -> bool:
        if c in (sp.true, sp.false):
            return bool(c)
        if isinstance(c, sp.Not):
            return not self._holds(c.args[0], memo, xi)
        if isinstance(c, sp.ITE):
            return self._holds(c.args[1 if self._holds(c.args[0], memo, xi) else 2], memo, xi)
        if isinstance(c, (sp.And, sp.Or)):
            sides = [self._holds(a, memo, xi) for a in c.args]
            return all(sides) if isinstance(c, sp.And) else any(sides)
        (a, x), (b, y) = (self._at(side, memo, xi) for side in (c.lhs, c.rhs))
        _distinct(a, b, x + y)
        return bool(a < b) if c.rel_op in ("<", "<=") else bool(a > b)


def _distinct(a: Any, b: Any, bound: Any) -> None:
    if abs(a - b) <= 1e-10 * (abs(a) + abs(b) + bound):
        raise OutsideError(f"{a} and {b} are too close to compare")


def _power(base: Pair, exponent: Any) -> Pair:
    a, bound = base
    if not exponent.is_Rational:
        raise OutsideError(f"exponent {exponent}")
    p = mpmath.mpf(int(exponent.p)) / int(exponent.q)
    if (a == 0 and p < 0) or (a < 0 and int(exponent.q) > 1):
        raise OutsideError(f"{a}**{exponent}")
    if a == 0:
        return mpmath.mpf(0), bound
    v = a ** int(exponent.p) if int(exponent.q) == 1 else a**p
    return v, abs(p * v / a) * bound + (1 + abs(p)) * abs(v)


_CALLS: dict[type, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    sp.exp: (mpmath.exp, mpmath.exp),
    sp.sin: (mpmath.sin, mpmath.cos),
    sp.cos: (mpmath.cos, mpmath.sin),
    sp.tanh: (mpmath.tanh, lambda a: mpmath.sech(a) ** 2),
    sp.asin: (mpmath.asin, lambda a: 1 / mpmath.sqrt(1 - a * a)),
    sp.acos: (mpmath.acos, lambda a: 1 / mpmath.sqrt(1 - a * a)),
    sp.atan: (mpmath.atan, lambda a: 1 / (1 + a * a)),
    sp.erf: (mpmath.erf, lambda a: 2 * mpmath.exp(-a * a) / mpmath.sqrt(mpmath.pi)),
}


def _operation(e: Any, pairs: list[Pair]) -> Pair:
    values = [v for v, _ in pairs]
    if isinstance(e, sp.Add):
        return mpmath.fsum(values), sum(b + abs(v) for v, b in pairs)
    if isinstance(e, sp.Mul):
        v, bound = pairs[0]
        for w, more in pairs[1:]:
            v, bound = v * w, abs(v) * more + abs(w) * bound + abs(v * w)
        return v, bound
    if isinstance(e, (sp.Max, sp.Min)):
        best = pairs[0]
        for other in pairs[1:]:
            _distinct(best[0], other[0], best[1] + other[1])
            best = other if (other[0] > best[0]) == isinstance(e, sp.Max) else best
        return best
    if isinstance(e, sp.atan2):
        (b, more), (a, bound) = pairs
        _distinct(b, mpmath.mpf(0), more)
        return mpmath.atan2(b, a), (abs(a) * more + abs(b) * bound) / (a * a + b * b) + 4
    a, bound = pairs[0]
    if isinstance(e, (sp.sign, sp.Heaviside)):
        _distinct(a, mpmath.mpf(0), bound)
        below = -1 if isinstance(e, sp.sign) else 0
        return mpmath.mpf(1 if a > 0 else below), mpmath.mpf(0)
    if isinstance(e, sp.Abs):
        _distinct(a, mpmath.mpf(0), bound)
        return abs(a), bound
    if isinstance(e, sp.log):
        if a <= 0:
            raise OutsideError(f"log {a}")
        return mpmath.log(a), bound / a + abs(mpmath.log(a)) + 1
    value, slope = _CALLS[type(e)]
    return value(a), abs(slope(a)) * (bound + abs(a)) + abs(value(a))
