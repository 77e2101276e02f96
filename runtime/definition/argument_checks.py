"""Reading what a script gives: numbers, functions, data of elements, nodes; errors name it."""

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
from scipy.spatial import cKDTree

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import Datum, Number, StudyError, Where, shown
from softehl.runtime.discretisation.loads import Amount
from softehl.runtime.io import require_writable
from softehl.runtime.mesh.mesh import Mesh, place_text
from softehl.runtime.suggestions import listed, meant, misfit


def finite(name: str, value: object) -> float:
    """A number.  Raises StudyError."""
    found: Any = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if isinstance(found, bool | np.bool_) or not isinstance(found, Real):
        raise StudyError(f"{name} = {value!r}: a real number is needed, or a function")
    if not np.isfinite(float(found)):
        raise StudyError(f"{name} = {value!r}: the number must be finite")
    return float(found)


def writable(words: str, path: Path) -> Path:
    """A file that can be written; its folder is made.  Raises StudyError."""
    try:
        require_writable(path)
    except OSError as error:
        raise StudyError(f"{words}: cannot write to {error.filename}: {error.strerror}") from None
    return path


def amount(words: str, name: str, value: Amount) -> Amount:
    """A prescribed value or load: a number, or a function of (x, t) whose values are checked.

    words: the call, for messages. Raises StudyError.
    """
    if not callable(value):
        return finite(name, value)
    return Told(words, function(words, value, "x", "t"))


def parameter(block: str, name: str, value: Number) -> Number:
    """A number, or a function of t whose values are looked at.  Raises StudyError."""
    if np.size(value) > 1:  # type: ignore[arg-type]
        raise StudyError(
            f"{block!r}: {name} has {np.size(value)} values: a parameter is one number for all "  # type: ignore[arg-type]
            f"elements; declare what each has as data, m.data({name}=...)"
        )
    if not callable(value):
        return finite(f"{block!r}: {name}", value)
    return Rising(f"{block!r}: {name}", function(f"{block!r}: {name}", value, "t"))


def datum(block: str, name: str, value: Datum, centres: Array) -> Array:
    """One number a place, (n,).  Raises StudyError."""
    words = f"{block!r}: {name}"
    found = function(words, value, "x")(centres) if callable(value) else value
    return np.broadcast_to(_real(words, found, centres), (len(centres),)).copy()


@dataclass(frozen=True, eq=False)
class Told:
    """A function of places (n, dim) and t as it was given, whose values are looked at."""

    words: str
    function: Callable[[Array, float], Array | float]

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`.  Raises StudyError."""
        return type(self), (self.words, _pickled(self.words, self.function))

    def __deepcopy__(self, memo: object) -> Told:
        """Itself."""
        return self

    def __call__(self, places: Array, t: float) -> Array:
        """One number, or (n,) of them.  Raises StudyError."""
        return _real(f"{self.words} at t = {t:g}", self.function(places, t), places)


@dataclass(frozen=True, eq=False)
class Rising:
    """A function of t as it was given, whose values are looked at."""

    words: str
    function: Callable[[float], float]

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`.  Raises StudyError."""
        return type(self), (self.words, _pickled(self.words, self.function))

    def __deepcopy__(self, memo: object) -> Rising:
        """Itself."""
        return self

    def __call__(self, t: float) -> float:
        """Raises StudyError."""
        words = f"{self.words} at t = {t:g}"
        try:
            found = self.function(t)
        except TypeError as error:  # a function of places, say
            raise StudyError(
                f"{words}: {error}; a parameter is a number or a function of the load factor or "
                "time, one number that all elements of a block have"
            ) from error
        return float(_real(words, found, ()))


def _pickled(words: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that can be pickled.  Raises StudyError."""
    try:
        pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError):
        name = getattr(function, "__name__", repr(function))
        raise StudyError(
            f"{words}: {name} cannot be pickled: write it as a function of a module (def at the "
            "left margin of a file)"
        ) from None
    return function


def function(words: str, given: Callable[..., Any], *arguments: str) -> Callable[..., Any]:
    """A function, if it can be called with these.  Raises StudyError."""
    wrong = misfit(given, *arguments)
    if wrong:
        raise StudyError(f"{words}: {wrong}")
    return given


