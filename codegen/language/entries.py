"""Scalars, lists and matrices of expressions as flat lists, and back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from softehl.codegen.language.lower import ModelError


@dataclass(frozen=True)
class Entries:
    """Entries of a value, what each adds to its name, and the function that puts them back."""

    values: Sequence[Any]
    suffixes: Sequence[str]
    arrange: Callable[[Sequence[Any]], Any]

    @staticmethod
    def of(value: Any) -> Entries:
        """Entries of a matrix (row by row), of a list, or of a scalar."""
        if isinstance(value, sp.MatrixBase):
            rows, columns = value.shape
            suffixes = [f"_{i}{j}" for i in range(rows) for j in range(columns)]
            return Entries(list(value), suffixes, lambda v: sp.Matrix(rows, columns, list(v)))
        if isinstance(value, (list, tuple)):
            return Entries(list(value), [f"_{k}" for k in range(len(value))], list)
        return Entries([value], [""], lambda v: v[0])

    def map(self, function: Callable[[Any], Any]) -> Entries:
        """The same arrangement of other values."""
        return Entries([function(v) for v in self.values], self.suffixes, self.arrange)

    def shaped(self) -> Any:
        """The scalar, list or matrix."""
        return self.arrange(self.values)


def fraction(value: Any, *, zero: bool = False) -> Fraction:
    """An exact number > 0 of a model page (a setting, so that a float does as well), or `zero`."""
    number = sp.nsimplify(value, rational=True)
    if not number.is_Rational or number < 0 or (number == 0 and not zero):
        raise ModelError(f"{value} must be a number {'>=' if zero else '>'} 0")
    return Fraction(int(number.p), int(number.q))
