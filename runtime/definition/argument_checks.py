"""Checks of arguments: numbers, functions, data of elements, nodes; errors name the argument."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import (
    Datum,
    Number,
    StudyError,
    Where,
    display_name,
)
from softehl.runtime.discretisation.loads import Amount
from softehl.runtime.io import require_writable
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.suggestions import did_you_mean, join_names, misfit


def finite(name: str, value: object) -> float:
    """A number.  Raises StudyError."""
    number: Any = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if isinstance(number, bool | np.bool_) or not isinstance(number, Real):
        raise StudyError(f"{name} = {value!r}: a real number is needed, or a function")
    if not np.isfinite(float(number)):
        raise StudyError(f"{name} = {value!r}: the number must be finite")
    return float(number)


def writable(context: str, path: Path) -> Path:
    """A file that can be written; its folder is made.  Raises StudyError."""
    try:
        require_writable(path)
    except OSError as error:
        raise StudyError(f"{context}: cannot write to {error.filename}: {error.strerror}") from None
    return path


def amount(context: str, name: str, value: Amount) -> Amount:
    """A prescribed value or load: a number, or a function of (x, t) whose values are checked.

    context: the call, for messages. Raises StudyError.
    """
    if not callable(value):
        return finite(name, value)
    return PointFunction(context, function(context, value, "x", "t"))


def parameter(block: str, name: str, value: Number) -> Number:
    """A number, or a function of t whose values are looked at.  Raises StudyError."""
    if np.size(value) > 1:  # type: ignore[arg-type]
        raise StudyError(
            f"{block!r}: {name} has {np.size(value)} values: a parameter is one number for all "  # type: ignore[arg-type]
            f"elements; declare what each has as data, m.data({name}=...)"
        )
    if not callable(value):
        return finite(f"{block!r}: {name}", value)
    return TimeFunction(f"{block!r}: {name}", function(f"{block!r}: {name}", value, "t"))


def datum(block: str, name: str, value: Datum, centres: Array) -> Array:
    """One number a place, (n,).  Raises StudyError."""
    context = f"{block!r}: {name}"
    values = function(context, value, "x")(centres) if callable(value) else value
    return np.broadcast_to(_real(context, values, centres), (len(centres),)).copy()


@dataclass(frozen=True, eq=False)
class PointFunction:
    """Function of coordinates (n, dim) and t, whose values are checked."""

    context: str
    function: Callable[[Array, float], Array | float]

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`.  Raises StudyError."""
        return type(self), (self.context, _pickled(self.context, self.function))

    def __deepcopy__(self, memo: object) -> PointFunction:
        """Itself."""
        return self

    def __call__(self, points: Array, t: float) -> Array:
        """One number, or (n,) of them.  Raises StudyError."""
        return _real(f"{self.context} at t = {t:g}", self.function(points, t), points)


