"""Forces of supports, ties and springs, and the motion of rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import RigidBody
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.rotations import spin_by_rotation
from softehl.runtime.suggestions import join_names

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System
    from softehl.runtime.mesh.mesh import Predicate


def support_forces(problem: Problem, x: Array) -> Array:
    """Forces of supports, ties and springs, (n,), of the elements of this process."""
    blocks = problem.assembler.blocks
    holding = [b.name for b in blocks if isinstance(b.kernel, Spring | Tie)]
    other_parameters = {n: v for n, v in problem.parameters.items() if n not in holding}
    return problem.assembler.residual(x, other_parameters)


def reactions(
    system: System, forces: Array, where: str | Predicate | Sequence[float], x: Array
) -> dict[str, float]:
    """Sums of forces (n,) at a side, a node or a rigid body, by the name of the unknown.

    x: all unknowns.
    """
    rigids = rigid_bodies(system.everywhere)
    if isinstance(where, str) and where in rigids:
        return _rigid_reaction(system.everywhere, forces, where, x)
    if isinstance(where, str) or callable(where):
        nodes = system.mesh.nodes(where)
    else:
        nodes = system.mesh.nodes_at(np.asarray(where, dtype=np.float64))
    sums = {}
    for name, numbers in system.everywhere.numbering.nodal.items():
        dofs = numbers[nodes]
        sums[name] = system.comm.sum_at(forces, dofs[dofs >= 0])
    return sums


def _rigid_reaction(system: System, forces: Array, name: str, x: Array) -> dict[str, float]:
    """Force and moment on a rigid body, about axes that do not turn."""
    components, entries = motion_of(system, name, forces)
    if len(components) == 6 and rigid_bodies(system)[name].finite:
        theta = np.array(motion_of(system, name, x)[1][3:])
        moment = np.linalg.lstsq(spin_by_rotation(theta).T, np.array(entries[3:]))[0]
        entries = [*entries[:3], *moment.tolist()]
    return dict(zip(components, entries, strict=True))


def rigid_bodies(system: System) -> Mapping[str, RigidBody]:
    """Rigid bodies of the definition by name."""
    return {} if system.definition is None else system.definition.rigids


def motion_of(system: System, name: str, values: Array) -> tuple[tuple[str, ...], list[float]]:
    """Components of the motion of a rigid body and its entries of values (n,).

    Raises UnknownNameError.
    """
    rigids = rigid_bodies(system)
    if name not in rigids:
        raise UnknownNameError(f"no rigid body {name!r}; there are {join_names(rigids) or 'none'}")
    body, nodal = rigids[name], system.numbering.nodal
    numbers = [nodal[body.unknown(c)][body.node] for c in body.components]
    return body.components, [float(values[number]) for number in numbers]