def _real(words: str, value: object, places: Array | tuple[()]) -> Array:
    """One finite real number, or one for each place: () or (n,).  Raises StudyError."""
    if isinstance(value, np.ma.MaskedArray):
        raise StudyError(f"{words}: a masked array, whose mask says nothing here: fill it first")
    found = np.asarray(value)
    shapes = [(), (len(places),)] if isinstance(places, np.ndarray) else [()]
    many = f", or ({len(places)},) of them" if len(shapes) > 1 else ""
    if found.dtype.kind == "O":  # numbers of SymPy, say
        try:
            found = found.astype(np.float64)
        except (TypeError, ValueError):
            found = found.astype(str)
    if found.dtype.kind not in "fiu" or found.shape not in shapes:
        columns = ""
        shape = np.shape(places)
        if many and len(shape) == 2 and found.shape in (shape, shape[1:]):
            columns = f"; x has all places, {shape}, in columns: x[:, 0], ..."
        raise StudyError(
            f"{words}: one real number{many} is needed; given {found.dtype} of shape {found.shape}"
            + columns
        )
    bad = np.flatnonzero(~np.isfinite(found))
    if len(bad):
        at = f" at {place_text(places[bad[0]])}" if found.ndim else ""
        raise StudyError(f"{words} is {np.ravel(found)[bad[0]]}{at}: numbers must be finite")
    return found.astype(np.float64)


def named(words: str, values: Mapping[str, object] | tuple[str, ...], example: str) -> None:
    """Raise StudyError where no unknown is named."""
    if not values:
        raise StudyError(f"{words}: name an unknown, as in {example}")


def known(what: str, given: Iterable[str], allowed: Iterable[str], of: str) -> None:
    """Raise StudyError for a name that is not among the allowed ones."""
    names = list(dict.fromkeys(allowed))
    for name in given:
        if name not in names:
            raise StudyError(
                f"{of} has no {what} {name!r}{meant(name, names)}; it has {listed(names)}"
            )


def nodes_of(mesh: Mesh, where: Where) -> Integers:
    """Node numbers that are meant.  Raises StudyError, MeshError."""
    if isinstance(where, str) or callable(where):
        return mesh.nodes(where)
    if isinstance(where, np.ma.MaskedArray):
        raise StudyError("node numbers are a masked array, whose mask says nothing here")
    given = np.asarray(where)
    if isinstance(where, tuple) or given.dtype.kind == "f":
        return mesh.nodes_at(given)
    if given.dtype.kind not in "iu" or given.ndim != 1 or not mesh.anywhere(given.size):
        raise StudyError(f"{shown(where)}: node numbers are a list of integers")
    if given.size and not 0 <= given.min() <= given.max() < len(mesh.points):
        raise StudyError(f"node numbers go from 0 to {len(mesh.points) - 1}")
    if len(np.unique(given)) < len(given):
        raise StudyError(f"{shown(where)}: a node number stands twice")
    return given.astype(np.int64)


def partners(
    ours: Array,
    theirs: Array,
    tolerance: float,
    bodies: Callable[[], tuple[Integers, Integers]] | None = None,
) -> Integers:
    """For each of our places the number of the one of theirs that has the same place but for the
    shift between both centres. Nodes at one place have partners of their own body; bodies: numbers
    of the bodies of ours and theirs, (n,).  Raises StudyError where there is none.
    """
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    distance, chosen = map(np.asarray, cKDTree(b).query(a))
    size = max(float(np.ptp(ours, axis=0).max()), float(np.abs(ours - theirs).max()))
    worst, rounding = float(distance.max()), 8 * np.finfo(np.float64).eps * np.abs(ours).max()
    limit = max(tolerance * size, float(rounding))
    if not worst <= limit:
        raise StudyError(
            f"tie: the nodes of both sides do not fit, they are {worst:.3g} apart at "
            f"{place_text(ours[int(distance.argmax())])} (allowed: {limit:.3g}); sides "
            "of equal nodes but for a shift are tied, tolerance=... is relative to their size"
        )
    if len(np.unique(chosen)) == len(chosen):
        return np.asarray(chosen, dtype=np.int64)
    twice = ours[np.bincount(chosen)[chosen] > 1][0]
    if bodies is not None:
        far = 2.0 * (size or 1.0)
        a, b = (np.column_stack([x, far * k]) for x, k in zip((a, b), bodies(), strict=True))
        distance, chosen = map(np.asarray, cKDTree(b).query(a))
        if distance.max() <= limit and len(np.unique(chosen)) == len(chosen):
            return np.asarray(chosen, dtype=np.int64)
    raise StudyError(
        f"tie: two nodes at {place_text(twice)} have the same partner: nodes at one place are tied "
        "body by body, one of each body, and here the bodies of both sides differ or one has two; "
        "tie the sides of each body in a call of its own"
    )


def node_partners(mesh: Mesh, ours: Integers, theirs: Integers, tolerance: float) -> Integers:
    """For each of our nodes its partner among theirs, node numbers (n,).  Raises StudyError."""

    def bodies() -> tuple[Integers, Integers]:
        pairs = [np.stack([np.repeat(c[:, 0], c.shape[1]), c.ravel()]) for c in mesh.cells.values()]
        rows, columns = np.concatenate(pairs, axis=1)
        size = len(mesh.points)
        graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
        label = connected_components(graph, directed=False)[1].astype(np.int64)
        return label[ours], label[theirs]

    return theirs[partners(mesh.points[ours], mesh.points[theirs], tolerance, bodies)]
