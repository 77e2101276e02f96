"""A problem distributed over processes; all processes decide alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.constraints import Constraints, tie_dofs, tied_groups
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.problem_checks import (
    element_name,
    rows_not_finite,
    table_ends,
    unknown_name,
)
from softehl.runtime.discretisation.residual_norm import (
    ROUNDING,
    ResidualBalance,
    hides,
    is_far,
    residual_norm,
)
from softehl.runtime.mpi import world
from softehl.runtime.parallel.halo_exchange import HaloExchange, global_max, global_sum
from softehl.runtime.parallel.matshell import MatrixFreeShell
from softehl.runtime.parallel.partitioning import LocalSystem
from softehl.runtime.parallel.petsc_matrix import DistributedOperator, PetscMatrix, PetscSolver
from softehl.runtime.parallel.static_condensation import ExternalUnknowns
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.singularity_check import SINGULAR, random_signs, without_small_entries


@dataclass(eq=False)
class ParallelContext:
    """State of a process along a path: halo exchange, matrix, linear solver.

    tangent: of the latest set of prescribed unknowns. levels: of multigrid in the order, where the
    tangent is to be no matrix. outer: what PETSc has. reach, counts: see `Assembler`, of own
    unknowns.
    """

    part: LocalSystem
    exchange: HaloExchange
    outer: ExternalUnknowns
    interleaved: int
    solver: PetscSolver
    levels: MultigridLevels | None = None
    tangent: DistributedOperator | None = None
    reach: Array = field(default_factory=lambda: np.empty(0))
    counts: Array = field(default_factory=lambda: np.empty(0))

    def with_other_elements(self) -> ParallelContext:
        """For other elements on the same unknowns."""
        return ParallelContext(
            part=self.part,
            exchange=self.exchange,
            outer=self.outer,
            interleaved=self.interleaved,
            solver=replace(self.solver),
        )

    def tangent_of(self, problem: Problem) -> DistributedOperator:
        """The matrix for the prescribed unknowns of a problem, or a new shell."""
        tangent = self.tangent
        same = isinstance(tangent, PetscMatrix) and tangent.serves(problem.assembler, problem.fixed)
        if world().allreduce(int(not same)) or tangent is None:
            if tangent is not None:
                tangent.matrix.destroy()  # a shell and PETSc's matrix hold each other
            self.solver.reset()
            self.tangent = tangent = self._new(problem)
        return tangent

    def _new(self, problem: Problem) -> DistributedOperator:
        if self.levels is not None:
            return MatrixFreeShell(problem, self.levels, self.exchange)
        return PetscMatrix.of(
            problem.assembler,
            problem.fixed,
            exchange=self.exchange,
            outer=self.outer,
            block=self.interleaved,
        )


@dataclass(frozen=True, eq=False)
class DistributedFactors:
    """Matrix and solver of Newton's method on all processes."""

    tangent: DistributedOperator
    solver: PetscSolver

    def solve(self, r: Array) -> Array:
        """Local x, (m,), of own r, (k,)."""
        return self.tangent.solved(self.solver, r)

    def unconstrained_unknown(self) -> int | None:
        """See `JudgesSingularity`: PETSc's number, for a direct solver alone."""
        if not self.solver.direct:
            return None
        exchange = self.tangent.exchange
        try:
            y = self.solve(random_signs(len(exchange.owned), world().rank))[exchange.owned]
        except SingularMatrix:
            return None
        largest_entry = float(global_max(np.abs(y).max(initial=0.0)))
        y = without_small_entries(y, largest_entry)
        resisted = np.abs(self.tangent.times(y)) > SINGULAR * self.tangent.times_magnitudes(
            np.abs(y)
        )
        if world().allreduce(int(resisted.any())):
            return None
        candidates = exchange.numbers[exchange.owned[np.abs(y) >= largest_entry]]
        number: int = max(world().allgather(int(candidates.max(initial=-1))))
        return number


@dataclass(frozen=True)
class DistributedSolver:
    """Linear solver of distributed problems: that of PETSc."""

    name: str = "petsc"

    def factorise(self, K: Any) -> DistributedFactors:
        """The matrix itself, which can solve."""
        assert isinstance(K, DistributedFactors)
        return K


