"""Data of elements and of their quadrature points: numbers, arrays and functions of coordinates."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.argument_checks import datum
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.kernels.kernel import Kernel, Rule
from softehl.runtime.mesh.cells import CELLS, Cell
from softehl.runtime.mesh.mesh import Mesh

_SLACK = 1e-9  # of points and weights of a rule, which belong to the parent cell or do not
_PLACES = ("x", "X")
"""Names of the only argument of a function of coordinates in place of a parameter."""


def integrates_over(rule: Rule, cell: Cell) -> bool:
    """True if the points of a rule are those of the parent cell."""
    if not cell.dimension or rule.table.shape[1] != cell.dimension + 1:
        return False
    size = float(cell.rule(0)[1].sum())
    inside = all(cell.holds(x, _SLACK) for x in rule.table[:, :-1])
    return inside and abs(float(rule.weights.sum()) - size) < _SLACK * size


def is_distributed(value: object) -> bool:
    """True for an array, or a function of coordinates x, in place of one number."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return callable(value) and _is_of_places(value)


def _is_of_places(function: Callable[..., Any]) -> bool:
    """True for a function whose only argument is called x or X."""
    try:
        names = tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):  # one that is built in does not tell
        return False
    return len(names) == 1 and names[0] in _PLACES


def varying_parameters(
    mesh: Mesh, arguments: Mapping[str, Any], counts: set[int]
) -> dict[str, str]:
    """Arguments that differ from element to element: name -> "data" or "point data".

    counts: numbers of elements of the block on each kind of cell. Where an array may be one by
    element or by node, it becomes point data, whose values are refused then.
    """
    nodal = (len(mesh.points),)
    arrays = {}
    for name, value in arguments.items():
        if is_distributed(value):
            shape = np.shape(value) if isinstance(value, np.ndarray) else ()
            columns = bool(shape) and shape[1:] in ((), (1,)) and shape != nodal
            by_element = columns and shape[0] in counts
            arrays[name] = "data" if by_element else "point data"
    return arrays


@dataclass(frozen=True, eq=False)
class IntegrationPoints:
    """Quadrature points of the elements of a block.

    nodes: (n, k) of the cells or faces. shape: (q, k) shape functions at the points; None where
    the quadrature is not that of a cell. count: of the points of an element.
    """

    mesh: Mesh
    nodes: Integers
    shape: Array | None
    count: int
    centres: Array

    @classmethod
    def of(
        cls, mesh: Mesh, kernel: Kernel, kind: str, nodes: Integers, rule: Rule | None
    ) -> IntegrationPoints:
        """Points of a kernel on elements with nodes (n, k) on cells or faces of a kind."""
        used, cell = rule or kernel.default_rule, CELLS[kind]
        nowhere = np.full((len(nodes), mesh.dimension), np.nan)
        centres = mesh.points[nodes].mean(axis=1) if nodes.size else nowhere
        fits = nodes.shape[1] == len(cell.nodes) and integrates_over(used, cell)
        shape = cell.shape(used.table[:, :-1]) if fits else None
        return cls(mesh, nodes, shape, len(used.weights), centres)

    @property
    def coordinates(self) -> Array:
        """Reference coordinates (n, q, dim); the centre at all points where they are not known."""
        if self.shape is None:
            return np.repeat(self.centres[:, None], self.count, axis=1)
        return np.asarray(np.einsum("qk,nkd->nqd", self.shape, self.mesh.points[self.nodes]))

    def values(self, block: str, name: str, value: Any) -> Array:
        """Values (n, q): of a number, of arrays by element, node or point, or of a function.

        Raises StudyError.
        """
        n, q, context = len(self.nodes), self.count, f"{block!r}: {name}"
        if callable(value):
            points = self.coordinates if self.shape is not None else self.centres[:, None]
            flat = datum(block, name, value, points.reshape(-1, self.mesh.dimension))
            return np.array(np.broadcast_to(flat.reshape(n, -1), (n, q)))
        if isinstance(value, np.ma.MaskedArray):
            raise StudyError(
                f"{context}: a masked array, whose mask says nothing here: fill it first"
            )
        numbers = np.asarray(value)
        shape = numbers.shape
        nodal = {(len(self.mesh.points),)} if self.shape is not None else set()
        if numbers.dtype.kind not in "fiu" or shape not in {(), (n,), (n, 1), (n, q), *nodal}:
            raise StudyError(
                f"{context}: given {numbers.dtype} of shape {shape}; allowed are a number, "
                f"({n},) or ({n}, 1) by element, ({n}, {q}) by integration point, "
                + (f"({len(self.mesh.points)},) by node, " if nodal else "")
                + "or a function of coordinates (m, dim)"
            )
        if shape == (n,) == (len(self.mesh.points),) and self.shape is not None and n > 1:
            raise StudyError(
                f"{context}: shape ({n},) is one by element or one by node, there are {n} of both: "
                f"give ({n}, 1) by element, or ({n}, {q}) by integration point"
            )
        numbers = numbers.astype(np.float64)
        bad = np.argwhere(~np.isfinite(numbers))
        if len(bad):
            raise StudyError(
                f"{context} is {numbers[tuple(bad[0])]} at {tuple(map(int, bad[0]))}: numbers must "
                "be finite"
            )
        if shape == (n,):
            numbers = numbers[:, None]
        elif numbers.ndim == 1:
            assert self.shape is not None
            numbers = numbers[self.nodes] @ self.shape.T
        return np.array(np.broadcast_to(numbers, (n, q)))


def by_element(value: Any, count: int) -> Any:
    """An array (n, 1) as (n,), and other values themselves."""
    if isinstance(value, np.ndarray) and value.shape == (count, 1):
        return value[:, 0]
    return value
