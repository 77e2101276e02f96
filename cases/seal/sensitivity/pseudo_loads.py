"""Derivatives of a problem by its elements and parameters: pseudo-loads, gradients of fields.

A variation says of every block how the coordinates and data of its elements and its parameters
move, and how prescribed values do. With dq = q_x dx + q_v and K dx = -load(v), sensitivities follow
directly (one solve for each variation) or from the adjoint K^T l = q_x (one for each quantity).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import Kernel

Weights = Mapping[str, Array]
"""Field of a block -> (elements, points), what a quantity weights its values with."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """All that a problem is given besides its unknowns, or the rate of it.

    blocks: name of a block that is switched on -> (n, coordinates + data + parameters), the rows
    of its elements. values: (fixed,) prescribed values.
    """

    blocks: Mapping[str, Array]
    values: Array

    @classmethod
    def of(cls, problem: Problem) -> Inputs:
        """Inputs of a problem."""
        rows = {
            b.name: _rows(b, problem.parameters[b.name])
            for b in problem.assembler.blocks
            if b.name in problem.parameters
        }
        return cls(rows, problem.values)


def _rows(block: ElementBlock, parameters: Array) -> Array:
    n = len(block.dofs)
    width = kernel_of(block).nodes * len(kernel_of(block).coordinates)
    coordinates = np.reshape(block.coordinates, (n, -1))[:, :width]
    data = np.empty((n, 0)) if block.data is None else block.data
    return np.hstack([coordinates, data, np.broadcast_to(parameters, (n, len(parameters)))])


def rate_of(inputs: Callable[[float], Inputs], step: float, degree: int = 4) -> Inputs:
    """d inputs / ds at s = 0 by the central difference that is exact for polynomials of this
    degree, 2 or 4: then only rounding is left, however wide the step is. Inputs that do not move
    have no rate, to the last bit.
    """
    pairs = [(inputs(k * step), inputs(-k * step)) for k in (1, 2)[: degree // 2]]
    names = pairs[0][0].blocks
    blocks = {n: _slope([(a.blocks[n], b.blocks[n]) for a, b in pairs], step) for n in names}
    return Inputs(blocks, _slope([(a.values, b.values) for a, b in pairs], step))


def _slope(pairs: Sequence[tuple[Array, Array]], step: float) -> Array:
    """d/ds of values ahead and behind by a step, and by two steps if they are given."""
    rise, *wider = [ahead - backward for ahead, backward in pairs]
    for wide in wider:
        rise = (8.0 * rise - wide) / 6.0
    return np.asarray(rise / (2.0 * step))


def pseudo_load(problem: Problem, x: Array, rate: Inputs) -> Array:
    """(n,): the derivative of the equations at the unknowns x (n,) along a variation, x held.

    Blocks that do not move are not called.
    """
    load = np.zeros(problem.layout.total)
    for block in problem.assembler.blocks:
        moved = rate.blocks.get(block.name)
        if moved is None or not moved.any():
            continue
        kernel = kernel_of(block)
        local = kernel.pseudo_load(
            block.coordinates,
            x[block.dofs],
            moved,
            data=block.data,
            parameters=problem.parameters[block.name],
            rule=block.rule,
        )
        np.add.at(load, block.dofs.ravel(), local.ravel())
    return load


def kernel_of(block: ElementBlock) -> Kernel:
    """The kernel of a block.  TypeError where it is not one that was generated."""
    if not isinstance(block.kernel, Kernel):
        raise TypeError(f"block {block.name!r} has no generated kernel")
    return block.kernel


@dataclass(frozen=True, eq=False)
class FieldRates:
    """Derivatives of a block's fields, and of their weighted sums, at a state x (n,)."""

    problem: Problem
    name: str
    x: Array

    def along(self, rows: Array) -> dict[str, Array]:
        """Field -> (elements, points): its rate when elements and parameters move by rows, unknowns
        held.
        """
        no_change = np.zeros((len(rows), self._block.dofs.shape[1]))
        return self._rates(np.hstack([rows, no_change]))

    def by_unknowns(self, weights: Weights) -> Array:
        """Derivative (n,) of a weighted sum by all unknowns; elements without weight are left out.

        An element's fields depend on its own unknowns alone: one call for each of these.
        """
        block = self._block
        selected = np.flatnonzero(np.any([w.any(axis=1) for w in weights.values()], axis=0))
        data = None if block.data is None else block.data[selected]
        coordinates, dofs = block.coordinates[selected], block.dofs[selected]
        part = replace(block, coordinates=coordinates, dofs=dofs, data=data)
        some = {name: w[selected] for name, w in weights.items()}
        gradient = np.zeros(len(self.x))
        n, ndof = part.dofs.shape
        width = _rows(part, self.problem.parameters[self.name]).shape[1]
        for k in range(ndof):
            along = np.zeros((n, width + ndof))
            along[:, width + k] = 1.0
            np.add.at(gradient, part.dofs.T[k], weighted(self._rates(along, part), some))
        return gradient

    @property
    def _block(self) -> ElementBlock:
        return self.problem.assembler.block(self.name)

    def _rates(self, along: Array, block: ElementBlock | None = None) -> dict[str, Array]:
        block = block or self._block
        kernel = kernel_of(block)
        values = kernel.fields_rate(
            block.coordinates,
            self.x[block.dofs],
            along,
            data=block.data,
            parameters=self.problem.parameters[self.name],
            rule=block.rule,
        )
        return {name: values[:, :, i] for i, name in enumerate(kernel.fields)}


def weighted(rates: Mapping[str, Array], weights: Weights) -> Array:
    """(elements,) sums of the rates of fields (elements, points) over fields and points."""
    return np.asarray(sum((w * rates[name]).sum(axis=1) for name, w in weights.items()))


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent of a problem at a state x (n,), with the loads of variations."""

    problem: Problem
    x: Array
    full: csc_array[np.float64]
    reduced: csc_array[np.float64]

    @classmethod
    def at(cls, problem: Problem, x: Array) -> Tangent:
        """Assembled at x."""
        _, K = problem.assembler.linearise(x, problem.parameters)
        return cls(problem, x, K, problem.eliminated(K.copy()))

    def load(self, rate: Inputs) -> Array:
        """(n,): b of K dx = -b for a variation, that of prescribed values included."""
        fixed, b = self.problem.fixed, pseudo_load(self.problem, self.x, rate)
        if rate.values.any():
            moved = np.zeros(len(b))
            moved[fixed] = rate.values
            b += np.asarray(self.full @ moved)
        b[fixed] = -rate.values
        return b