@dataclass(frozen=True, eq=False)
class TimeFunction:
    """Function of t, whose values are checked."""

    context: str
    function: Callable[[float], float]

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`.  Raises StudyError."""
        return type(self), (self.context, _pickled(self.context, self.function))

    def __deepcopy__(self, memo: object) -> TimeFunction:
        """Itself."""
        return self

    def __call__(self, t: float) -> float:
        """Raises StudyError."""
        context = f"{self.context} at t = {t:g}"
        try:
            result = self.function(t)
        except TypeError as error:  # a function of places, say
            raise StudyError(
                f"{context}: {error}; a parameter is a number or a function of the load factor or "
                "time, one number that all elements of a block have"
            ) from error
        return float(_real(context, result, ()))


def _pickled(context: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that can be pickled.  Raises StudyError."""
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError):
        name = getattr(function, "__name__", repr(function))
        raise StudyError(
            f"{context}: {name} cannot be pickled: write it as a function of a module (def at the "
            "left margin of a file)"
        ) from None
    return function


def function(context: str, value: Callable[..., Any], *arguments: str) -> Callable[..., Any]:
    """A function, if it can be called with these.  Raises StudyError."""
    mismatch = misfit(value, *arguments)
    if mismatch:
        raise StudyError(f"{context}: {mismatch}")
    return value


def _real(context: str, value: object, points: Array | tuple[()]) -> Array:
    """One finite real number, or one for each place: () or (n,).  Raises StudyError."""
    if isinstance(value, np.ma.MaskedArray):
        raise StudyError(f"{context}: a masked array, whose mask says nothing here: fill it first")
    numbers = np.asarray(value)
    shapes = [(), (len(points),)] if isinstance(points, np.ndarray) else [()]
    many = f", or ({len(points)},) of them" if len(shapes) > 1 else ""
    if numbers.dtype.kind == "O":  # numbers of SymPy, say
        try:
            numbers = numbers.astype(np.float64)
        except (TypeError, ValueError):
            numbers = numbers.astype(str)
    if numbers.dtype.kind not in "fiu" or numbers.shape not in shapes:
        columns = ""
        shape = np.shape(points)
        if many and len(shape) == 2 and numbers.shape in (shape, shape[1:]):
            columns = f"; x has all places, {shape}, in columns: x[:, 0], ..."
        raise StudyError(
            f"{context}: one real number{many} is needed; given {numbers.dtype} of shape "
            f"{numbers.shape}{columns}"
        )
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        at = f" at {place_text(points[bad[0]])}" if numbers.ndim else ""
        raise StudyError(f"{context} is {np.ravel(numbers)[bad[0]]}{at}: numbers must be finite")
    return numbers.astype(np.float64)


def require_unknowns(
    context: str, values: Mapping[str, object] | tuple[str, ...], example: str
) -> None:
    """Raise StudyError where no unknown is named."""
    if not values:
        raise StudyError(f"{context}: name an unknown, as in {example}")


def require_names(what: str, requested: Iterable[str], allowed: Iterable[str], of: str) -> None:
    """Raise StudyError for a name that is not among the allowed ones."""
    names = list(dict.fromkeys(allowed))
    for name in requested:
        if name not in names:
            raise StudyError(
                f"{of} has no {what} {name!r}{did_you_mean(name, names)}; it has "
                f"{join_names(names)}"
            )


def nodes_of(mesh: Mesh, where: Where) -> Integers:
    """Node numbers that are meant.  Raises StudyError, MeshError."""
    if isinstance(where, str) or callable(where):
        return mesh.nodes(where)
    if isinstance(where, np.ma.MaskedArray):
        raise StudyError("node numbers are a masked array, whose mask says nothing here")
    numbers = np.asarray(where)
    if isinstance(where, tuple) or numbers.dtype.kind == "f":
        return mesh.nodes_at(numbers)
    if numbers.dtype.kind not in "iu" or numbers.ndim != 1 or not mesh.anywhere(numbers.size):
        raise StudyError(f"{display_name(where)}: node numbers are a list of integers")
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(mesh.points):
        raise StudyError(f"node numbers go from 0 to {len(mesh.points) - 1}")
    if len(np.unique(numbers)) < len(numbers):
        raise StudyError(f"{display_name(where)}: a node number stands twice")
    return numbers.astype(np.int64)


def partners(
    side_points: Array,
    partner_points: Array,
    tolerance: float,
    bodies: Callable[[], tuple[Integers, Integers]] | None = None,
) -> Integers:
    """For each of our places the number of the one of theirs that has the same place but for the
    shift between both centres. Nodes at one place have partners of their own body; bodies: numbers
    of the bodies of ours and theirs, (n,).  Raises StudyError where there is none.
    """
    from scipy.spatial import cKDTree  # late: slow to import

    a, b = side_points - side_points.mean(axis=0), partner_points - partner_points.mean(axis=0)
    distance, nearest = map(np.asarray, cKDTree(b).query(a))
    size = max(
        float(np.ptp(side_points, axis=0).max()), float(np.abs(side_points - partner_points).max())
    )
    worst, rounding = (
        float(distance.max()),
        8 * np.finfo(np.float64).eps * np.abs(side_points).max(),
    )
    limit = max(tolerance * size, float(rounding))
    if not worst <= limit:
        raise StudyError(
            f"tie: the nodes of both sides do not fit, they are {worst:.3g} apart at "
            f"{place_text(side_points[int(distance.argmax())])} (allowed: {limit:.3g}); sides "
            "of equal nodes but for a shift are tied, tolerance=... is relative to their size"
        )
    if len(np.unique(nearest)) == len(nearest):
        return np.asarray(nearest, dtype=np.int64)
    twice = side_points[np.bincount(nearest)[nearest] > 1][0]
    if bodies is not None:
        far = 2.0 * (size or 1.0)
        a, b = (np.column_stack([x, far * k]) for x, k in zip((a, b), bodies(), strict=True))
        distance, nearest = map(np.asarray, cKDTree(b).query(a))
        if distance.max() <= limit and len(np.unique(nearest)) == len(nearest):
            return np.asarray(nearest, dtype=np.int64)
    raise StudyError(
        f"tie: two nodes at {place_text(twice)} have the same partner: nodes at one place are tied "
        "body by body, one of each body, and here the bodies of both sides differ or one has two; "
        "tie the sides of each body in a call of its own"
    )


def node_partners(
    mesh: Mesh, side_nodes: Integers, partner_nodes: Integers, tolerance: float
) -> Integers:
    """For each of our nodes its partner among theirs, node numbers (n,).  Raises StudyError."""

    def bodies() -> tuple[Integers, Integers]:
        pairs = [np.stack([np.repeat(c[:, 0], c.shape[1]), c.ravel()]) for c in mesh.cells.values()]
        rows, columns = np.concatenate(pairs, axis=1)
        size = len(mesh.points)
        graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
        label = connected_components(graph, directed=False)[1].astype(np.int64)
        return label[side_nodes], label[partner_nodes]

    return partner_nodes[
        partners(mesh.points[side_nodes], mesh.points[partner_nodes], tolerance, bodies)
    ]
