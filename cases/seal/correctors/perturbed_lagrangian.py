"""A tangent of a nearly incompressible solid that uses a lagged element pressure.

A small error of the displacements, as interpolation makes it, gives a volume ratio times a large
bulk modulus: useless pressures, and with them a useless geometric part of the tangent. Here that
part is taken at a pressure p_e of each element that follows from the step before,
p_e <- p(u) + kappa dJ. This is the linearisation of p_e = p(u), an equation of its own, with p_e
eliminated. The residual is that of the problem itself; when it has converged, so has the
tangent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.element_blocks import ElementBlock, ElementKernel
from softehl.runtime.discretisation.problem import Problem

_EDGES = np.array([[0, 1, 2, 3], [2, 3, 4, 5], [4, 5, 6, 7], [6, 7, 0, 1]])  # dofs of each edge
_UNIT = np.ones(1)
_MEAN_STRESS = ("sigma_zz", "sigma_rr", "sigma_tt")


def element_pressures(problem: Problem, solids: Sequence[str], x: Array) -> Array:
    """Mean stress (Q,) of the elements of the blocks `solids`, in order, positive in tension."""
    return np.concatenate([_pressures(problem.fields(solid, x)) for solid in solids])


def _pressures(fields: Mapping[str, Array]) -> Array:
    return np.asarray(sum(fields[name] for name in _MEAN_STRESS).mean(axis=1) / 3.0)  # type: ignore[union-attr]


@dataclass(frozen=True, eq=False)
class LaggedPressure:
    """A problem with lagged element pressures; satisfies the solvers' EvolvingProblem.

    solids: names of the blocks of 4-node elements. pressures: (Q,) p_e, in their order, tension
    positive. stiffness: (Q,) bulk moduli, or one for all. surface: a follower pressure on each edge
    of each element, whose virtual work at unit pressure is the variation of the element's volume.
    volumes: (Q,) in the reference state.
    """

    problem: Problem
    solids: tuple[str, ...]
    pressures: Array
    stiffness: Array | float
    surface: ElementBlock
    volumes: Array
    slots: Integers

    @classmethod
    def of(
        cls,
        problem: Problem,
        solids: tuple[str, ...],
        follower: ElementKernel,
        pressures: Array,
        kappa: Array | float,
    ) -> LaggedPressure:
        """The problem with these pressures; `follower` is the kernel of a pressure on an edge."""
        blocks = [problem.assembler.block(solid) for solid in solids]
        numbers = [problem.assembler.blocks.index(block) for block in blocks]
        scatter = np.concatenate(
            [problem.assembler.pattern.scatter[number].reshape(-1, 8, 8) for number in numbers]
        )
        coordinates = np.concatenate([block.coordinates for block in blocks])
        dofs = np.concatenate([block.dofs for block in blocks])
        surface = ElementBlock(
            "surface",
            follower,
            coordinates[:, _EDGES].reshape(-1, 4),
            dofs[:, _EDGES].reshape(-1, 4),
        )
        slots = scatter[:, _EDGES[:, :, None], _EDGES[:, None, :]]
        return cls(problem, solids, pressures, kappa, surface, _volumes(coordinates), slots)

    def residual(self, x: Array) -> Array:
        """See `Problem`."""
        return self.problem.residual(x)

    def norm(self, r: Array) -> float:
        """See `Problem`."""
        return self.problem.norm(r)

    def beyond_rounding(self, r: Array, x: Array, K: csc_array[np.float64]) -> float:
        """See `Problem`."""
        return self.problem.beyond_rounding(r, x, K)

    def step_limit(self, x: Array, dx: Array) -> float:
        """See `Problem`."""
        return self.problem.step_limit(x, dx)

    def name_of(self, number: int) -> str:
        """See `Problem`."""
        return self.problem.name_of(number)

    def where_not_finite(self, x: Array) -> str:
        """See `Problem`."""
        return self.problem.where_not_finite(x)

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """R(x), (n,), and the tangent with p_e in its geometric part, (n, n)."""
        excess = self.pressures - element_pressures(self.problem, self.solids, x)
        _, second = self.surface.tangent(x, _UNIT)
        weighted = np.repeat(excess, len(_EDGES))[:, None, None] * second
        nnz = self.problem.assembler.pattern.nnz
        addition = np.bincount(self.slots.ravel(), weighted.ravel(), nnz)
        return self.problem.linearise_with(x, np.asarray(addition, dtype=np.float64))

    def after(self, previous: Array, x: Array) -> LaggedPressure:
        """The problem with the pressures that a step from `previous` to x asks for."""
        first = self.surface.residual(previous, _UNIT)
        change = (first * (x - previous)[self.surface.dofs]).sum(axis=1)
        ratio = change.reshape(-1, len(_EDGES)).sum(axis=1) / self.volumes
        pressures = element_pressures(self.problem, self.solids, previous) + self.stiffness * ratio
        return replace(self, pressures=pressures)


def _volumes(coordinates: Array) -> Array:
    """Volumes (Q,) of the rings of 4-node elements (Q, 8), 2 pi R times the area, mm^3."""
    corners = coordinates.reshape(-1, 4, 2)
    d1, d2 = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = 0.5 * (d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0])
    return np.asarray(2.0 * np.pi * corners[:, :, 1].mean(axis=1) * area)
