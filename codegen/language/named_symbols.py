"""Named quantities as symbols through which SymPy differentiates and substitutes.

The result of `Model.define` stands for an expression.  To SymPy a plain symbol would be a constant:
`sp.diff(W, x)` of a W that uses a name of something with x in it would lose a term, and so would
`subs`.  A `Name` follows its definition there, or refuses where it has none (a local unknown, an
integral, ...).  `ExpandedName` does the same in another way, for the second reading of a model by
which its kernels are checked: the definition stands in the tree of the expression, where SymPy
finds it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from itertools import count
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.symbol import Str

from softehl.codegen.language.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterator

_NUMBERS = count()
_WRITTEN: ContextVar[bool] = ContextVar("written", default=False)


@contextmanager
def written_out() -> Iterator[None]:
    """Names of models that are made in this context are `Written`."""
    token = _WRITTEN.set(True)
    try:
        yield
    finally:
        _WRITTEN.reset(token)


def named(
    label: str,
    value: Any,
    *,
    has_definition: bool = True,
    prescribed: Mapping[Any, Any] | None = None,
) -> Any:
    """Return the name of `value`: one or several expressions. has_definition: False if it only
    depends on them.
    """
    values = [sp.sympify(v) for v in (value if isinstance(value, (list, tuple)) else [value])]
    if has_definition and _WRITTEN.get() and not prescribed:
        return ExpandedName(label, values[0])
    below = {s for v in values for s in _direct(v)} | set(prescribed or ())
    return Name(label, values[0] if has_definition else None, below, prescribed)


def placeholders(count: int, **assumptions: bool) -> list[Any]:
    """New symbols of which no other code knows, in SymPy's order.

    SymPy orders terms by names, and calls a Dummy without one by the number of those before it in
    the process: Dummy_10 before Dummy_9.
    """
    width = len(str(count - 1))
    return [sp.Dummy(f"s{k:0{width}}", **assumptions) for k in range(count)]


def _direct(value: Any) -> set[Any]:
    """Symbols and names of an expression, without those inside the definitions of its names."""
    if not isinstance(value, sp.Basic):
        return set(value.free_symbols)
    names, seen, waiting = set(), set(), [value]
    while waiting:  # each part once: what is written out stands in many places
        e = waiting.pop()
        if e not in seen:
            seen.add(e)
            waiting += e.args
            if isinstance(e, sp.Symbol):
                names.add(e)
    return names


def _refuse_truth(symbol: Any, other: object) -> None:
    """Raise where a model compares a name with a number by == or !=: the answer is always no."""
    if isinstance(other, (int, float, sp.Number)):
        caller = str(sys._getframe(2).f_globals.get("__name__", ""))
        page = caller.startswith("softehl.codegen.models")
        if page or not caller.startswith(("sympy.", "softehl.codegen.")):
            raise ModelError(
                f"{symbol} == {other} is neither true nor false while the page is read: write a "
                "branch as sp.Piecewise((value, sp.Eq(...)), (other, True))"
            )


class UnseenError(ModelError):
    """A model asks SymPy for the expression of a name without a definition."""


class Name(sp.Symbol):  # type: ignore[misc]
    """A symbol with a definition; two are equal only if they are one and the same."""

    definition: Any
    prescribed: Mapping[Any, Any] | None
    below: set[Any]
    number: int
    _derivatives: dict[Any, Any]
    _values: dict[Any, Any]

    def __new__(
        cls,
        label: str,
        definition: Any,
        below: Iterable[Any],
        prescribed: Mapping[Any, Any] | None = None,
    ) -> Name:
        self: Name = sp.Symbol.__xnew__(cls, label, real=True)
        self.definition, self.prescribed = definition, prescribed
        self.below, self.number = set(below), next(_NUMBERS)
        self._derivatives, self._values = {}, {}
        return self

    def __eq__(self, other: object) -> bool:
        _refuse_truth(self, other)
        return self is other

    def __ne__(self, other: object) -> bool:
        _refuse_truth(self, other)
        return self is not other

    __hash__ = sp.Symbol.__hash__

    @property
    def free_symbols(self) -> set[Any]:
        """The name itself and all that it depends on."""
        symbols: set[Any] = {self}
        waiting = [self]
        while waiting:
            for s in waiting.pop().below - symbols:
                symbols.add(s)
                if isinstance(s, Name):
                    waiting.append(s)
        return symbols

    def slope(self, s: Any, value: Any) -> None:
        """Declare the derivative by a symbol of what has no definition."""
        self._derivatives[s] = value

    def _above(self, sources: set[Any]) -> list[Name]:
        """Names that depend on `sources`, of this one and those below it, lowest first.

        In this order each is done with those below it known: long chains need no deep recursion.
        """
        names = [n for n in self.free_symbols if isinstance(n, Name) and n not in sources]
        reached = set(sources)
        users = []
        for n in sorted(names, key=lambda n: n.number):
            if n.below & reached:
                reached.add(n)
                users.append(n)
        return users if self in reached else []

    def _refusal(self, what: str, remedy: str) -> UnseenError:
        return UnseenError(f"{what} {self}, a name through which SymPy does not see: {remedy}")

    def _eval_derivative(self, s: Any) -> Any:
        if self is s:
            return sp.Integer(1)
        if s not in self._derivatives:
            for n in self._above({s}):
                if s not in n._derivatives:
                    n._derivatives[s] = n._slope(s)
        return self._derivatives.get(s, sp.Integer(0))

    def _eval_derivative_n_times(self, s: Any, n: Any) -> Any:
        return sp.Basic._eval_derivative_n_times(self, s, n)  # not that of an atom

    def _slope(self, s: Any) -> Any:
        if self.prescribed is not None:
            return sp.Add(*(d * sp.sympify(x).diff(s) for x, d in self.prescribed.items()))
        if self.definition is None:
            raise self._refusal(
                f"SymPy's derivative by {s} meets", f"use m.derivative(name, value, {s})"
            )
        return self.definition.diff(s)

    def _eval_subs(self, old: Any, new: Any) -> Any:
        key = (old, new)
        if key not in self._values:
            for n in self._above(_direct(old)):
                if key not in n._values:
                    value = n._definition(old)._subs(old, new)
                    n._values[key] = n if value == n.definition else value
        return self._values.get(key)

    def _definition(self, old: Any) -> Any:
        if self.definition is None or self.prescribed is not None:
            raise self._refusal(f"{old} is replaced in", "replace it before this is named")
        return self.definition

    def _xreplace(self, rule: Mapping[Any, Any]) -> tuple[Any, bool]:
        if self in rule:
            return rule[self], True
        if not isinstance(rule, dict):
            return self, False
        rules = dict(rule)
        for n in self._above({s for old in rule for s in _direct(old)}):
            value = n._definition(", ".join(map(str, rule)))._xreplace(rules)[0]
            rules[n] = n if value == n.definition else value
        value = rules.get(self, self)
        return value, value is not self

    def xreplace(self, rule: Any, hack2: bool = False) -> Any:
        return self._xreplace(rule)[0]  # not that of an atom

    def match(self, pattern: Any, old: bool = False) -> Any:
        """As of any symbol; refuses what `replace` asks of a symbol that this name depends on."""
        pattern = sp.sympify(pattern)
        if pattern is not self and not pattern.has(sp.Wild) and self._above(_direct(pattern)):
            raise self._refusal(f"{pattern} is looked for in", "use subs, not replace or collect")
        return super().match(pattern, old)

    def _eval_nseries(self, x: Any, n: Any, logx: Any, cdir: Any = 0) -> Any:
        if self is not x and self._above({x}):
            raise self._refusal(f"SymPy's series in {x} meets", "use m.derivative")
        return super()._eval_nseries(x, n, logx, cdir)


def _undecided(question: Callable[..., Any]) -> Callable[..., Any]:
    """A question of SymPy's simplification, with the answer None where it cannot be answered."""

    @wraps(question)
    def compare(*args: Any, **kwargs: Any) -> Any:
        try:
            return question(*args, **kwargs)
        except UnseenError:
            return None
        except TypeError as failed:  # a comparison of the numbers that SymPy tries
            if not str(failed).startswith(("Invalid NaN comparison", "Invalid comparison of non-")):
                raise
            return None

    return compare


