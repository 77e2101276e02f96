"""Record of a model as its SymPy expressions, for the check of its kernels.

A kernel is checked against an evaluation of these expressions that shares neither the conversion
to a graph nor anything after it (`verify.sympy_program`). The model only records them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from softehl.codegen.external_function import ExternalFunction
from softehl.codegen.language.named_symbols import placeholders


@dataclass(frozen=True)
class Integral:
    """Sum over the points of integrand times weight."""

    integrand: Any


@dataclass(frozen=True)
class Local:
    """Unknown of local equations, or argument of an energy of stretches."""


@dataclass(frozen=True)
class Implicit:
    """Entry `index` of the solution of equations = 0 for `unknowns`, near `start`."""

    equations: tuple[Any, ...]
    unknowns: tuple[Any, ...]
    start: tuple[Any, ...]
    index: int


@dataclass(frozen=True)
class Principal:
    """`energy` at the eigenvalues of a symmetric matrix, given by its `entries` row by row."""

    energy: Any
    squares: tuple[Any, ...]
    entries: tuple[Any, ...]


@dataclass(frozen=True)
class ExternalResult:
    """Result `index` of a C function of the user at `inputs`."""

    function: ExternalFunction
    inputs: tuple[Any, ...]
    index: int


@dataclass(frozen=True)
class OfArray:
    """Function of `args` that a run-time array defines; `amount` is that of its variation."""

    layout: Any
    amount: Any
    args: tuple[Any, ...]


@dataclass(frozen=True)
class MatrixFunction:
    """A function of a square matrix, given by its `entries` row by row.

    kind: "isotropic" of a symmetric one, with the eigenvalue and f in `function`; "exponential";
    "eigenvalues" of a symmetric one, the largest first.
    """

    kind: str
    entries: tuple[Any, ...]
    function: tuple[Any, ...] = ()


@dataclass(frozen=True)
class FunctionResult:
    """Entry `index` of the results of a function."""

    of: MatrixFunction
    index: int


@dataclass(frozen=True)
class Terms:
    """Reduction of `value`, a function of the `entries` of arrays whose variation has `amounts`."""

    kind: str
    entries: tuple[Any, ...]
    amounts: tuple[Any, ...]
    value: Any


@dataclass(frozen=True)
class Slope:
    """Derivative of `value` by the quantity of a symbol."""

    value: Any
    by: Any


@dataclass
class SympyTape:
    """Record of a model: definitions of names, potentials with frozen quantities, fields, history.

    `inputs` holds array and index of every argument; names not in `meanings` are arguments.
    """

    meanings: dict[Any, Any] = field(default_factory=dict)
    inputs: dict[Any, tuple[str, int]] = field(default_factory=dict)
    potentials: list[tuple[Any, tuple[Any, ...]]] = field(default_factory=list)
    fields: list[tuple[str, Any]] = field(default_factory=list)
    history: list[tuple[str, Any]] = field(default_factory=list)
    updates: list[tuple[int, Any]] = field(default_factory=list)
    """Numbers of history of terms, and symbols of their new values."""

    def define(self, symbol: Any, meaning: Any) -> Any:
        """Note what a symbol means (the first time counts); returns the symbol."""
        self.meanings.setdefault(symbol, meaning)
        return symbol

    def implicit(self, equations: Any, unknowns: Any, start: Any, solution: Sequence[Any]) -> None:
        """Note local unknowns and the names of their solution."""
        for s in unknowns:
            self.meanings[s] = Local()
        for k, s in enumerate(solution):
            self.define(s, Implicit(tuple(equations), tuple(unknowns), tuple(start), k))

    def principal(self, symbol: Any, energy: Any, squares: Any, C: Any) -> Any:
        """Note an energy of stretches; returns its name."""
        for s in squares:
            self.meanings[s] = Local()
        pairs = [(C[i, j], C[j, i]) for i in range(3) for j in range(3)]
        entries = tuple(sp.sympify(a if a is b else (a + b) / 2) for a, b in pairs)
        return self.define(symbol, Principal(energy, tuple(squares), entries))

    def external(
        self, function: ExternalFunction, inputs: Sequence[Any], results: Sequence[Any]
    ) -> None:
        """Note the names of the results of a C function of the user."""
        for k, symbol in enumerate(results):
            self.define(symbol, ExternalResult(function, tuple(inputs), k))

    def matrix_function(self, function: MatrixFunction, results: Sequence[Any]) -> None:
        """Note a function of a matrix and the names of its results."""
        for s in function.function[:1]:
            self.meanings[s] = Local()
        for k, s in enumerate(results):
            self.define(s, FunctionResult(function, k))

    def reduction(
        self,
        kind: str,
        entries: Sequence[Any],
        amounts: Sequence[Any],
        values: Sequence[Any],
        symbols: Sequence[Any],
    ) -> None:
        """Note the names of reductions over terms."""
        for s in entries:
            self.meanings[s] = Local()
        for value, symbol in zip(values, symbols, strict=True):
            self.define(symbol, Terms(kind, tuple(entries), tuple(amounts), value))

    def derivatives(
        self, value: Any, by: Sequence[Any], symbols: Sequence[Any], shared: Sequence[int]
    ) -> None:
        """Note the names of derivatives of a value, divided by how many entries share them."""
        for symbol, s, n in zip(symbols, by, shared, strict=True):
            if n == 1:
                self.define(symbol, Slope(value, s))
            else:
                (dummy,) = placeholders(1, real=True)
                sum_symbol = self.define(dummy, Slope(value, s))
                self.define(symbol, sum_symbol / n)
