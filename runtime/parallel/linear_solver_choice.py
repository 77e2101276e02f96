"""Choice of the linear solver of one process by the size of the problem."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias, get_args

import numpy as np

from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.near_nullspace import is_vector, rigid_body_modes
from softehl.runtime.equations.system import System
from softehl.runtime.solve.linear import amg, pardiso
from softehl.runtime.solve.linear.amg import AlgebraicMultigrid, AmgOrDirect, NearNullspace
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.linear_solver import LinearSolver
from softehl.runtime.solve.linear.static_condensation import CondensingSolver
from softehl.runtime.suggestions import join_names

Linear: TypeAlias = Literal["auto", "direct", "superlu", "pardiso", "amg", "matrix-free"]

FACTORS_UP_TO = {1: np.inf, 2: 1e5, 3: 1e4}
"""Dimension -> unknowns up to which factors by SuperLU are the default.

Neo-Hookean bodies, seconds of factors by SuperLU, by PARDISO, and of multigrid with its solution:
3-D 15e3 unknowns 6.3, 1.4, 0.9; 53e3 73, 6.6, 3.1; 2-D 18e4 11, 2.2, 4.9.
"""
FALL_BACK_UP_TO = {1: np.inf, 2: 1e6, 3: 5e4}
"""Dimension -> unknowns up to which factors stand in for multigrid that fails: about 1.5 GB."""
_PARDISO = 5.0
"""Unknowns that PARDISO factorises where SuperLU, in the same time, factorises one."""


def linear_solver(system: System, linear: Linear) -> tuple[LinearSolver, Callable[[], str]]:
    """A linear solver of that name, and a function that says which and why where size decides.

    It condenses internal unknowns of elements. Raises StudyError for an unknown name or where
    multigrid cannot be used.
    """
    groups = internal_unknowns(system.assembler)
    solver, note = _of_rest(system, linear, system.size - sum(g.size for g in groups))
    return (CondensingSolver(solver, groups) if groups else solver), note


def internal_unknowns(assembler: Assembler) -> tuple[Integers, ...]:
    """Numbers (n, k) of the internal unknowns of each block that has some."""
    groups = [b.internal.values() for b in assembler.blocks if b.internal]
    return tuple(np.stack(list(numbers), axis=1) for numbers in groups)


def _of_rest(system: System, linear: Linear, count: int) -> tuple[LinearSolver, Callable[[], str]]:
    """A linear solver of so many unknowns, all but the internal ones."""
    if linear not in get_args(Linear):
        raise StudyError(f"linear = {linear!r}: allowed are {join_names(get_args(Linear))}")
    if linear in ("superlu", "pardiso"):
        return direct_solver(linear), str
    direct = direct_solver("auto")
    dimension, faster = system.mesh.dimension, _PARDISO if pardiso.available() else 1.0
    size = f"{count} unknowns in {dimension}-D"
    large = linear == "auto" and count > FACTORS_UP_TO[dimension] * faster
    if linear == "direct" or not (large or linear == "amg"):
        return direct, str
    modes = near_nullspace(system)
    if modes is None:
        why = "multigrid needs the components of one vector, or one scalar, as the only unknowns"
    elif not amg.available():
        why = "pyamg is not installed: pip install 'softehl[fast]'"
    elif linear == "amg":
        return AlgebraicMultigrid(modes), lambda: f"multigrid, {size}"
    else:
        borne = count <= FALL_BACK_UP_TO[dimension] * faster
        both = AmgOrDirect(AlgebraicMultigrid(modes), direct if borne else None)
        return both, lambda: f"{both.name}, because of {size}"
    if linear == "amg":
        raise StudyError(f'linear = "amg": {why}')
    return direct, lambda: f"factors by {direct.name} in spite of {size}: {why}"


def modes_by_multigrid(system: System, linear: Linear) -> NearNullspace | None:
    """Near null space if multigrid computes the natural modes; None if direct factors do."""
    large = linear == "auto" and system.size > FACTORS_UP_TO[system.mesh.dimension]
    if not (large or linear == "amg") or internal_unknowns(system.assembler) or not amg.available():
        return None
    return near_nullspace(system)


def near_nullspace(system: System) -> NearNullspace | None:
    """Rigid-body modes of displacements, or a constant; None for other unknowns at nodes.

    Internal unknowns of elements do not count.
    """
    nodal, layout = system.numbering.nodal, system.numbering.layout
    inner = {name for b in system.assembler.blocks for name in b.internal}
    names = [name for name in layout.names if name not in inner]
    if any(name not in nodal for name in names):
        return None
    if len(names) > 1 and not is_vector(names, system.mesh.dimension):
        return None
    external: Flags = np.ones(system.size, dtype=bool)
    for name in inner:
        external[layout.part(name)] = False
    rank = np.cumsum(external) - 1
    numbers = np.stack([nodal[name] for name in names], axis=1)
    complete = (numbers >= 0).all(axis=1)
    if numbers[complete].size != external.sum():
        return None
    nullspace = rigid_body_modes(system.mesh.points[complete], names)
    return NearNullspace(rank[numbers[complete]].ravel(), len(names), nullspace)
