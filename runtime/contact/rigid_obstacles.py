"""Nodes against rigid obstacles: candidates, tributary areas and kernel data, no physics.

An obstacle is a coaxial cylinder or a plane normal to the axis. With its constant normal n out of
the obstacle, the gap of a deformed node x is n . x - c - offset.

Radii may be counted negative, r = -radius: a bore around a body is then a rod below it. Forces
change their sign with r, as the rows of all other terms that have 2 pi r in them do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.dofmap import displacement_dofs, gather_rows
from softehl.runtime.discretisation.element_blocks import ElementBlock, ElementKernel


@dataclass(frozen=True)
class Obstacle:
    """A rigid surface: n . x = c, with n = (n_z, n_r) pointing out of it into free space."""

    name: str
    n_z: float
    n_r: float
    c: float

    def gap(self, points: Array) -> Array:
        """Gap (n,) of points (n, 2) in (z, r), mm; negative inside the obstacle."""
        return np.asarray(self.n_z * points[:, 0] + self.n_r * points[:, 1] - self.c)


def inner_cylinder(name: str, radius: float) -> Obstacle:
    """A rod of this radius (mm), body outside of it."""
    return Obstacle(name, 0.0, 1.0, radius)


def outer_cylinder(name: str, radius: float) -> Obstacle:
    """A bore of this radius (mm), body inside of it."""
    return Obstacle(name, 0.0, -1.0, -radius)


def plane(name: str, z: float, *, faces: int) -> Obstacle:
    """A wall at z (mm) with the body on its +z side (faces = 1) or its -z side (faces = -1)."""
    if faces not in (-1, 1):
        raise ValueError(f"plane: faces = {faces}, it must be 1 or -1")
    return Obstacle(name, float(faces), 0.0, faces * z)


def tributary_areas(points: Array, segments: Integers, nodes: Integers) -> Array:
    """Reference area (n,) of each node, mm^2: integral of its shape function times 2 pi |R|.

    points: (V, 2) in (z, r); segments: (m, 2) node numbers; nodes: (n,), those asked for. The areas
    of all nodes of a chain add up to its surface; segments are weighted one by one, so that
    the multiplier of an end node counts only the half segment that it has.
    """
    end_points = points[segments]
    length = np.linalg.norm(end_points[:, 1] - end_points[:, 0], axis=1)
    radius = np.abs(end_points[:, :, 1])
    first = 2.0 * np.pi * length * (2.0 * radius[:, 0] + radius[:, 1]) / 6.0
    second = 2.0 * np.pi * length * (radius[:, 0] + 2.0 * radius[:, 1]) / 6.0
    total = np.bincount(segments[:, 0], first, len(points))
    total += np.bincount(segments[:, 1], second, len(points))
    return np.asarray(total[nodes])


def contact_data(
    obstacle: Obstacle, points: Array, nodes: Integers, segments: Integers, stiffness: Array | float
) -> Array:
    """Constants (n, 5) of the contact elements of nodes: normal, place, area, augmentation rho.

    points: (V, 2) reference (z, r). nodes, segments: (n,) and (m, 2), see `tributary_areas`.
    stiffness: MPa, one or (n,), about the shear modulus; rho is stiffness over the width of the
    node, which is of the order of the stiffness of the material under it: much softer and much
    stiffer values let single nodes flip for ever.
    """
    areas = tributary_areas(points, segments, nodes)
    radii = points[nodes, 1]
    width = areas / (2.0 * np.pi * np.abs(radii))
    columns = [np.full(len(nodes), v) for v in (obstacle.n_z, obstacle.n_r, obstacle.c)]
    return np.stack([*columns, np.copysign(areas, radii), stiffness / width], axis=1)


def contact_block(
    obstacle: Obstacle,
    kernel: ElementKernel,
    points: Array,
    candidates: tuple[Integers, Integers, Integers],
    stiffness: float,
) -> ElementBlock:
    """One contact element for each candidate node.

    points: (V, 2) reference (z, r). candidates: nodes (n,), their segments (m, 2) and the
    unknowns (n,) of their multipliers. stiffness: MPa, see `contact_data`.
    """
    nodes, segments, multipliers = candidates
    data = contact_data(obstacle, points, nodes, segments, stiffness)
    dofs = gather_rows(displacement_dofs(nodes[:, None]), multipliers)
    return ElementBlock(obstacle.name, kernel, points[nodes].copy(), dofs, data)
