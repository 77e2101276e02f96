"""The linearised equations of a converged step: its tangent, factors, and loads of variations."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.derivatives.elements import Elements
from softehl.runtime.derivatives.trail import Trail
from softehl.runtime.fem.loads import Spring, Tie
from softehl.runtime.solve.backends import choose

_SYMMETRIC = 1e-13  # of the largest entry: what rounding leaves of a symmetric tangent


class Linear:
    """R_x dx + R_p dp = 0 at a converged step, with dx of prescribed unknowns given."""

    def __init__(self, trail: Trail) -> None:
        self.trail = trail
        self.fixed: Integers = trail.problem.fixed
        self.blocks = {
            b.name: Elements(trail, b.name)
            for b in trail.problem.assembler.blocks
            if b.name in trail.problem.parameters
        }

    @cached_property
    def full(self) -> csc_array[np.float64]:
        """The tangent of all unknowns."""
        problem = self.trail.problem
        tangent: csc_array[np.float64] = problem.assembler.linearise(
            self.trail.x, problem.parameters
        )[1]
        return tangent

    @cached_property
    def _reduced(self) -> csc_array[np.float64]:
        reduced: csc_array[np.float64] = self.trail.problem.eliminated(self.full.copy())
        return reduced

    def solve(self, b: Array, held: Array) -> Array:
        """dx (n,) of -R_p dp = b, with the rates of prescribed unknowns in held (n,)."""
        right = b - self.full @ held if held.any() else b.copy()
        right[self.fixed] = held[self.fixed]
        return np.asarray(self._factors(transposed=False).solve(right))

    def adjoint(self, gradient: Array) -> Array:
        """l (n,) of K^T l = gradient, zero at prescribed unknowns."""
        right = gradient.copy()
        right[self.fixed] = 0.0
        return np.asarray(self._factors(transposed=True).solve(right))

    def reacting(self) -> set[str]:
        """Blocks whose forces make reactions: all but springs and ties."""
        return {
            name
            for name, elements in self.blocks.items()
            if not isinstance(elements.block.kernel, Spring | Tie)
        }

    def forces(self) -> Array:
        """Forces (n,) that make reactions."""
        found = self.trail.problem.assembler.residual(self.trail.x, self._others())
        return np.asarray(found)

    def by_unknowns(self, weights: Array) -> Array:
        """Derivative (n,) of weights (n,) times the forces that make reactions."""
        K = self.trail.problem.assembler.linearise(self.trail.x, self._others())[1]
        return np.asarray(K.T @ weights)

    def _others(self) -> dict[str, Array]:
        acting = self.reacting()
        return {n: v for n, v in self.trail.problem.parameters.items() if n in acting}

    def summed(self, parts: Mapping[str, Array]) -> Array:
        """(n,): the sums of residuals (elements, ndof) of blocks."""
        total = np.zeros(len(self.trail.x))
        for name, values in parts.items():
            np.add.at(total, self.blocks[name].block.dofs.ravel(), values.ravel())
        return total

    def _factors(self, *, transposed: bool) -> Any:
        memo = self.trail.memo
        if "symmetric" not in memo:
            K = self._reduced
            apart = abs(K - K.T)
            memo["symmetric"] = apart.max() <= _SYMMETRIC * abs(K).max()
        key = "transposed" if transposed and not memo["symmetric"] else "plain"
        if key not in memo:
            K = csc_array(self._reduced.T) if key == "transposed" else self._reduced
            memo[key] = choose("auto").factorise(K)
        return memo[key]
