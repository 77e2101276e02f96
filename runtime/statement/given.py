"""Reading what a script gives: numbers, data of elements, nodes; errors name it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.names import listed, meant
from softehl.runtime.statement.records import Datum, StudyError, Where, shown


def finite(name: str, value: object) -> float:
    """A number.  Raises StudyError."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise StudyError(f"{name} = {value!r}: a number is needed, or a function")
    if not np.isfinite(value):
        raise StudyError(f"{name} = {value!r}: the number must be finite")
    return float(value)


def parameter(block: str, name: str, value: object) -> None:
    """Raise StudyError unless it is a number or a function."""
    if callable(value):
        return
    if not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise StudyError(f"{block!r}: {name} = {value!r}, must be a number or a function of t")


def datum(block: str, name: str, value: Datum, centres: Array) -> Array:
    """One number a place, (n,).  Raises StudyError."""
    found = np.asarray(value(centres) if callable(value) else value, dtype=np.float64)
    if found.shape not in ((), (len(centres),)) or not np.isfinite(found).all():
        raise StudyError(
            f"{block!r}: {name} has shape {found.shape}, must be one finite number or "
            f"({len(centres)},) of them"
        )
    return np.broadcast_to(found, (len(centres),)).copy()


def known(what: str, given: Iterable[str], allowed: Iterable[str], of: str) -> None:
    """Raise StudyError for a name that is not among the allowed ones."""
    names = list(allowed)
    for name in given:
        if name not in names:
            raise StudyError(
                f"{of} has no {what} {name!r}{meant(name, names)}; it has {listed(names)}"
            )


def nodes_of(mesh: Mesh, where: Where) -> Integers:
    """Node numbers that are meant.  Raises StudyError, MeshError."""
    if isinstance(where, str) or callable(where):
        return mesh.nodes(where)
    given = np.asarray(where)
    if isinstance(where, tuple) or given.dtype.kind == "f":
        return np.array([mesh.node_at(given)])
    if given.dtype.kind not in "iu" or given.ndim != 1 or not given.size:
        raise StudyError(f"{shown(where)}: node numbers are a list of integers")
    if given.min() < 0 or given.max() >= len(mesh.points):
        raise StudyError(f"node numbers go from 0 to {len(mesh.points) - 1}")
    return given.astype(np.int64)


def partners(ours: Array, theirs: Array, tolerance: float) -> Integers:
    """For each of our places the number of the one of theirs that has the same place but for the
    shift between both centres.  Raises StudyError where there is none.
    """
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    chosen = distance.argmin(axis=1)
    size = max(float(np.ptp(ours, axis=0).max()), float(np.abs(ours - theirs).max()))
    worst = float(distance.min(axis=1).max())
    if worst > tolerance * size or len(set(chosen.tolist())) < len(chosen):
        raise StudyError(f"tie: the nodes of both sides do not fit, they are {worst:.3g} apart")
    return np.asarray(chosen, dtype=np.int64)
