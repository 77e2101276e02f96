"""A mesh of an outline carried to another outline of as many pieces, its elements as they were.

Nodes of the boundary keep their part of their piece; what is inside follows as the potential of
either coordinate does, so that a mesh that only grows or shifts does that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from softehl.cases.seal.meshing.outline import Outline, OutlineError
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS

_GAUSS = 1.0 / np.sqrt(3.0)
_CORNERS = CELLS["quad4"].nodes


def carried_places(s: Array, old: Outline, new: Outline) -> Array:
    """Places (n,) on the new outline of those at s (n,) on the old one, in the same turn, mm.

    Raises OutlineError unless both have as many pieces.
    """
    if len(old.pieces) != len(new.pieces):
        raise OutlineError(
            f"an outline of {len(old.pieces)} pieces has become one of {len(new.pieces)}"
        )
    turns, within = np.divmod(np.asarray(s), old.length)
    return np.asarray(turns * new.length + np.interp(within, old.starts, new.starts))


def carried_mesh(mesh: SectionMesh, old: Outline, new: Outline) -> SectionMesh:
    """The mesh of the old outline on the new one.  Raises OutlineError as `carried_places`."""
    positions = carried_places(mesh.positions, old, new)
    moved = np.zeros_like(mesh.points)
    moved[mesh.boundary] = new.at(positions) - mesh.points[mesh.boundary]
    moved = potential(mesh, moved)
    return replace(mesh, points=mesh.points + moved, positions=positions, length=new.length)


def potential(mesh: SectionMesh, values: Array) -> Array:
    """The values (V, k) of the boundary, and inside those of the potential that has them there."""
    extended, stiff = values.copy(), _laplacian(mesh)
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    extended[inside] = 0.0
    pulled = -(stiff @ extended)[inside]
    extended[inside] = splu(csc_array(stiff[inside][:, inside])).solve(pulled)
    return extended


def _laplacian(mesh: SectionMesh) -> csc_array:
    """Of bilinear shape functions, (V, V): it has none but linear fields to hold still."""
    corners, K = mesh.points[mesh.quads], np.zeros((len(mesh.quads), 4, 4))
    for at in _GAUSS * _CORNERS:
        gradients = 0.25 * _CORNERS * (1.0 + _CORNERS[:, ::-1] * at[::-1])
        jacobian = np.einsum("ak,eai->eki", gradients, corners)
        gradient = np.linalg.solve(jacobian, np.broadcast_to(gradients.T, (len(K), 2, 4)))
        K += np.einsum("eia,eib,e->eab", gradient, gradient, np.linalg.det(jacobian))
    rows, columns = np.repeat(mesh.quads, 4, axis=1), np.tile(mesh.quads, 4)
    n = len(mesh.points)
    return csc_array(coo_array((K.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)))
