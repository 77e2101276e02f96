"""Overlap of a deformed section with itself, as of the lips of a cup under a high pressure.

Contact of a section with itself is not modelled, nor with the rod beyond the film: it is noticed.
"""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array


def overlap(system: SealSystem, x: Array) -> str:
    """Bodies that the deformed outline of the state x overlaps, in words; empty if none."""
    deformed = system.deformed(x)
    place = crossing(deformed[system.mesh.boundary])
    if place is not None:
        return f"into itself at z = {place[0]:.3g}, r = {place[1]:.4g} mm"
    z, r = deformed[system.mesh.outer_nodes].T
    within = int(np.argmin(r))
    if r[within] < system.rod_radius:
        return f"into the rod beyond its film at z = {z[within]:.3g} mm"
    return ""


def crossing(loop: Array) -> Array | None:
    """A point (2,) at which the closed polygon of points (n, 2) crosses itself, None if nowhere."""
    a, count = loop, len(loop)
    along = np.roll(loop, -1, axis=0) - a
    between = a[None] - a[:, None]  # [i, j]: from the start of side i to that of side j
    turn = _cross(along[:, None], along[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        s = _cross(between, along[None]) / turn
        t = _cross(between, along[:, None]) / turn
    i, j = np.indices((count, count))
    apart = (abs(i - j) > 1) & (abs(i - j) < count - 1)
    meet = apart & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    if not meet.any():
        return None
    first = int(np.argwhere(meet)[0, 0])
    second = int(np.argwhere(meet)[0, 1])
    return np.asarray(a[first] + s[first, second] * along[first])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
