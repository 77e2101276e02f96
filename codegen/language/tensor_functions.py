"""Functions of tensors on a page: `m.log(C)`, `m.sqrt`, `m.power`, `m.exp`, `m.isotropic`, ..."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from softehl.codegen.graph.evaluation import alike
from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.graph.routines import Isotropic as IsotropicEnergy
from softehl.codegen.graph.routines import depends, localise
from softehl.codegen.graph.tensor_functions import (
    Eigenvalues,
    Exponential,
    FunctionPart,
    IsotropicFunction,
    TensorFunction,
    TensorRoutine,
    entry_pairs,
)
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import Entries, Matrix, call_function
from softehl.codegen.language.named_symbols import placeholders
from softehl.codegen.language.sympy_lowering import Symbols
from softehl.codegen.language.sympy_tape import MatrixFunction


class TensorFunctions:
    """Tensor functions of one model, with numbers for their names."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self._counts: dict[str, int] = {}

    def isotropic(self, what: str, C: Any, f: Callable[[Any], Any]) -> Any:
        """Names of the sum of f(c_a) n_a n_a over eigenvalues and vectors of a symmetric matrix."""
        symbols = self._symbols
        if not callable(f):
            raise ModelError(
                f"m.{what}: {f} is no function; write `lambda x: ...` of an eigenvalue"
            )
        size, entries = symmetric_entries(symbols, f"m.{what}", C)
        label = self._label(what)
        local = Entries(placeholders(1, real=True), ("",), list)
        inputs = symbols.placeholders(label, local)
        written = call_function(f"m.{what}", f, local.values[0])
        value = symbols.lower(written)
        inner = [n.payload for n in depends([value], inputs)]
        if any(isinstance(r, (IsotropicEnergy, TensorRoutine)) for r in inner):
            raise ModelError(
                f"m.{what}: its function of an eigenvalue holds a function of another tensor that "
                "depends on it; write it outside"
            )
        system = localise(symbols.graph, [value], inputs)
        function = IsotropicFunction(
            label, f"m.{what}", size, len(system.external), f=system.values[0]
        )
        try:
            function.differences(symbols.graph)
        except DifferentiationError as failed:
            raise ModelError(f"m.{what}: {failed}") from None
        record = MatrixFunction("isotropic", tuple(C), (local.values[0], written))
        below = [*C, written]
        return self._symmetric(label, function, [*entries, *system.external], below, record)

    def exponential(self, A: Any) -> Any:
        """Names of the exponential of a matrix, symmetric or not."""
        symbols, shape = self._symbols, getattr(A, "shape", None)
        if shape not in ((2, 2), (3, 3)):
            raise ModelError(f"m.exp: {_wrong_shape(A, '(2, 2) or (3, 3)')}")
        size = shape[0]
        nodes = [symbols.lower(a) for a in A]
        if all(alike(nodes[size * i + j], nodes[size * j + i]) for i, j in entry_pairs(size)):
            return self.isotropic("exp", A, sp.exp)
        label = self._label("exp")
        function = Exponential(label, "m.exp", size)
        results = function.run(symbols.graph, FunctionPart.VALUE, nodes)
        names = symbols.named(label, Entries.of(A), results, list(A))
        record = MatrixFunction("exponential", tuple(A))
        symbols.record.matrix_function(record, list(names))
        return names

    def eigenvalues(self, C: Any) -> tuple[Any, ...]:
        """Names of the eigenvalues of a symmetric matrix, the largest first."""
        symbols = self._symbols
        size, entries = symmetric_entries(symbols, "m.eigenvalues", C)
        label = self._label("eigenvalue")
        function = Eigenvalues(label, "m.eigenvalues", size)
        like = Entries.of([0] * size)
        results = function.run(symbols.graph, FunctionPart.VALUE, entries)
        names = symbols.named(label, like, results, list(C))
        symbols.record.matrix_function(MatrixFunction("eigenvalues", tuple(C)), names)
        return tuple(names)

    def _label(self, what: str) -> str:
        self._counts[what] = self._counts.get(what, 0) + 1
        return f"{what}_{self._counts[what]}"

    def _symmetric(
        self,
        label: str,
        function: TensorFunction,
        args: list[Node],
        below: list[Any],
        record: MatrixFunction,
    ) -> Any:
        symbols, size = self._symbols, function.size
        pairs = entry_pairs(size)
        like = Entries([0] * len(pairs), [f"_{i}{j}" for i, j in pairs], list)
        results = function.run(symbols.graph, FunctionPart.VALUE, args)
        names = symbols.named(label, like, results, below)
        made = Matrix(size, size, lambda i, j: names[pairs.index((min(i, j), max(i, j)))])
        symbols.record.matrix_function(record, list(made))
        return made


def symmetric_entries(
    symbols: Symbols, name: str, C: Any, sizes: tuple[int, ...] = (2, 3)
) -> tuple[int, list[Node]]:
    """Rows, and entries of the symmetric part of C, which has those of C: both triangles vary
    alike.
    """
    if getattr(C, "shape", None) not in [(n, n) for n in sizes]:
        allowed = " or ".join(f"({n}, {n})" for n in sizes)
        raise ModelError(f"{name}: {_wrong_shape(C, allowed)}")
    size, entries = C.shape[0], []
    for i, j in entry_pairs(size):
        upper, lower = symbols.lower(C[i, j]), symbols.lower(C[j, i])
        if not alike(upper, lower):
            raise ModelError(
                f"{name}: C is not symmetric, C[{i}, {j}] is not C[{j}, {i}]; e.g. C = F.T * F"
            )
        same = upper is lower
        entries.append(upper if same else symbols.lower((C[i, j] + C[j, i]) / 2))
    return size, entries


def _wrong_shape(C: Any, allowed: str) -> str:
    shape = getattr(C, "shape", None)
    if shape is not None:
        return f"C has shape {shape}, must be {allowed}"
    if isinstance(C, (list, tuple)):
        return f"C is a list, must be a matrix {allowed}: write sp.Matrix({C})"
    return f"{C} is a scalar, must be a matrix {allowed}; sp.log, sp.exp, ... are those of scalars"
