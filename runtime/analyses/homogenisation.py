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
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, hstack
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
from softehl.runtime.solve.linear.linear_solver import LinearSolver, solved_columns
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.suggestions import join_names

Gradient: TypeAlias = "Array | Sequence[Sequence[float | None]]"
"""Mean deformation gradient, (dim, dim); None where the mean stress is zero instead."""

Small: TypeAlias = "NDArray[np.int32]"
"""Indices of a sparse pattern."""

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
        return self.cell.stress(r)

    @cached_property
    def A(self) -> Array:
        """Exact tangent dP_iJ / dF_kL, (dim, dim, dim, dim) [MPa]."""
        problem = self.result.problem
        K = problem.assembler.linearise(self.result.x, problem.parameters)[1]
        return self.cell.condensed(K, direct_solver("auto"))[0].reshape(2 * self.F.shape)


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

    @cached_property
    def basis(self) -> Basis:
        """Fluctuations as the basis of the free unknowns."""
        return Basis(self.fluctuations)

    def displacement(self, F: Array) -> Array:
        """Return the unknowns of a mean deformation gradient without fluctuations.

        Parameters
        ----------
        F : array (dim, dim)
            Mean deformation gradient.

        Returns
        -------
        array (n,)
            Unknowns.
        """
        return np.asarray(self.modes @ (F - np.eye(len(F))).ravel())

    def stress(self, r: Array) -> Array:
        """Return the mean stress by the residuals of the cell.

        Parameters
        ----------
        r : array (n,)
            Residuals of all unknowns.

        Returns
        -------
        array (dim, dim)
            Mean first Piola-Kirchhoff stress [MPa].
        """
        dim = self.system.mesh.dimension
        return np.asarray(self.modes.T @ r).reshape(dim, dim) / self.volume

    def condensed(self, K: csc_array[np.float64], solver: LinearSolver) -> tuple[Array, Array]:
        """Return the tangent of the mean stress, with fluctuations condensed, and their slope.

        Parameters
        ----------
        K : sparse array (n, n)
            Tangent of the cell.
        solver : LinearSolver
            Solver of the condensation.

        Returns
        -------
        A : array (dim dim, dim dim)
            dP/dF, row by row [MPa].
        slope : array (m, dim dim)
            Derivatives of the free unknowns by F at equilibrium.

        Raises
        ------
        SingularMatrix
            The fluctuations are not determined.
        """
        stiff = np.asarray(K @ self.modes)
        A, slope = self.modes.T @ stiff, np.zeros((self.basis.size, self.modes.shape[1]))
        if self.basis.size:  # else nothing fluctuates: one linear cell
            factors = solver.factorise(self.basis.matrix(K))
            slope = -solved_columns(factors, np.asarray(self.basis.rows @ stiff))
            A = A + np.asarray(self.basis.rows @ (K.T @ self.modes)).T @ slope
        return np.asarray(A) / self.volume, slope

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
        w = self.x - self.cell.displacement(self.initial)
        opened = (self.initial - self._unit)[self.free]
        self.z = np.concatenate([self.cell.basis.coordinates(w), opened])

    @property
    def _unit(self) -> Array:
        return np.eye(len(self.initial))

    def problem_at(self, t: float) -> PeriodicProblem:
        """The equations at a share of the way."""
        F = self.initial + t * (self.after - self.initial)
        F[self.free] = self._unit[self.free]
        system, cell = self.cell.system, self.cell
        problem = system.problem(system.quasi_static_step(t, self.x, self.histories))
        basis = cell.basis
        if self.free.any():
            opened = csc_array(cell.modes[:, self.free.ravel()])
            basis = Basis(csc_array(hstack([cell.fluctuations, opened])))
        return PeriodicProblem(problem, basis, cell.displacement(F), F)

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
class Basis:
    """Basis B (n, m) of the free unknowns z of a cell, and its products."""

    B: csc_array[np.float64]

    @property
    def size(self) -> int:
        """Number of free unknowns."""
        return int(self.B.shape[1])

    @cached_property
    def rows(self) -> csr_array[np.float64]:
        """B', (m, n)."""
        return csr_array(self.B.T)

    @cached_property
    def counts(self) -> Array:
        """Number of unknowns of each column, of a basis of zeros and ones, (m,)."""
        return np.asarray(self.B.sum(axis=0)).ravel()

    def coordinates(self, w: Array) -> Array:
        """Return z (m,) of unknowns w = B z, (n,), of a basis of zeros and ones."""
        return np.asarray(self.rows @ w) / self.counts

    def matrix(self, K: csc_array[np.float64]) -> csc_array[np.float64]:
        """Return B' K B, (m, m), with the same pattern for the same pattern of K."""
        if self._column is None:
            return csc_array(self.rows @ K @ self.B)
        pattern = self._patterns.get(K.nnz)
        if pattern is None or not pattern.fits(K):
            pattern = self._patterns[K.nnz] = _ReducedPattern.of(K, self._column, self.size)
        return pattern.matrix(K)

    def parts(self, fields: Sequence[Integers]) -> list[csr_array[np.float64]]:
        """Return the columns of B' at the unknowns of each field."""
        if not self._parts:
            self._parts.extend(csr_array(self.rows[:, field]) for field in fields)
        return self._parts

    @cached_property
    def _column(self) -> Integers | None:
        """Column of the entry of each row, -1 for none; None if there are other entries than 1."""
        by_row = csr_array(self.B)
        if (np.diff(by_row.indptr) > 1).any() or (by_row.data != 1.0).any():
            return None
        column: Integers = np.full(by_row.shape[0], -1, dtype=np.int64)
        column[np.diff(by_row.indptr) > 0] = by_row.indices
        return column

    @cached_property
    def _patterns(self) -> dict[int, _ReducedPattern]:
        return {}

    @cached_property
    def _parts(self) -> list[csr_array[np.float64]]:
        return []

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: without what only saves time."""
        return {"B": self.B}


@dataclass(frozen=True, eq=False)
class _ReducedPattern:
    """Pattern of B' K B for B of zeros and ones, and the positions of the entries of K in it.

    full: indptr and indices of K. mask: entries of K that are in it. positions: of these.
    """

    full: tuple[Small, Small]
    mask: Flags
    positions: Integers
    indptr: Small
    indices: Small

    @classmethod
    def of(cls, K: csc_array[np.float64], column: Integers, size: int) -> _ReducedPattern:
        """Of the pattern of K; column: (n,) of the entry of each row of B, -1 for none."""
        rows, columns = (
            column[K.indices],
            column[np.repeat(np.arange(K.shape[1]), np.diff(K.indptr))],
        )
        mask = (rows >= 0) & (columns >= 0)
        keys, positions = np.unique(columns[mask] * size + rows[mask], return_inverse=True)
        indptr = np.searchsorted(keys, size * np.arange(size + 1)).astype(np.int32)
        indices = (keys % max(size, 1)).astype(np.int32)
        return cls((K.indptr, K.indices), mask, positions, indptr, indices)

    def fits(self, K: csc_array[np.float64]) -> bool:
        """True if K has this pattern."""
        pairs = zip(self.full, (K.indptr, K.indices), strict=True)
        return all(a is b or np.array_equal(a, b) for a, b in pairs)

    def matrix(self, K: csc_array[np.float64]) -> csc_array[np.float64]:
        """B' K B."""
        entries: Any = np.bincount(self.positions, K.data[self.mask], len(self.indices))
        data: Array = entries.astype(np.float64, copy=False)  # integers where there are none
        size = len(self.indptr) - 1
        return csc_array((data, self.indices, self.indptr), shape=(size, size))


