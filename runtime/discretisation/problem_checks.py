"""Checks of a problem that name the fault: parameters, prescribed values, elements, unknowns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.run_time_arrays import is_packed, unpacked
from softehl.runtime.kernels.tables import points_of, with_ends
from softehl.runtime.mesh.cells import CELLS, Cell, jacobians
from softehl.runtime.suggestions import did_you_mean, join_names

if TYPE_CHECKING:
    from softehl.runtime.discretisation.element_blocks import ElementBlock

_CELLS = {(cell.dimension, len(cell.nodes)): cell for cell in CELLS.values()}


class ProblemError(SoftehlError, ValueError):
    """Error: a problem cannot be posed; the message gives the value and the allowed ones."""


def require_known(what: str, names: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise ProblemError for a name that is not allowed."""
    allowed = list(allowed)
    for name in names:
        if name not in allowed:
            raise ProblemError(
                f"no {what} {name!r}{did_you_mean(name, allowed)}; there are {join_names(allowed)}"
            )


def in_order(block: ElementBlock, parameters: Any) -> Array:
    """Parameters of a block, an array or a mapping by name, in the order of its kernel."""
    names = block.kernel.parameters
    arrays = getattr(block.kernel, "arrays", ())
    if arrays:
        return _with_arrays(block, parameters)
    if isinstance(parameters, Mapping):
        require_known(f"parameter of block {block.name!r}", parameters, names)
        missing = [name for name in names if name not in parameters]
        if missing:
            raise ProblemError(f"block {block.name!r} needs {', '.join(missing)} too")
        parameters = [parameters[name] for name in names]
    values = np.asarray(parameters)
    if values.dtype.kind not in "fiu" or values.shape != (len(names),):
        raise ProblemError(
            f"block {block.name!r}: parameters {parameters!r}, must be {len(names)} numbers "
            f"({join_names(names)})"
        )
    values = values.astype(np.float64, copy=False)
    if not np.isfinite(values).all():
        k = int(np.flatnonzero(~np.isfinite(values))[0])
        raise ProblemError(f"block {block.name!r}: {names[k]} = {values[k]}, must be finite")
    return values


def _with_arrays(block: ElementBlock, parameters: Any) -> Array:
    """Parameters of a block that has curves or networks, with these behind them."""
    kernel: Any = block.kernel  # or one around it, which has the same arguments
    names = [*kernel.parameters, *(a.name for a in kernel.arrays)]
    if isinstance(parameters, Mapping):
        require_known(f"parameter of block {block.name!r}", parameters, names)
        missing = [name for name in names if name not in parameters]
        if missing:
            raise ProblemError(f"block {block.name!r} needs {', '.join(missing)} too")
        numbers = [parameters[name] for name in kernel.parameters]
        return np.asarray(kernel.with_arrays(numbers, parameters))
    values = np.asarray(parameters, dtype=np.float64)
    if not is_packed(values, len(kernel.parameters), len(kernel.arrays)):
        raise ProblemError(
            f"block {block.name!r} has curves or networks: give its parameters by name "
            f"({join_names(names)})"
        )
    return values


def require_sound_elements(block: ElementBlock) -> None:
    """Raise ProblemError for an element that is inside out or flat, or has numbers not finite.

    Elements are looked at whose kernel integrates over their volume (in the plane: their area).
    """
    n = len(block.dofs)
    if np.size(block.coordinates) and len(block.coordinates) != n:
        raise ProblemError(
            f"block {block.name!r} has coordinates of {len(block.coordinates)} elements and dofs "
            f"of {n}"
        )
    for what, numbers in (("coordinates", block.coordinates), ("data", block.data)):
        invalid = ~np.isfinite(np.asarray(0.0 if numbers is None else numbers, dtype=np.float64))
        if invalid.any():
            row = int(np.nonzero(invalid)[0][0])
            raise ProblemError(f"{element_name(block, row)}: its {what} are not finite")
    cell = _cell(block)
    if cell is None or not block.check_orientation:
        return
    points = np.asarray(block.coordinates, dtype=np.float64)
    points = points.reshape(len(points), len(cell.nodes), cell.dimension)
    smallest = jacobians(cell, points, cell.rule(2 * cell.order)[0]).min(axis=1)
    invalid = smallest <= 0.0
    if invalid.any():
        row = int(smallest.argmin())
        raise ProblemError(
            f"{element_name(block, row)} is inside out or flat (det J = {smallest[row]:.3g}), as "
            f"are {int(invalid.sum())} of {len(invalid)}: number its nodes in the order of VTK, in "
            "the plane counterclockwise (check_orientation=False for a page with another order)"
        )


