"""C functions of the user on a page: their source, and the names of their results."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sympy as sp

from softehl.codegen.external_function import HIGHEST, ExternalFunction
from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.routines import external
from softehl.codegen.language.errors import ModelError, page_line
from softehl.codegen.language.flatten import CheckedList, Entries, Matrix
from softehl.codegen.language.sympy_lowering import Symbols
from softehl.function_address import FunctionAddress, FunctionAddressError, address_of

_NAME = re.compile(r"[A-Za-z_]\w*")
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"\n]+)"[^\n]*$', flags=re.MULTILINE)


@dataclass(frozen=True)
class Prototype:
    """Facts of a page about a C function: its name in C, its orders and its source."""

    function: str
    outputs: Any
    derivatives: int | None
    source: Any
    address: FunctionAddress | None = None

    @property
    def has_text(self) -> bool:
        """True where the function is known by its C."""
        return self.source is not None and self.address is None

    def record(self, name: str, inputs: int) -> ExternalFunction:
        """The function, checked.  Raises ModelError."""
        if not _NAME.fullmatch(self.function):
            raise ModelError(f"{name}: {self.function!r} is no name of a C function")
        if not inputs:
            raise ModelError(
                f"{name}: give the inputs as a list, m.external({name!r}, [e, d], ...)"
            )
        text, file = "", self.function
        at = int(self.address or 0)
        if self.has_text:
            text, file = _source(name, self.source)
            if not re.search(rf"\b{self.function}\s*\(", text):
                raise ModelError(
                    f"{name}: {file} has no function {self.function}; its name in C is given by "
                    f"function=..."
                )
        f = ExternalFunction(self.function, inputs, _count(name, self.outputs), 0, text, file, at)
        order = self.derivatives
        if order is None:
            order = 0 if f.is_complex else 1
        if isinstance(order, bool) or order not in range(HIGHEST + 1):
            raise ModelError(
                f"{name}: derivatives = {order!r}, must be 0, 1 or 2: the orders that "
                f"{self.function} returns"
            )
        return ExternalFunction(f.name, inputs, f.outputs, order, text, file, at)


def _count(name: str, outputs: Any) -> int:
    shape = outputs if isinstance(outputs, tuple) else (outputs,)
    are_sizes = all(isinstance(n, int) and not isinstance(n, bool) and n > 0 for n in shape)
    if not are_sizes or len(shape) not in (1, 2):
        raise ModelError(
            f"{name}: outputs = {outputs!r}, must be a number of values, or (rows, columns) of a "
            "matrix"
        )
    return shape[0] * shape[-1] if len(shape) == 2 else int(shape[0])


def given_address(name: str, source: Any) -> FunctionAddress | None:
    """Address of a function that a page knows itself.  Raises ModelError."""
    if source is None or isinstance(source, (str, Path)):
        return None
    try:
        return address_of(name, source)
    except FunctionAddressError:
        raise ModelError(
            f"{name}: source = {source!r}: give a C file, its text, or a function of ctypes, cffi "
            "or Numba"
        ) from None


def _source(name: str, source: Any) -> tuple[str, str]:
    """Text of a C file, or the text itself, with the files beside it that it includes."""
    if isinstance(source, str) and ("\n" in source or "{" in source):
        return source, f"the source of {name}"
    file = page_line().rpartition(":")[0]
    folder = Path(file).parent if file else Path()
    path = next((p for p in (folder / source, Path(source)) if p.is_file()), None)
    if path is None:
        raise ModelError(f"{name}: there is no file {source} beside the page, in {folder}")
    return _included(path, set()), path.name


def _included(path: Path, seen: set[Path]) -> str:
    """A C file with the files of its folder in place of their #include, each once."""
    seen.add(path.resolve())
    text = path.read_text(encoding="utf-8")

    def replaced(match: re.Match[str]) -> str:
        inner = path.parent / match[1]
        if not inner.is_file():
            return match[0]
        return "" if inner.resolve() in seen else _included(inner, seen)

    return _INCLUDE.sub(replaced, text)


def external_values(
    symbols: Symbols,
    name: str,
    inputs: Any,
    prototype: Prototype,
    address: Sequence[Node] = (),
) -> Any:
    """Names of the results of a C function: a scalar, a list or a matrix of them."""
    expressions = _flat(inputs)
    f = prototype.record(name, len(expressions))
    routine = external(f"external_{name}", f, where=page_line())
    args = [*address, *map(symbols.lower, expressions)]
    label = name if f.text else f"{name}_value"
    nodes, like = symbols.graph.run(routine, args), _arranged(prototype.outputs)
    result = symbols.named(label, like, nodes, expressions)
    symbols.record.external(f, expressions, Entries.of(result).values)
    return result


def _flat(inputs: Any) -> list[Any]:
    """Entries of a scalar, list or matrix, and of lists of these."""
    if isinstance(inputs, (list, tuple)):
        return [e for value in inputs for e in _flat(value)]
    return [sp.sympify(e) for e in Entries.of(inputs).values]


def _arranged(outputs: Any) -> Entries:
    if isinstance(outputs, tuple) and len(outputs) == 2:
        return Entries.of(Matrix(*outputs, [0] * (outputs[0] * outputs[1])))
    count = outputs[0] if isinstance(outputs, tuple) else outputs
    if count == 1 and not isinstance(outputs, tuple):
        return Entries.of(0)
    suffixes = [f"_{k}" for k in range(count)]
    return Entries([0] * count, suffixes, lambda v: CheckedList(v, "the results"))
