"""The linearised equations of a converged step: its tangent, factors, and loads of variations."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.sensitivity.element_derivatives import ElementDerivatives
from softehl.runtime.sensitivity.tape import Tape, WithoutMatrix
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.linear_solver import Factorisation, Factors, SingularMatrix

_EXACT, _ROUNDING = 1e-15, 1e-14
"""Errors of an equation relative to its terms: nothing is left, and only rounding can be left."""
_TINY = 1e-30  # of the largest entry on the right: equations of zeros are exact
_SYMMETRIC = 1e-13  # of the largest entry: what rounding leaves of a symmetric tangent


class LinearisedStep:
    """R_x dx + R_p dp = 0 at a converged step, with dx of prescribed unknowns given."""

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        self.fixed: Integers = tape.problem.fixed
        self.blocks = {
            b.name: ElementDerivatives(tape, b.name)
            for b in tape.problem.assembler.blocks
            if b.name in tape.problem.parameters
        }

    @cached_property
    def full(self) -> csc_array[np.float64]:
        """The tangent of all unknowns."""
        problem = self.tape.problem
        tangent: csc_array[np.float64] = problem.assembler.linearise(
            self.tape.x, problem.parameters
        )[1]
        return tangent

    @cached_property
    def _reduced(self) -> Any:
        """The tangent that is solved with: a matrix, or products."""
        distributed = self.tape.distributed_problem
        if isinstance(distributed, WithoutMatrix):
            return distributed.linearise(self.tape.x)[1]
        return self.tape.problem.eliminated(self.full.copy())

    def solve(self, b: Array, prescribed_rates: Array) -> Array:
        """dx (n,) of -R_p dp = b, with the rates of prescribed unknowns in held (n,)."""
        right = b - self._times(prescribed_rates) if prescribed_rates.any() else b.copy()
        right[self.fixed] = prescribed_rates[self.fixed]
        return self._solved(right, transposed=False)

    def _times(self, v: Array) -> Array:
        """The tangent of all unknowns times v, (n,)."""
        product = self._reduced.times(v) if self._without_matrix else self.full @ v
        return np.asarray(product)

    def transposed_times(self, v: Array) -> Array:
        """The transpose of the tangent of all unknowns times v, (n,)."""
        return self._times(v) if self._without_matrix else np.asarray(self.full.T @ v)

    @property
    def _without_matrix(self) -> bool:
        return isinstance(self.tape.distributed_problem, WithoutMatrix)

    def adjoint(self, gradient: Array) -> Array:
        """l (n,) of K^T l = gradient, zero at prescribed unknowns."""
        right = gradient.copy()
        right[self.fixed] = 0.0
        return self._solved(right, transposed=True)

    def reacting(self) -> set[str]:
        """Blocks whose forces make reactions: all but springs and ties."""
        return {
            name
            for name, elements in self.blocks.items()
            if not isinstance(elements.block.kernel, Spring | Tie)
        }

    def forces(self) -> Array:
        """Forces (n,) that make reactions."""
        residual = self.tape.problem.assembler.residual(self.tape.x, self._others())
        return np.asarray(residual)

    def by_unknowns(self, weights: Array) -> Array:
        """Derivative (n,) of weights (n,) times the forces that make reactions."""
        gradient, none = np.zeros(len(weights)), np.empty(0, dtype=np.int64)
        for name, parameters in self._others().items():
            for piece, _ in self.blocks[name].block.pieces(none):
                K = piece.tangent(self.tape.x, parameters)[1]
                np.add.at(gradient, piece.dofs, np.einsum("nij,ni->nj", K, weights[piece.dofs]))
        return gradient

    def _others(self) -> dict[str, Array]:
        acting = self.reacting()
        return {n: v for n, v in self.tape.problem.parameters.items() if n in acting}

    def summed(self, parts: Mapping[str, Array]) -> Array:
        """(n,): the sums of residuals (elements, ndof) of blocks."""
        total = np.zeros(len(self.tape.x))
        for name, values in parts.items():
            np.add.at(total, self.blocks[name].block.dofs.ravel(), values.ravel())
        return total

    def _solved(self, b: Array, *, transposed: bool) -> Array:
        """By factors of this tangent, or by those of the last iteration if they are near enough; by
        iterations where the path was solved so.
        """
        memo, memory = self.tape.memo, self.tape.last_factors
        turned = transposed and not self._symmetric
        if self._without_matrix or self.tape.linear is not None:
            return self._iterated(b, turned=turned)
        key = "transposed" if turned else "plain"
        if key not in memo:
            K = csc_array(self._reduced.T) if turned else self._reduced
            last = None if memory is None or memory.last is None else memory.last[1]
            factors = _turned(last) if turned else last
            solution = None if factors is None else refined(factors, K, b)
            if solution is not None:
                return solution
            plain = _turned(memo.get("plain")) if turned else None
            memo[key] = plain or direct_solver("auto").factorise(K)
        return np.asarray(memo[key].solve(b))

    def _iterated(self, b: Array, *, turned: bool) -> Array:
        """Without factors.  Raises StudyError where that does not work."""
        memo, key, K = self.tape.memo, "turned" if turned else "straight", self._reduced
        linear = self.tape.linear
        if turned and linear is None:
            raise StudyError(
                'derivatives after linear="matrix-free" need a symmetric tangent, this one is not: '
                'solve with linear="amg" or linear="direct"'
            )
        K = csc_array(K.T) if turned else K
        if key not in memo:
            memo[key] = K if linear is None else linear.factorise(K)
        solution = refined(memo[key], K, b, self.fixed)
        if solution is None:
            raise StudyError(
                'the iterations for derivatives do not converge: solve with linear="direct"'
            )
        return solution

    @property
    def _symmetric(self) -> bool:
        memo, K = self.tape.memo, self._reduced
        if "symmetric" not in memo:
            memo["symmetric"] = (
                K.is_symmetric()
                if self._without_matrix
                else abs(K - K.T).max() <= _SYMMETRIC * abs(K).max()
            )
        return bool(memo["symmetric"])


def _turned(factors: Factors | None) -> Factors | None:
    """Factors of the transpose by those of a matrix, None where they cannot be used so."""
    return factors.transposed() if isinstance(factors, Factorisation) else None


def refined(factors: Factors, K: Any, b: Array, fixed: Integers | None = None) -> Array | None:
    """x (n,) of K x = b by factors of a matrix near K; None where they are not near enough.

    fixed: unknowns with rows of the unit matrix, in which iterations leave errors of their own.

    Each correction must make the error of the equations a tenth, until rounding is left: relative
    to the terms of each, as after a factorisation of K itself.
    """
    if not b.any():
        return np.zeros_like(b)
    sizes, x, previous_error = abs(K), np.zeros_like(b), np.inf
    scale = _TINY * float(np.abs(b).max(initial=0.0))
    try:
        while True:
            r = b - K @ x
            error = float((np.abs(r) / (sizes @ np.abs(x) + np.abs(b) + scale)).max(initial=0.0))
            if error <= _EXACT:
                return x
            if not error < 0.1 * previous_error:
                return x if error <= _ROUNDING else None
            x, previous_error = x + factors.solve(r), error
            if fixed is not None:
                x[fixed] = b[fixed]
    except SingularMatrix:
        return None
