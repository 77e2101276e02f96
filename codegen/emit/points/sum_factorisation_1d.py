"""A matrix along one direction of a cell, with half of its products by its symmetry."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softehl.codegen.emit.c_printer import number


@dataclass(frozen=True, eq=False)
class Table:
    """A matrix (rows, columns) that is the same, or its negative, when both are reversed.

    sign: 1 or -1.
    """

    values: NDArray[np.float64]
    sign: int

    def __post_init__(self) -> None:
        """Raises ValueError where it has no such symmetry."""
        mirrored = self.sign * self.values[::-1, ::-1]
        if not np.allclose(mirrored, self.values, rtol=0.0, atol=1e-12):
            raise ValueError("the matrix along a line is not symmetric to its middle")


def sweep(name: str, table: Table, kind: str) -> str:
    """A function of C that multiplies values along a line by the matrix.

    kind: "forth", or "back" by the transpose; back along slopes adds to what is there. Sums and
    differences of mirrored values are multiplied, each by half of the matrix.
    """
    matrix = table.values if kind == "forth" else table.values.T
    rows, columns = matrix.shape
    half = columns // 2
    lines: list[str] = []
    adds = "+=" if kind == "back" and table.sign < 0 else "="
    for k in range((rows + 1) // 2):
        row, mirror = matrix[k], rows - 1 - k
        even = [(row[i] + row[columns - 1 - i]) / 2 for i in range(half)]
        odd = [(row[i] - row[columns - 1 - i]) / 2 for i in range(half)]
        even += [row[half]] if columns % 2 else []
        if k == mirror and table.sign < 0:
            even = []
        if k == mirror and table.sign > 0:
            odd = []
        lines.append(f"    const V E{k} = {_sum('e', even)};")
        lines.append(f"    const V O{k} = {_sum('o', odd)};")
        lines.append(f"    b[{k} * step] {adds} E{k} + O{k};")
        if k != mirror:
            value = f"E{k} - O{k}" if table.sign > 0 else f"O{k} - E{k}"
            lines.append(f"    b[{mirror} * step] {adds} {value};")
    body = "\n".join([*_read(columns, lines), *lines])
    head = "const V *restrict a, V *restrict b, const int step"
    return f"static inline void {name}({head})\n{{\n{body}\n}}\n"


def _read(columns: int, lines: list[str]) -> list[str]:
    """Lines that read the values, and the sums and differences that `lines` need."""
    used = set(re.findall(r"\b[eo]\d+\b", "\n".join(lines)))
    loads = [f"    const V a{k} = a[{k} * step];" for k in range(columns)]
    for i in range(columns // 2):
        j = columns - 1 - i
        loads += [
            f"    const V {letter}{i} = a{i} {sign} a{j};"
            for letter, sign in (("e", "+"), ("o", "-"))
            if f"{letter}{i}" in used
        ]
    middle = columns // 2
    if columns % 2:
        read = f"const V e{middle} = a{middle};"
        loads.append(f"    {read if f'e{middle}' in used else f'(void)a{middle};'}")
    return loads


def _sum(letter: str, factors: list[float]) -> str:
    """Sum of products; zero if there are none."""
    terms = [f"{letter}{i} * {number(float(f))}" for i, f in enumerate(factors) if f]
    return " + ".join(terms) or "softehl_splat(0.0)"


def lagrange(
    nodes: list[float], at: list[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and derivatives (points, nodes) of Lagrange's polynomials."""
    values, derivatives = np.ones((len(at), len(nodes))), np.zeros((len(at), len(nodes)))
    for a, x in enumerate(nodes):
        others = [b for b in nodes if b != x]
        scale = float(np.prod([x - b for b in others]))
        for k, p in enumerate(at):
            values[k, a] = np.prod([p - b for b in others]) / scale
            derivatives[k, a] = (
                sum(np.prod([p - b for b in others if b != c]) for c in others) / scale
            )
    return values, derivatives
