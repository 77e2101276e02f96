"""Cells of a periodic material: fluctuations that repeat, effective stress and exact tangent.

Displacements are u = (F - I) X + w with w equal on opposite sides. Nodes that are images of each
other, corners among them, share one w: x = B z + c with z the free unknowns, so the equations are
B' R(B z + c) = 0. With phi_iJ = e_i X_J the mean stress is P_iJ = phi_iJ' R / V, and its exact
tangent is that of the equations with z eliminated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import coo_array, csc_array, hstack
from scipy.sparse.csgraph import connected_components

from softehl.runtime.analyses.initial_state import SMALLEST
from softehl.runtime.arrays import Array, Flags, Integers, count_of
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import System
from softehl.runtime.equations.system_builder import build_system
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.result import Result
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.suggestions import join_names

Gradient: TypeAlias = "Array | Sequence[Sequence[float | None]]"
"""Mean deformation gradient, (dim, dim); None where the mean stress is zero instead."""

_AXES = "xyz"
_NET = 1e-6  # of the sum of the terms: a larger net force is more than Newton's method leaves


@dataclass(frozen=True, eq=False)
class Homogenised:
    """Converged state of a unit cell.

    Attributes
    ----------
    cell : Cell
        The unit cell.
    F : array (dim, dim)
        Mean deformation gradient.
    result : Result
        State of the cell, for its fields and files.
    """

    cell: Cell
    F: Array
    result: Result

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Homogenised: F = {self.F.tolist()}, P = {self.P.tolist()}>"

    @property
    def P(self) -> Array:
        """Mean first Piola-Kirchhoff stress (dim, dim) [MPa]."""
        r = self.result.problem.assembler.residual(self.result.x, self.result.problem.parameters)
        return (self.cell.modes.T @ r).reshape(self.F.shape) / self.cell.volume

    @cached_property
    def A(self) -> Array:
        """Exact tangent dP_iJ / dF_kL, (dim, dim, dim, dim) [MPa]."""
        problem, modes = self.result.problem, self.cell.modes
        K = problem.assembler.linearise(self.result.x, problem.parameters)[1]
        T = self.cell.fluctuations
        stiff = K @ modes
        tangent = modes.T @ stiff
        if T.shape[1]:  # else nothing fluctuates: one linear cell
            factors = direct_solver("auto").factorise(csc_array(T.T @ K @ T))
            bent = np.stack([factors.solve(row) for row in np.asarray(T.T @ stiff).T], axis=1)
            tangent = tangent - modes.T @ (K @ (T @ bent))
        return np.asarray(tangent).reshape(2 * self.F.shape) / self.cell.volume


@dataclass(frozen=True, eq=False)
class Cell:
    """Study with periodic displacement fluctuations: the unit cell of a material.

    Attributes
    ----------
    system : System
        Equations of the study.
    fluctuations : sparse array (n, m)
        All unknowns by the independent ones.
    modes : array (n, dim dim)
        Unknowns of the components of the mean displacement gradient, row by row.
    volume : float
        Of the cell, holes included [mm^3].
    """

    system: System
    fluctuations: csc_array[np.float64]
    modes: Array
    volume: float

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Cell: volume {self.volume:.6g}, {self.system.mesh!r}>"

    def solve(
        self,
        F: Gradient,
        *,
        steps: int = 1,
        start: Homogenised | None = None,
        newton: Newton | None = None,
    ) -> Homogenised:
        """Return the state at a mean deformation gradient.

        Parameters
        ----------
        F : array (dim, dim)
            Mean deformation gradient; None in place of a component whose mean stress vanishes.
        steps : int
            Number of load steps, from rest or from `start`; history is committed after each.
        start : Homogenised, optional
            State at the beginning.
        newton : Newton, optional
            Settings of Newton's method.

        Returns
        -------
        Homogenised
            Mean stress, its tangent, and the state of the cell.

        Raises
        ------
        StudyError
            F has a wrong shape, or `steps` is not allowed.
        NotConverged
            The end is not reached.
        """
        count = count_of(steps)
        if count is None:
            raise StudyError(f"steps = {steps!r}: a whole number of at least 1 is needed")
        target, free = self._gradient(F)
        dim = len(target)
        initial = np.eye(dim) if start is None else start.F
        after = np.where(free, initial, target)
        x0 = self.system.at_rest() if start is None else start.result.x
        path = _CellPath(self, free, initial, after, x0, self._histories(start))
        first = 1.0 / count
        follow = Continuation(
            newton or Newton(linear=direct_solver("auto")),
            StepRule(first, min(SMALLEST, first), first),
            name="share of the load",
        ).follow
        branch = follow(path.problem_at, 0.0, 1.0, path.z, on_point=path.commit)
        if not branch.converged:
            raise NotConverged(branch, path.reached)
        assert path.reached is not None
        return path.reached

    def _histories(self, start: Homogenised | None) -> dict[str, Array]:
        return self.system.histories() if start is None else dict(start.result.histories)

    def _gradient(self, F: Gradient) -> tuple[Array, Flags]:
        """Components (dim, dim), and which of them are free."""
        dim = self.system.mesh.dimension
        components: Any = np.array(F, dtype=object)
        if components.shape != (dim, dim):
            raise StudyError(f"F has shape {components.shape}: ({dim}, {dim}) is needed")
        free: Flags = np.array([[x is None for x in row] for row in components], dtype=bool)
        gradient = np.where(free, np.eye(dim), components).astype(np.float64)
        if not np.isfinite(gradient).all() or not np.linalg.det(gradient) > 0.0:
            raise StudyError(f"F = {F}: numbers (or None) with a determinant above 0 are needed")
        return gradient, free


@dataclass(eq=False)
class _CellPath:
    """A cell on its way from one gradient to another."""

    cell: Cell
    free: Flags
    initial: Array
    after: Array
    x: Array
    histories: dict[str, Array]
    reached: Homogenised | None = None
    z: Array = field(init=False)

    def __post_init__(self) -> None:
        basis, w = self.cell.fluctuations, self.x - self._displacement(self.initial)
        counts: Array = np.asarray(basis.sum(axis=0)).ravel()
        opened = (self.initial - self._unit)[self.free]
        self.z = np.concatenate([np.asarray(basis.T @ w) / counts, opened])

    @property
    def _unit(self) -> Array:
        return np.eye(len(self.initial))

    def _displacement(self, F: Array) -> Array:
        return np.asarray(self.cell.modes @ (F - self._unit).ravel())

    def problem_at(self, t: float) -> PeriodicProblem:
        """The equations at a share of the way."""
        F = self.initial + t * (self.after - self.initial)
        F[self.free] = self._unit[self.free]
        system, cell = self.cell.system, self.cell
        problem = system.problem(system.quasi_static_step(t, self.x, self.histories))
        opened = csc_array(cell.modes[:, self.free.ravel()])
        basis = csc_array(hstack([cell.fluctuations, opened]))
        return PeriodicProblem(problem, basis, self._displacement(F), F)

    def commit(self, point: Point) -> None:
        """Go on from a converged point."""
        reduced, z = self.problem_at(point.parameter), point.solution.x
        F, x = reduced.shift.copy(), reduced.full(z)
        F[self.free] += z[len(z) - int(self.free.sum()) :]
        self._require_balance(reduced.problem.at(x), x)
        self.x = x
        self.histories = self.cell.system.committed(reduced.problem, x, self.histories)
        full_point = Point(point.parameter, replace(point.solution, x=x))
        result = Result(self.cell.system, reduced.problem.at(x), full_point, self.histories)
        self.reached = Homogenised(self.cell, F, result)

    def _require_balance(self, problem: Problem, x: Array) -> None:
        """Raise StudyError where a net force acts, which the one node at rest would carry."""
        r, sizes = problem.assembler.residual_and_size(x, problem.parameters)
        nodal = self.cell.system.numbering.nodal
        for axis in _AXES[: len(self.initial)]:
            dofs = nodal[f"u_{axis}"]
            dofs = dofs[dofs >= 0]
            net = float(r[dofs].sum())
            if abs(net) > _NET * float(sizes[dofs].sum()):
                raise StudyError(
                    f"periodic: a net force of {-net:.4g} along {axis} acts on the cell; loads, "
                    "body forces and springs of a periodic cell must balance"
                )


@dataclass(frozen=True, eq=False)
class PeriodicProblem:
    """Equations B' R(B z + c) = 0, as Newton's method sees them.

    basis, base: B (n, m) and c (n,). shift: the gradient (dim, dim) that c stands for.
    """

    problem: Problem
    basis: csc_array[np.float64]
    base: Array
    shift: Array

    def full(self, z: Array) -> Array:
        """All unknowns, (n,)."""
        return np.asarray(self.basis @ z + self.base)

    def residual(self, z: Array) -> Array:
        """See `NonlinearProblem`."""
        x = self.full(z)
        r = self.problem.at(x).assembler.residual(x, self.problem.parameters)
        return np.asarray(self.basis.T @ r)

    def linearise(self, z: Array) -> tuple[Array, csc_array[np.float64]]:
        """See `NonlinearProblem`."""
        x = self.full(z)
        r, K = self.problem.at(x).assembler.linearise(x, self.problem.parameters)
        return np.asarray(self.basis.T @ r), csc_array(self.basis.T @ K @ self.basis)

    def norm(self, r: Array) -> float:
        """Not used: residuals are measured relative to their forces."""
        raise NotImplementedError

    def step_limit(self, x: Array, dx: Array) -> float:
        """Problems of studies have no guards."""
        return 1.0

    def measure(self, z: Array, K: object, *, rounded: bool = False) -> float:
        """Residuals of each field relative to its forces, inf where they are not finite.

        rounded: what rounding may have caused does not count, which at rest is all there is.
        """
        x = self.full(z)
        problem = self.problem.at(x)
        r, forces = problem.assembler.residual_and_size(x, problem.parameters)
        if not np.isfinite(r).all():
            return float("inf")
        noise = np.zeros_like(r)
        if rounded:
            noise = problem.noise(x, problem.assembler.linearise(x, problem.parameters)[1])
        worst = 0.0
        for part in self.problem.layout.fields:
            rows = self.basis[part]
            rounding = np.asarray(abs(rows).T @ noise[part])
            left = np.linalg.norm(np.maximum(np.abs(np.asarray(rows.T @ r[part])) - rounding, 0.0))
            size = np.linalg.norm(forces[part])
            worst = max(worst, float(left / size) if size > 0.0 else 0.0)
        return worst


def periodic_cell(
    definition: ProblemDefinition, pairs: Sequence[tuple[Any, Any]], tolerance: float
) -> Cell:
    """Return a study as a periodic cell; see `Study.periodic`."""
    system = build_system(definition)
    system.mesh.require_whole("periodic")
    mesh, nodal = system.mesh, system.numbering.nodal
    names = [f"u_{axis}" for axis in _AXES[: mesh.dimension]]
    missing = [name for name in names if name not in nodal]
    if missing:
        raise StudyError(
            f"periodic: no unknown {join_names(missing)}; at nodes: {join_names(nodal)}"
        )
    if len(pairs) != mesh.dimension:
        raise StudyError(
            f"periodic: {len(pairs)} pairs of sides; a mesh in {mesh.dimension}-D needs "
            f"{mesh.dimension}"
        )
    if definition.conditions:
        raise StudyError(
            f"periodic: {definition.conditions[0].call}: the cell is moved by F alone, and held "
            "by itself; leave fix out"
        )
    images, shifts = _images(mesh, pairs, tolerance)
    volume = float(abs(np.linalg.det(shifts)))
    if not volume > 0.0:
        raise StudyError("periodic: the pairs of sides are not shifted in independent directions")
    return Cell(system, _fluctuations(system, images, names), _modes(system, names), volume)


def _images(
    mesh: Mesh, pairs: Sequence[tuple[Any, Any]], tolerance: float
) -> tuple[Integers, Array]:
    """Group of images of each node, (points,), and the shift of each pair, (dim, dim)."""
    rows, columns, shifts = [], [], []
    for where, to in pairs:
        side_nodes, partner_nodes = read.nodes_of(mesh, where), read.nodes_of(mesh, to)
        if len(side_nodes) != len(partner_nodes):
            raise StudyError(
                f"periodic({where!r}, {to!r}): {len(side_nodes)} and {len(partner_nodes)} nodes; "
                "the mesh of both sides must be the same"
            )
        rows.append(side_nodes)
        columns.append(read.node_partners(mesh, side_nodes, partner_nodes, tolerance))
        shifts.append((mesh.points[partner_nodes] - mesh.points[side_nodes]).mean(axis=0))
    a, b, n = np.concatenate(rows), np.concatenate(columns), len(mesh.points)
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64), np.stack(shifts)


def _fluctuations(system: System, images: Integers, names: Sequence[str]) -> csc_array[np.float64]:
    """Unknowns by free ones, (n, m): images share one; the first node with displacements rests."""
    column = np.arange(system.size)
    for dofs in system.numbering.nodal.values():
        mask = dofs >= 0
        first = np.full(len(images), system.size)
        np.minimum.at(first, images[mask], dofs[mask])
        column[dofs[mask]] = first[images[mask]]
    starts = [system.numbering.nodal[name] for name in names]
    fixed = [int(column[dofs[dofs >= 0][0]]) for dofs in starts]
    moving = ~np.isin(column, fixed)
    used, position = np.unique(column[moving], return_inverse=True)
    entries = np.ones(len(position)), (np.flatnonzero(moving), position)
    return csc_array(coo_array(entries, shape=(system.size, len(used))))


def _modes(system: System, names: Sequence[str]) -> Array:
    """Unknowns by the components of the mean displacement gradient, (n, dim dim)."""
    dim = len(names)
    modes = np.zeros((system.size, dim * dim))
    for i, name in enumerate(names):
        dofs = system.numbering.nodal[name]
        mask = dofs >= 0
        modes[dofs[mask], i * dim : (i + 1) * dim] = system.mesh.points[mask, :dim]
    return modes