def _cell(block: ElementBlock) -> Cell | None:
    """The kind of cell whose volume a kernel integrates over; None if it is no such kernel."""
    kernel = block.kernel
    if not isinstance(kernel, Kernel):
        return None
    points = kernel.default_rule.points
    dimension = points.reshape(len(kernel.default_rule.weights), -1).shape[1]
    if dimension == 0 or dimension != len(kernel.coordinates):
        return None
    return _CELLS.get((dimension, kernel.nodes))


def element_name(block: ElementBlock, row: int) -> str:
    """An element for a message: its number, its block, and where it is if that is known."""
    points = _element_points(block, row)
    where = "" if points is None else f" at {_point_text(points.mean(axis=0))}"
    return f"element {row} of block {block.name!r}{where}"


def unknown_name(blocks: Iterable[ElementBlock], number: int) -> str:
    """Name of an unknown by an element of the blocks; empty if none has it."""
    for block in blocks:
        rows, columns = np.nonzero(block.dofs == number)
        if not len(rows):
            continue
        row, column = int(rows[0]), int(columns[0])
        names = getattr(block.kernel, "unknowns", ())
        name = f"{names[column]} of " if column < len(names) else ""
        return f" ({name}{element_name(block, row)})"
    return ""


def _element_points(block: ElementBlock, row: int) -> Array | None:
    dimension = len(getattr(block.kernel, "coordinates", ()))
    if not dimension:
        return None
    points: Array = np.asarray(block.coordinates[row], dtype=np.float64).reshape(-1, dimension)
    return points


def _point_text(point: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ")"


def not_finite(block: ElementBlock, results: Sequence[Array]) -> str:
    """The first element of a block with a result, (n, ...), that is not finite; empty if none."""
    invalid = rows_not_finite(results)
    if not len(invalid):
        return ""
    more = f" and {len(invalid) - 1} more" if len(invalid) > 1 else ""
    return element_name(block, int(invalid[0])) + more


def fault_message(
    block: ElementBlock, x: Array, parameters: Array, row: int, messages: dict[str, str]
) -> str:
    """The operation of a page without a value in an element; empty where it is not known.

    A path cuts its steps where a residual is not finite, and asks each time: of a page whose
    evaluation takes longer than `_PATIENCE`, `known` keeps the first answer.
    """
    if isinstance(block.kernel, ModelKernel):
        arguments = block.given(parameters)
        return f": {block.kernel.fault(block.coordinates, x[block.dofs], row, **arguments)}"
    if block.name in messages:
        return messages[block.name]
    begin = perf_counter()
    try:
        fault = block.explain(x, parameters, row).fault
    except (SoftehlError, ImportError):
        return ""  # no page, or no SymPy
    message = f": {fault}" if fault else ""
    if perf_counter() - begin > _PATIENCE:
        messages[block.name] = message and f"{message}, at the first of several attempts"
    return message


_PATIENCE = 0.3
"""Seconds; ten cuts of a step then take three."""


def table_ends(block: ElementBlock, x: Array, parameters: Array) -> str:
    """Curves that end where an element needs a value of them, in words; empty if there are none.

    They are those whose continuation makes more elements finite.
    """
    kernel: Any = block.kernel
    names = [a.name for a in getattr(kernel, "arrays", ()) if a.kind == "table"]
    if not names:
        return ""
    invalid_rows = len(rows_not_finite(block.tangent(x, parameters)))
    continued = parameters.copy()
    arrays = unpacked(continued, len(kernel.parameters), len(kernel.arrays))
    reasons = []
    for array, values in zip(kernel.arrays, arrays, strict=True):
        if array.kind == "table" and np.isnan(values).any():
            knots, saved = points_of(values), values.copy()
            values[:] = with_ends(values)
            after = len(rows_not_finite(block.tangent(x, continued)))
            if after < invalid_rows:
                bounds = f"{knots[0]:g} to {knots[-1]:g}"
                reasons.append(f"the curve {array.name!r} ends there: its points go from {bounds}")
                invalid_rows = after
            else:
                values[:] = saved
    return "".join(f"; {text}" for text in reasons)


def rows_not_finite(results: Sequence[Array]) -> Integers:
    """Numbers of the elements that have a result, (n, ...), that is not finite."""
    invalid: Flags = np.zeros(len(results[0]), dtype=bool)
    for result in results:
        invalid |= ~np.isfinite(result).all(axis=tuple(range(1, result.ndim)))
    return np.flatnonzero(invalid)