# To fold branches in conditions, SymPy asks by substitution and derivatives whether both sides of a
# comparison are equal.  None means there "not known"; a made-up derivative would stay in its cache.
sp.Expr.equals = _undecided(sp.Expr.equals)
sp.Expr.is_constant = _undecided(sp.Expr.is_constant)

# SymPy orders terms by the names of classes first: the C is to be that of plain symbols.
Name.__name__ = "Symbol"


class ExpandedName(sp.Expr):  # type: ignore[misc]
    """A label and its definition, which SymPy sees."""

    is_Atom = True  # nothing is expanded inside
    is_commutative = True
    is_extended_real = is_real = True
    _diff_wrt = True
    _derivatives: dict[Any, Any]
    _free: set[Any] | None

    def __new__(cls, label: Any, definition: Any) -> ExpandedName:
        self: ExpandedName = sp.Expr.__new__(cls, Str(str(label)), definition)
        self._derivatives, self._free = {}, None
        return self

    @property
    def definition(self) -> Any:
        """Expression that defines the label."""
        return self.args[1]

    @property
    def func(self) -> Any:
        """Constructor that SymPy calls with changed arguments; its result has no name."""
        return lambda _, definition: definition

    @property
    def free_symbols(self) -> set[Any]:
        """Free symbols of the definition."""
        if self._free is None:
            self._free = set(self.definition.free_symbols)
        return self._free

    def doit(self, **_: Any) -> ExpandedName:
        """Itself."""
        return self

    def _eval_derivative(self, s: Any) -> Any:
        if s not in self._derivatives:
            self._derivatives[s] = self.definition.diff(s)
        return self._derivatives[s]

    def _sympystr(self, _: Any) -> str:
        return str(self.args[0])