@dataclass(frozen=True, eq=False)
class PeriodicProblem:
    """Equations B' R(B z + c) = 0, as Newton's method sees them.

    base: c (n,). shift: the gradient (dim, dim) that c stands for.
    """

    problem: Problem
    basis: Basis
    base: Array
    shift: Array

    def full(self, z: Array) -> Array:
        """All unknowns, (n,)."""
        return np.asarray(self.basis.B @ z + self.base)

    def residual(self, z: Array) -> Array:
        """See `NonlinearProblem`."""
        x = self.full(z)
        r = self.problem.at(x).assembler.residual(x, self.problem.parameters)
        return np.asarray(self.basis.rows @ r)

    def linearise(self, z: Array) -> tuple[Array, csc_array[np.float64]]:
        """See `NonlinearProblem`."""
        x = self.full(z)
        r, K = self.problem.at(x).assembler.linearise(x, self.problem.parameters)
        return np.asarray(self.basis.rows @ r), self.basis.matrix(K)

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
        fields = self.problem.layout.fields
        for part, rows in zip(fields, self.basis.parts(fields), strict=True):
            balance = np.abs(np.asarray(rows @ r[part]))
            if rounded:
                balance = np.maximum(balance - np.asarray(abs(rows) @ noise[part]), 0.0)
            size = np.linalg.norm(forces[part])
            worst = max(worst, float(np.linalg.norm(balance) / size) if size > 0.0 else 0.0)
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
