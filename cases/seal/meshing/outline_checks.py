"""Checks of the outline of a section: closed, simple, without pieces of no length; of polygons."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, hypot, radians

import numpy as np

from softehl.cases.seal.meshing.curve_segments import OutlineError, Piece, meetings
from softehl.runtime.arrays import Array, Flags, Integers

CLOSED = 1e-6
"""Part of the size of an outline to which its pieces meet one another."""

_BACK = radians(179.9)  # a turn by which an outline goes back upon itself


def require_lengths(pieces: Sequence[Piece], within: float) -> None:
    """That every piece is longer than `within`."""
    for k, piece in enumerate(pieces):
        if not piece.length > within:
            z, r = piece.start
            raise OutlineError(
                f"piece {k + 1} of the outline, at ({z:.6g}, {r:.6g}), has no length; remove it"
            )


def require_closed(pieces: Sequence[Piece], within: float) -> None:
    """That every piece begins within that of where the one before ends."""
    for piece, after in zip(pieces, (*pieces[1:], pieces[0]), strict=True):
        gap = hypot(after.start[0] - piece.end[0], after.start[1] - piece.end[1])
        if gap > within:
            z, r = piece.end
            raise OutlineError(
                f"the outline is open: a gap of {gap:.4g} mm at ({z:.6g}, {r:.6g}); close it"
            )


def require_no_spikes(pieces: Sequence[Piece], turns: Array) -> None:
    """That no piece begins by going back; turns: (pieces,) at their starts, rad."""
    for piece, turn in zip(pieces, turns, strict=True):
        if abs(turn) > _BACK:
            z, r = piece.start
            raise OutlineError(
                f"the outline turns back upon itself at ({z:.6g}, {r:.6g}), by "
                f"{degrees(abs(turn)):.4g} degrees; remove the spike"
            )


def require_no_crossing(pieces: Sequence[Piece], within: float) -> None:
    """Pairs of pieces whose boxes meet are looked at; neighbours may share their common end."""
    count = len(pieces)
    for i, j in _near_pairs(pieces, within):
        shared = []
        if (i + 1) % count == j:
            shared.append(pieces[j].start)
        if (j + 1) % count == i:
            shared.append(pieces[i].start)
        for z, r in meetings(pieces[i], pieces[j], within):
            if all(hypot(z - a, r - b) > 1e3 * within for a, b in shared):
                raise OutlineError(
                    f"the outline crosses or touches itself at ({z:.6g}, {r:.6g}); it must be "
                    "one simple contour"
                )


def _near_pairs(pieces: Sequence[Piece], within: float) -> Integers:
    """Pairs (n, 2) of different pieces whose boxes meet."""
    low_z, low_r, high_z, high_r = np.array([piece.box for piece in pieces]).T
    meet: Flags = low_z[:, None] <= high_z[None] + within
    meet &= low_r[:, None] <= high_r[None] + within
    return np.argwhere(np.triu(meet & meet.T, 1))


def crossing(loop: Array) -> Array | None:
    """A point (2,) at which the closed polygon of points (n, 2) crosses itself, None if nowhere."""
    along = np.roll(loop, -1, axis=0) - loop
    i, j = np.triu_indices(len(loop), 2)
    separate = j - i < len(loop) - 1  # the last side is a neighbour of the first
    i, j = i[separate], j[separate]
    between, turn = loop[j] - loop[i], cross(along[i], along[j])
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = cross(between, along[j]) / turn, cross(between, along[i]) / turn
    for k in np.flatnonzero((s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)):
        return np.asarray(loop[i[k]] + s[k] * along[i[k]])
    return None


def cross(a: Array, b: Array) -> Array:
    """Cross products (...,) of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
