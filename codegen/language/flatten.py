"""Scalars, lists and matrices of expressions as flat lists, and back."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from softehl.codegen.language.errors import ModelError


class Matrix(sp.MutableDenseMatrix):  # type: ignore[misc]
    """Matrix of a model: its inverse is written out up to 3x3.

    SymPy eliminates, and looks for proof that a pivot is not zero: minutes for names of sums.
    """

    _class_priority = 5  # sums and products with SymPy's matrices are of this class

    def inv(self, method: str | None = None, **settings: Any) -> Any:
        """Inverse; of more than three rows, or by a `method`, as SymPy has it."""
        if method is not None or self.rows != self.cols or self.rows > 3:
            return super().inv(method, **settings)
        det = self.det()
        if det is sp.S.Zero:
            raise ModelError(f"inv: the determinant of a matrix {self.shape} is zero")
        return self.adjugate() / det


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
            return Entries(list(value), suffixes, lambda v: Matrix(rows, columns, list(v)))
        if isinstance(value, (list, tuple)):
            return Entries(list(value), [f"_{k}" for k in range(len(value))], list)
        return Entries([value], [""], lambda v: v[0])

    def map(self, function: Callable[[Any], Any]) -> Entries:
        """Entries with other values in the same arrangement."""
        return Entries([function(v) for v in self.values], self.suffixes, self.arrange)

    def shaped(self) -> Any:
        """The scalar, list or matrix."""
        return self.arrange(self.values)


class CheckedList(list[Any]):
    """List of a model; an index that is too large is an error with the length of the list."""

    def __init__(self, values: Iterable[Any] = (), what: str = "the list") -> None:
        super().__init__(values)
        self.what = what

    def __getitem__(self, k: Any) -> Any:
        try:
            return super().__getitem__(k)
        except IndexError:
            raise ModelError(
                f"[{k}] of {self.what}: there are {len(self)}, counted from 0"
            ) from None


def call_function(name: str, function: Callable[..., Any], *arguments: Any, write: str = "") -> Any:
    """Call a function of a model; a wrong number of arguments is an error that states it.

    write: what to write instead; a lambda where it is left out.
    """
    try:
        inspect.signature(function).bind(*arguments)
    except ValueError:
        pass  # what is written in C has no signature
    except TypeError:
        count = len(arguments)
        raise ModelError(
            f"{name}: its function gets {count} argument{'s' * (count != 1)}, and cannot take "
            f"{'them' if count != 1 else 'it'}; write "
            + (write or f"`lambda {', '.join('abc'[:count])}: ...`")
        ) from None
    return function(*arguments)


def fraction(value: Any, *, zero: bool = False) -> Fraction:
    """An exact number > 0 of a model (a setting, so that a float does as well), or `zero`."""
    number = sp.nsimplify(value, rational=True)
    if not number.is_Rational or number < 0 or (number == 0 and not zero):
        raise ModelError(f"{value} must be a number {'>=' if zero else '>'} 0")
    return Fraction(int(number.p), int(number.q))
