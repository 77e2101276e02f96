"""Loops over the shape functions of an interpolated field: its values, and outputs along it."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen import abi
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.emit.printer import Printer, dofs_expression
from softehl.codegen.language.definition import Definition


def gather(p: Printer, depth: int, value: str, array: str, before: int = 0) -> None:
    """Values and xi-derivatives of the interpolated fields at the point.

    before: entries of the array that stand before those of the dofs.
    """
    names = [f"{value}{k}" for k in range(p.d.components)]
    unknowns = p.output.format(array)
    p.line(depth, f"{p.kind} {', '.join(f'{name} = {p.zero}' for name in names)};")
    p.line(depth, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    for name, shape in zip(names, _shapes(p.d, "i"), strict=True):
        p.line(depth + 1, f"{name} += {shape} * {unknowns}[{before + len(p.d.unknowns)} + i];")
    p.line(depth, "}")
    p.line(depth, f"{', '.join(f'(void){name}' for name in names)};")


def _shapes(d: Definition, mode: str) -> list[str]:
    """Places of the components of a shape function in the basis of a point."""
    offsets = ["", *(f" + {k}" for k in range(1, d.components))]
    return [f"B[{d.components} * {mode}{offset}]" for offset in offsets]


def _letters(d: Definition) -> list[str]:
    """Names of the components of one shape function: N, D of the first field, N1, D1, ..."""
    return [f"{letter}{k or ''}" for k in range(d.components // 2) for letter in "ND"]


def scatter(p: Printer, depth: int, task: str, entries: Sequence[Entry]) -> None:
    """Outputs of the point spread over the shape functions."""
    direct = len(p.d.unknowns)
    at = {(x.row, x.column): p.value(x.node) for x in entries}
    p.line(depth, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    letters = _letters(p.d)
    values = zip(letters, _shapes(p.d, "i"), strict=True)
    p.line(depth + 1, f"const double {', '.join(f'{name} = {shape}' for name, shape in values)};")
    p.line(depth + 1, f"{', '.join(f'(void){name}' for name in letters)};")
    for column, target in _scatter_targets(p.d, task):
        left = _combination(letters, [at.get(k) for k in column])
        if left:
            p.line(depth + 1, f"{p.output.format(target[0])}{target[1:]} += {left};")
    size = range(p.d.components)
    blocks = [[at.get((Slot(True, r), Slot(True, c))) for r in size] for c in size]
    if any(value is not None for pair in blocks for value in pair):
        for c, pair in enumerate(blocks):
            right = _combination(letters, pair) or p.zero
            p.line(depth + 1, f"const {p.kind} r{c} = {right};")
        p.line(depth + 1, "for (ptrdiff_t j = 0; j < modes; ++j)")
        products = " + ".join(f"r{c} * {shape}" for c, shape in enumerate(_shapes(p.d, "j")))
        place = f"[({direct} + i) * {dofs_expression(p.d)} + {direct} + j]"
        p.line(depth + 2, f"{p.output.format('K')}{place} += {products};")
    p.line(depth, "}")


Key = tuple[Slot, Slot | None]


def _scatter_targets(d: Definition, task: str) -> list[tuple[list[Key], str]]:
    """Pairs (components of an output, its place for basis function i)."""
    direct, dofs = len(d.unknowns), dofs_expression(d)
    both = [Slot(True, k) for k in range(d.components)]
    out: list[tuple[list[Key], str]] = [([(s, None) for s in both], f"R[{direct} + i]")]
    if task == abi.Task.TANGENT:
        for k in range(direct):
            out.append(([(s, Slot(False, k)) for s in both], f"K[({direct} + i) * {dofs} + {k}]"))
            out.append(([(Slot(False, k), s) for s in both], f"K[{k} * {dofs} + {direct} + i]"))
    return out


def _combination(letters: Sequence[str], values: Sequence[str | None]) -> str:
    return " + ".join(f"{b} * {v}" for b, v in zip(letters, values, strict=True) if v is not None)