@dataclass(frozen=True, eq=False)
class DistributedProblem:
    """Local part of a distributed problem.  Vectors x are local, (m,); r is
    that of own unknowns, (k,).  Every method is called by all processes alike.
    """

    problem: Problem
    team: ParallelContext

    @property
    def assembler(self) -> Any:
        """Of the elements of this process."""
        return self.problem.assembler

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See `Problem`."""
        return self.problem.parameters

    def fields(self, name: str, x: Array) -> dict[str, Array]:
        """Fields of a block at the points of this process's elements."""
        return self.problem.fields(name, x)

    def at(self, x: Array) -> Any:
        """See `Problem`: it has no elements that are sought."""
        return self

    def residual(self, x: Array) -> Array:
        """See the class."""
        r = self.team.exchange.added(self.problem.assembler.residual(x, self.parameters))
        return self._prescribed(r, self.problem.constraints.deviation(x))

    def linearise(self, x: Array) -> tuple[Array, DistributedFactors]:
        """Residual with the influence of prescribed unknowns moved into it, and the tangent."""
        tangent = self.team.tangent_of(self.problem)
        defect = self.problem.constraints.deviation(x)
        r = tangent.fill(
            self.problem.assembler,
            x,
            self.parameters,
            defect=defect,
            times=self.team.solver.times,
        )
        r = self._prescribed(self.team.exchange.added(r), defect)
        return r, DistributedFactors(tangent, self.team.solver)

    def norm(self, r: Array) -> float:
        """Never asked: the problem measures its residuals itself."""
        raise NotImplementedError

    def step_limit(self, x: Array, dx: Array) -> float:
        """Problems of studies have no guards."""
        return 1.0

    def measure(self, x: Array, K: DistributedFactors | None, *, rounded: bool = False) -> float:
        """See `Problem.measure`: the same sums, over all processes."""
        owned, exchange, problem = self.team.part.owned, self.team.exchange, self.problem
        sums = problem.assembler.residual_and_size(x, self.parameters)
        r, forces = exchange.added(sums[0]), exchange.added(sums[1])
        if global_sum(np.array([float(not np.isfinite(r).all())]))[0]:
            return float("inf")
        noise, terms = np.zeros(len(owned)), np.zeros(len(owned))
        if K is not None:
            if self._is_lost(x, forces, K):
                return 1.0
            terms = self._terms(np.abs(x)[owned], K)
            if rounded:
                noise = ROUNDING * self._terms(np.abs(x)[owned] + self._reach(), K)
        target, prescribed = problem.constraints.admissible(x), self._owned.prescribed
        defect = np.maximum(np.abs(r) - noise, 0.0) * ~prescribed
        deviation, extent = (x - target)[owned], np.maximum(np.abs(x), np.abs(target))[owned]
        met = prescribed | (self._counts() > 1)
        balance = ResidualBalance(defect, forces, terms, met, deviation, extent)
        return residual_norm(
            global_sum(balance.squares(self._fields())), global_max(balance.worst())
        )

    def name_of(self, number: int) -> str:
        """An unknown for messages, by PETSc's number."""
        exchange, part = self.team.exchange, self.team.part
        local = np.flatnonzero(exchange.numbers == number)
        message = ""
        if len(local):
            layout = self.problem.layout
            field_name = next(n for n in layout.names if local[0] < layout.part(n).stop)
            system, n = part.system.everywhere, int(part.unknowns[local[0]])
            element = unknown_name(system.assembler.blocks, n)
            message = f"unknown {n} of field {field_name!r}{element}"
        return _first(message)

    def where_not_finite(self, x: Array) -> str:
        """The first element of any process whose residual or tangent is not finite."""
        part, message = self.team.part, ""
        for block in self.problem.assembler.blocks:
            results = block.tangent(x, self.parameters[block.name])
            rows = rows_not_finite(results)
            if len(rows) and not message and block.name in part.elements:
                global_block = part.system.everywhere.assembler.block(block.name)
                message = element_name(global_block, int(part.elements[block.name][rows[0]]))
                message += table_ends(block, x, self.parameters[block.name])
        return _first(message)

    @cached_property
    def _owned(self) -> Constraints:
        """Constraints of own unknowns."""
        return self.problem.constraints.restricted(self.team.part.owned)

    def _prescribed(self, r: Array, deviation: Array) -> Array:
        return self._owned.residual(r, deviation[self.team.part.owned])

    def _reach(self) -> Array:
        team = self.team
        if not len(team.reach):
            team.reach = team.exchange.highest(self.problem.assembler.reach())
        return team.reach

    def _counts(self) -> Array:
        team = self.team
        if not len(team.counts):
            counts = self.problem.assembler.counts(self.parameters)
            team.counts = team.exchange.added(counts.astype(np.float64))
        return team.counts

    def _terms(self, magnitudes: Array, K: DistributedFactors) -> Array:
        """See `Problem`; magnitudes and sums of own unknowns, (k,)."""
        exchange, problem = self.team.exchange, self.problem
        root = np.sqrt(K.tangent.diagonal())
        root[self._owned.prescribed] = 0.0
        local = exchange.copied(root * magnitudes)
        around = exchange.added(problem.assembler.around(local, self.parameters))
        return K.tangent.times_magnitudes(magnitudes) + root * around

    def _is_lost(self, x: Array, forces: Array, K: DistributedFactors) -> bool:
        """See `Problem`."""
        reach = self._reach()
        values = np.abs(self.problem.values).max(initial=0.0)
        reference = global_max(max(float(reach.max(initial=0.0)), float(values)))
        if not is_far(global_max(float(np.abs(x).max(initial=0.0))), reference):
            return False
        noise = ROUNDING * K.tangent.times_magnitudes(np.abs(x)[self.team.part.owned] + reach)
        norms = np.sqrt(global_sum(np.array([noise @ noise, forces @ forces])))
        return hides(*norms.tolist())

    def _fields(self) -> list[Integers]:
        """For each field the places of its unknowns among own ones."""
        owned = self.team.part.owned
        return [np.flatnonzero(np.isin(owned, numbers)) for numbers in self.problem.layout.fields]


