"""Explanation of an element at a state: named values of its page, and what has no value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array, read_only
from softehl.runtime.kernels import page_evaluator
from softehl.runtime.suggestions import did_you_mean

_SHOWN = 4
"""Points whose values are printed."""


@dataclass(frozen=True)
class Explanation:
    """Named values of a page at the points of one element.

    Attributes
    ----------
    kernel : str
        Name of the kernel.
    values : mapping of str to array (points,) or (1,)
        Argument, named value, field or probe -> its values at the quadrature points, one if it is
        the same at all points; nan where it has none.
    lines : mapping of str to str
        Named value -> file and line of the page.
    fault : str
        The first operation without a finite value, with the values of its operands and the line of
        the page; empty if every operation has one.
    """

    kernel: str
    values: Mapping[str, Array] = field(repr=False)
    lines: Mapping[str, str] = field(repr=False)
    fault: str = ""

    def __getitem__(self, name: str) -> Array:
        """Values of a name; UnknownNameError, a KeyError, if there is none."""
        if name not in self.values:
            raise UnknownNameError(
                f"{self.kernel} has no value {name!r}{did_you_mean(name, self.values)}"
            )
        return self.values[name]

    def __str__(self) -> str:
        """Table of the values without those of the geometry, and the fault."""
        rows = [
            (name, _numbers(v), self.lines.get(name, ""))
            for name, v in self.values.items()
            if not name.startswith(("parent_", "shape_"))
        ]
        widths = [max((len(row[k]) for row in rows), default=0) for k in (0, 1)]
        table = [f"{n:<{widths[0]}}  {v:<{widths[1]}}  {line}".rstrip() for n, v, line in rows]
        return "\n".join([f"{self.kernel}:", *table, self.fault or "every operation has a value"])


def _numbers(values: Array) -> str:
    text = "  ".join(f"{v:13.6g}" for v in values[:_SHOWN])
    return text + (f"  ... ({len(values)})" if len(values) > _SHOWN else "")


@dataclass(frozen=True, eq=False)
class ElementState:
    """Arguments of one element: arrays in the kernel's order, points with their weights.

    arrays: of any length, such as curves. term_history: of each point the numbers of each term.
    """

    coordinates: Array
    dofs: Array
    data: Array
    parameters: Array
    point_data: Array
    rule: Array
    basis: Array
    arrays: tuple[Array, ...] = ()
    term_history: tuple[tuple[Array, ...], ...] = ()


def explanation(folder: Path, kernel: str, state: ElementState) -> Explanation:
    """Explanation of a kernel of a folder; raises KernelError where its page is not known."""
    rows, fault = page_evaluator.evaluate_page(folder, kernel, state)
    values = {name: read_only(np.array(numbers)) for name, numbers, _ in rows}
    lines = {name: line for name, _, line in rows if line}
    return Explanation(kernel, values, lines, fault)
