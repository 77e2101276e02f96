"""Support of a problem: affine motions that its tangent does not resist, and their names.

A body that nothing holds is told before it is solved. Candidates are all fields that are constant
or linear in the places, on each part of the unknowns that the tangent connects: rigid motions,
shifts of a temperature, rotations of beams. One that is zero where unknowns are prescribed, and
whose product with the tangent is zero but for rounding, is free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.solve.solution import NotConverged, Solution, Status

_ROUNDING = 1e-12
"""Of the terms of an equation: what is left of a free motion by rounding, with a margin.  A spring
that is weaker than that, relative to the body, cannot be told from none."""

_BALANCINGS = 20  # each halves the exponents that are left

_AXES = "xyz"


def require_supported(system: System, problem: Any, x: Array) -> None:
    """Raise NotConverged that names the free motion if nothing holds a part of the problem at x.

    One that is spread over processes is looked at after its first step (`solve.singularity_check`).
    """
    if not isinstance(problem, Problem):
        return
    problem = problem.at(x)
    with np.errstate(all="ignore"):
        tangent = problem.assembler.linearise(x, problem.parameters)[1]
    if not np.isfinite(tangent.data).all():
        return  # Newton's method says where
    K = csc_array((tangent.data, tangent.indices, tangent.indptr), shape=tangent.shape, copy=True)
    K.eliminate_zeros()
    parts = connected_components(K, directed=False)[1].astype(np.int64)
    node, name = _nodal(system)
    fields, centres, sizes = _candidates(system, parts, node, name)
    units = _units(list(system.numbering.nodal), K, parts, name)
    rows = np.asarray(K @ (units[:, None] * fields))
    scale = np.asarray(abs(K) @ (units[:, None] * np.abs(fields))).sum(axis=1)
    rows[scale > 0.0] /= scale[scale > 0.0, None]
    rows[problem.fixed] = fields[problem.fixed]
    order = np.argsort(parts, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(parts[order])) + 1):
        if len(members) == 1 and scale[members[0]] > 0.0:
            continue  # an equation for itself
        basis = _independent(fields[members])
        free = _null(rows[members] @ basis) @ basis.T
        if not len(free):
            continue
        part = int(parts[members[0]])
        shape = len(free), len(system.numbering.nodal), system.mesh.dimension + 1
        unit = np.ones(shape[1])
        unit[name[members]] = units[members]
        motions = _RigidBodyModes(
            system, free.reshape(shape), unit, centres[part], sizes[part]
        ).names()
        first = int(node[members[node[members] >= 0]].min())
        alone = (parts[node >= 0] == part).all()
        raise NotConverged(_unsupported(system, x, motions, first, alone=bool(alone)))


def _unsupported(system: System, x: Array, motions: str, node: int, *, alone: bool) -> Solution:
    location = place_text(system.mesh.points[node])
    message = f"nothing prevents {motions}" + (
        "" if alone else f" of the part with node {node} {location}"
    )
    return Solution(x, Status.NOT_HELD, message, (), 0, 0)


def _nodal(system: System) -> tuple[Integers, Integers]:
    """Node and number of the name of each unknown, (n,), -1 where it is at no node."""
    node, name = np.full(system.size, -1), np.full(system.size, -1)
    for k, dofs in enumerate(system.numbering.nodal.values()):
        nodes = np.flatnonzero(dofs >= 0)
        node[dofs[nodes]], name[dofs[nodes]] = nodes, k
    return node, name


def _candidates(
    system: System, parts: Integers, node: Integers, name: Integers
) -> tuple[Array, Array, Array]:
    """Fields (n, names (1 + dim)): each name's 1, x, y, z, about the centre of each part and
    relative to its size; the centres (parts, dim) and sizes (parts,).
    """
    nodal_dofs = np.flatnonzero(node >= 0)
    points, label, count = (
        system.mesh.points[node[nodal_dofs]],
        parts[nodal_dofs],
        int(parts.max()) + 1,
    )
    weights = np.maximum(np.bincount(label, minlength=count), 1)[:, None]
    sums = [np.bincount(label, column, count) for column in points.T]
    centres = np.stack(sums, axis=1) / weights
    relative = points - centres[label]
    sizes = np.zeros(count)
    np.maximum.at(sizes, label, np.abs(relative).max(axis=1))
    sizes[sizes == 0.0] = 1.0
    width = points.shape[1] + 1
    fields = np.zeros((len(node), len(system.numbering.nodal), width))
    fields[nodal_dofs, name[nodal_dofs], 0] = 1.0
    fields[nodal_dofs, name[nodal_dofs], 1:] = relative / sizes[label, None]
    return fields.reshape(len(node), -1), centres, sizes


def _units(names: list[str], K: csc_array, parts: Integers, name: Integers) -> Array:
    """Units of the unknowns, (n,), in which the terms of an equation K x, (n, n), count alike: a
    pressure in Pa beside displacements in mm. One for each part and each vector or scalar.
    """
    vectors = [stem if axis in _AXES else n for n in names for stem, _, axis in [n.rpartition("_")]]
    kinds = {stem: k for k, stem in enumerate(dict.fromkeys(vectors))}
    if len(kinds) < 2:
        return np.ones(len(name))
    kind = np.array([*(kinds[stem] for stem in vectors), len(kinds)])[name]  # the last: no node
    groups, group = np.unique(parts * (len(kinds) + 1) + kind, return_inverse=True)
    ones, n = np.ones(len(name)), np.arange(len(name))
    member = csc_array((ones, (n, group)), shape=(len(name), len(groups)))
    terms = csc_array(member.T @ abs(K) @ member)
    rows, columns = np.ones(len(groups)), np.ones(len(groups))
    for _ in range(_BALANCINGS):  # the method of Ruiz
        scaled = terms.multiply(rows[:, None]).multiply(columns)
        largest = [scaled.max(axis=k).toarray().ravel() for k in (1, 0)]
        row, column = (1.0 / np.sqrt(np.where(a > 0.0, a, 1.0)) for a in largest)
        rows, columns = rows * row, columns * column
    return np.asarray(2.0 ** np.round(np.log2(columns[group])))  # adds no rounding of its own


def _independent(fields: Array) -> Array:
    """Combinations (columns, k) of the columns of (n, columns) that are independent and of size 1:
    nodes on a line do not tell all coordinates apart.
    """
    triangle = np.linalg.qr(fields, mode="r") if len(fields) > fields.shape[1] else fields
    _, values, vectors = np.linalg.svd(triangle, full_matrices=False)
    independent = values > 1e-9 * np.sqrt(len(fields))
    return np.asarray(
        (vectors[independent] * (np.sqrt(len(fields)) / values[independent])[:, None]).T
    )


def _null(rows: Array) -> Array:
    """Combinations (k, columns) of the columns of (n, columns) that are zero but for rounding."""
    if not rows.shape[1]:
        return np.empty((0, 0))
    triangle = np.linalg.qr(rows, mode="r") if len(rows) > rows.shape[1] else rows
    _, values, vectors = np.linalg.svd(triangle)
    values = np.append(values, np.zeros(len(vectors) - len(values)))
    null_vectors = vectors[values <= _ROUNDING * np.sqrt(len(rows))]
    return np.asarray(
        null_vectors[np.abs(rows @ null_vectors.T).max(axis=0, initial=0.0) <= _ROUNDING]
    )


@dataclass(frozen=True, eq=False)
class _RigidBodyModes:
    """Free motions (k, names, 1 + dim) of a part: constants, and slopes by (x - centre) / size, in
    units (names,).
    """

    system: System
    motions: Array
    units: Array
    centre: Array
    size: float

    def names(self) -> str:
        """Names of the motions: translations and shifts, then rotations, then anything else."""
        k, names, width = self.motions.shape
        gradients = self.motions[:, :, 1:].reshape(k, -1)
        left, values, _ = np.linalg.svd(gradients)
        bent = np.append(values, np.zeros(k))[:k] > 1e-6
        turned = (left.T @ self.motions.reshape(k, -1)).reshape(k, names, width)
        translations = turned[~bent][:, :, 0]
        descriptions = [self._shift(v) for v in _along_axes(translations)]
        vector = self._vector()
        if vector is None or not bent.any():
            return ", ".join(
                [*descriptions, *("a motion linear in the places" for _ in turned[bent])]
            )
        return ", ".join(
            [*descriptions, *self._rotations(turned[bent][:, vector], moves=len(translations) > 0)]
        )

    def _vector(self) -> list[int] | None:
        """Numbers of the names that are components of one vector, along all coordinates."""
        unknowns, axes = list(self.system.numbering.nodal), _AXES[: self.system.mesh.dimension]
        for stem in dict.fromkeys(name.rpartition("_")[0] for name in unknowns):
            components = [f"{stem}_{axis}" for axis in axes]
            if stem and len(axes) > 1 and all(name in unknowns for name in components):
                return [unknowns.index(name) for name in components]
        return None

    def _shift(self, values: Array) -> str:
        unknowns, vector = list(self.system.numbering.nodal), self._vector() or []
        moved = np.flatnonzero(np.abs(values) > 1e-6)
        if len(moved) == 1 and moved[0] in vector:
            return f"a translation along {_AXES[vector.index(int(moved[0]))]}"
        if len(moved) == 1:
            return f"a constant added to {unknowns[moved[0]]}"
        amounts = values * self.units / self.units[moved].max()
        parts = ", ".join(f"{unknowns[i]} by {amounts[i]:.3g}" for i in moved)
        return f"a shift of {parts}"

    def _rotations(self, turned: Array, *, moves: bool) -> list[str]:
        """Of motions (k, dim, 1 + dim) of the displacements."""
        gradients = turned[:, :, 1:]
        if np.abs(gradients + gradients.transpose(0, 2, 1)).max() > 1e-6 * np.abs(gradients).max():
            return ["a motion linear in the places"]
        if gradients.shape[1] == 2:
            axes, descriptions = np.zeros((len(gradients), 0)), ["a rotation"]
        else:
            axes = np.stack([gradients[:, 2, 1], gradients[:, 0, 2], gradients[:, 1, 0]], axis=1)
            descriptions = [f"a rotation about {_direction(a)}" for a in _along_axes(axes)]
        if moves or len(gradients) > 1:
            return descriptions
        offset = np.linalg.lstsq(gradients[0], -turned[0, :, 0], rcond=1e-6)[0]
        centre = self.centre + self.size * offset
        centre[np.abs(centre) < 1e-6 * self.size] = 0.0
        axis = f"{_direction(axes[0])} through " if axes.size else ""
        return [f"a rotation about {axis}{place_text(centre)}"]


def _direction(axis: Array) -> str:
    """x, y or z, or the components of another direction."""
    axis = axis / np.abs(axis).max()
    where = np.flatnonzero(np.abs(axis) > 1e-6)
    if len(where) == 1:
        return _AXES[where[0]]
    return "(" + ", ".join(f"{a:.3g}" for a in axis) + ")"


def _along_axes(vectors: Array) -> Array:
    """A basis (k, m) of the span of vectors (k, m), in reduced echelon form: few entries each."""
    basis, row = vectors.copy(), 0
    for column in range(basis.shape[1]):
        if row == len(basis):
            break
        pivot = row + int(np.abs(basis[row:, column]).argmax())
        if abs(basis[pivot, column]) < 1e-6:
            continue
        basis[[row, pivot]] = basis[[pivot, row]]
        basis[row] /= basis[row, column]
        others = np.arange(len(basis)) != row
        basis[others] -= basis[others, column][:, None] * basis[row]
        row += 1
    return basis[:row]