def distributed_constraints(
    problem: Problem, part: LocalSystem, exchange: HaloExchange
) -> Constraints:
    """Constraints of the part of a process, with z of all processes.

    An unknown of a group moves only where all of the group do, on any process.
    """
    constraints = problem.constraints
    first = _exchange_of_groups(part, exchange)
    mask = first.highest((~constraints.free).astype(np.float64)) == 0.0
    numbers, starts = first.renumbered(mask)
    free = numbers >= 0
    owned = np.searchsorted(np.flatnonzero(free), first.owned[mask])
    return replace(constraints, free=free, exchange=HaloExchange.of(numbers[free], owned, starts))


def _exchange_of_groups(part: LocalSystem, exchange: HaloExchange) -> HaloExchange:
    """The exchange of a part in which each unknown is the first of those that it is tied to."""
    global_system = part.system.everywhere
    ties = tie_dofs(global_system.assembler)
    if not len(ties):
        return exchange
    first = tied_groups(ties[:, 0], ties[:, 1], global_system.size)
    numbers = _all_numbers(global_system.size, part, exchange)
    is_master = first[part.unknowns[part.owned]] == part.unknowns[part.owned]
    starts = np.concatenate([[0], np.cumsum(world().allgather(len(part.owned)))])
    return HaloExchange.of(numbers[first[part.unknowns]], part.owned[is_master], starts)


def _all_numbers(size: int, part: LocalSystem, exchange: HaloExchange) -> Integers:
    """PETSc's number of each unknown of the global system."""
    result = np.zeros(size, dtype=np.int64)
    owned = part.unknowns[part.owned], exchange.numbers[part.owned]
    for unknowns, numbers in world().allgather(owned):
        result[unknowns] = numbers
    return result


def _first(message: str) -> str:
    """Message of the first process that has one."""
    return next((w for w in world().allgather(message) if w), "")
