"""From one mesh of a section to another: nodal values, element values, values along the boundary.

For meshes of the same circle whose nodes lie anywhere; `runtime.mesh.prolongation` is sharper where
one mesh holds the nodes of the other, `runtime.mesh.carrying` is for sections of any outline.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator, RBFInterpolator

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.location import interpolated
from softehl.runtime.mesh.sections import SectionMesh

_LONG = 20.0  # ratio of the sides of an element, above which splines are not used
_OUTSIDE = 1.1  # parent coordinates up to which values are extrapolated
_NEIGHBOURS = 32  # of a local spline: about three rings of a structured mesh


def transfer_nodes(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Nodal values (V', k) on the new mesh from those, (V, k), on the old: local splines.

    Where old elements are so long that the neighbours lie in a row a spline leads anywhere: values
    are bilinear in the elements then, which turns no thin element over.
    """
    if _longest(old) > _LONG:
        return interpolated(old.points, old.quads, values, new.points, _OUTSIDE)
    spline = RBFInterpolator(old.points, values, neighbors=_NEIGHBOURS, kernel="cubic", degree=2)
    return np.asarray(spline(new.points))


def _longest(mesh: SectionMesh) -> float:
    """The largest ratio of two sides of an element."""
    corners = mesh.points[mesh.quads]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return float((sides.max(axis=1) / sides.min(axis=1)).max())


def transfer_elements(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Element values (Q',) on the new mesh from those, (Q,), on the old, by their centres."""
    spline = RBFInterpolator(
        old.points[old.quads].mean(axis=1), values, neighbors=8, kernel="linear"
    )
    return np.asarray(spline(new.points[new.quads].mean(axis=1)))


def transfer_chain(
    old: SectionMesh, new: SectionMesh, nodes: Integers, new_nodes: Integers, values: Array
) -> Array:
    """Values (n',) at new_nodes of the boundary from those, (n,), at nodes, by the angle.

    Both go around the same part of the boundary. Shape preserving: no value beyond its neighbours.
    """
    return np.asarray(PchipInterpolator(_angles(old, nodes), values)(_angles(new, new_nodes)))


def transfer_loop(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Values (n',) at the whole boundary of the new mesh from those, (n,), of the old, by angle."""
    turn, angles = 2.0 * np.pi, _angles(old, old.boundary)
    at = np.concatenate([angles - turn, angles, angles + turn])
    return np.asarray(PchipInterpolator(at, np.tile(values, 3))(_angles(new, new.boundary)))


def _angles(mesh: SectionMesh, nodes: Integers) -> Array:
    """Angles of boundary nodes about the middle of the boundary, rising, rad."""
    whole = mesh.points[mesh.boundary]
    away = mesh.points[nodes] - 0.5 * (whole.min(axis=0) + whole.max(axis=0))
    return np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
