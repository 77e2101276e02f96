"""A state of a body in motion, and its energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array
from softehl.runtime.fem.loads import DeadLoad, NodalForce, Pressure, Spring, Tie
from softehl.runtime.fem.mass import Mass
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import Kernel
from softehl.runtime.names import listed, meant
from softehl.runtime.result import Result
from softehl.runtime.share import Share

_EMPTY = np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Result):
    """A result with velocities and accelerations.

    v, a: (n,), zero where an unknown has no mass. energy: "kinetic", "internal" (energies of pages
    and springs; of a page without one the work of its forces), "external" (the work of loads,
    pressures and moving supports) and "balance", what kinetic and internal energy have gained above
    that since the march began: zero but for the error of the scheme, and what it damps.
    stable_step: of the explicit scheme.
    """

    v: Array = field(default_factory=lambda: _EMPTY)
    a: Array = field(default_factory=lambda: _EMPTY)
    energy: Mapping[str, float] = field(default_factory=dict)
    stable_step: float = float("nan")

    def velocity(self, name: str) -> Array:
        """Of an unknown at every node, (points,), nan where there is none."""
        return self._nodal(name, self.v)

    def acceleration(self, name: str) -> Array:
        """Likewise."""
        return self._nodal(name, self.a)

    def _nodal(self, name: str, values: Array) -> Array:
        nodal, values = self._whole.numbering.nodal, self.system.share.whole(values)
        if name not in nodal:
            raise UnknownNameError(
                f"no unknown {name!r}{meant(name, nodal)}; at nodes: {listed(nodal)}"
            )
        return np.where(nodal[name] >= 0, values[nodal[name]], np.nan)


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces on all unknowns, (n,) each: of loads, of what has an energy, and of all else.

    Where they are spread over processes, what the elements of this one add.
    """

    loads: Array
    stored: Array
    others: Array

    @classmethod
    def of(cls, problem: Problem, x: Array) -> Forces:
        """Without inertia given by densities, without ties."""
        parts = [np.zeros(problem.assembler.size) for _ in range(3)]
        for block in problem.assembler.blocks:
            if block.name not in problem.parameters or isinstance(block.kernel, Mass | Tie):
                continue
            kernel = getattr(block.kernel, "kernel", block.kernel)  # an averaged one
            group = 2
            if isinstance(kernel, DeadLoad | NodalForce | Pressure):
                group = 0
            elif has_energy(kernel):
                group = 1
            local = block.residual(x, problem.parameters[block.name])
            np.add.at(parts[group], block.dofs.ravel(), local.ravel())
        return cls(*parts)

    @property
    def total(self) -> Array:
        """Sum of all."""
        return self.loads + self.stored + self.others


def has_energy(kernel: object) -> bool:
    """True for a spring, and for a page with an energy of the present state alone."""
    if isinstance(kernel, Spring):
        return True
    if not isinstance(kernel, Kernel):
        return False
    timed = {"rate", "acceleration"} & set(kernel.parameters)
    return "energy" in kernel.tasks and not timed and not kernel.history


def stored_energy(problem: Problem, x: Array) -> float:
    """Energies of springs and pages of this process at unknowns x, (n,)."""
    found = 0.0
    for block in problem.assembler.blocks:
        kernel, u = block.kernel, x[block.dofs]
        if isinstance(kernel, Spring):
            found += float(0.5 * kernel.stiffness * np.sum(u**2))
        elif isinstance(kernel, Kernel) and has_energy(kernel):
            given = block.given(problem.parameters[block.name])
            values = kernel.energy(block.coordinates, np.ascontiguousarray(u), **given)
            found += float(values.sum())
    return found


@dataclass
class Ledger:
    """Energies of a march: work of loads and of forces without an energy, since the beginning.

    share: of the processes, of which each knows the work of its elements.
    """

    share: Share
    first: float = float("nan")
    external: float = 0.0
    others: float = 0.0

    def add(self, forces: Forces, supports: Array, moved: Array) -> None:
        """Work of forces, mean of a step, and of supports (n,), as the unknowns moved (n,)."""
        self.external += float((supports - forces.loads) @ moved)
        self.others += float(forces.others @ moved)

    def told(self, kinetic: float, stored: float) -> dict[str, float]:
        """Energies now, of all processes."""
        known = np.array([kinetic, stored, self.external, self.others])
        kinetic, stored, external, others = self.share.total(known).tolist()
        internal = stored + others
        if np.isnan(self.first):
            self.first = kinetic + internal
        balance = kinetic + internal - self.first - external
        return {
            **{"kinetic": kinetic, "internal": internal},
            **{"external": external, "balance": balance},
        }
