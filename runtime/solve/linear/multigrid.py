"""Multigrid as a preconditioner: Chebyshev smoothing on every level, any solver on the coarsest.

Every level but the coarsest knows its operator as a function, its diagonal and the interpolation
from the next one. A cycle is symmetric, and so fit for conjugate gradients. Vectors are arrays of
NumPy, or of CuPy, which follows NumPy's functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array

Apply = Callable[[Array], Array]

DEGREE = 3
"""Products in one smoothing."""
RANGE = 20.0
"""Part of the largest eigenvalue down to which eigenvalues are smoothed. Of degrees 2 to 8 and
ranges 10 to 40, these need at most 10 % more products than the best, for nu = 0.3 to 0.499.
"""
_POWERS = 12  # products for an estimate of the largest eigenvalue, which is then raised by a tenth


@dataclass(frozen=True, eq=False)
class MultigridLevel:
    """An operator with the inverse of its diagonal, (n,), interpolation (n, m) and restriction.

    top: largest eigenvalue of the operator over its diagonal. Arrays are of NumPy or of CuPy.
    """

    apply: Apply
    inverse: Array
    interpolation: csr_array
    restriction: csr_array
    top: float

    @classmethod
    def of(
        cls,
        apply: Apply,
        diagonal: Array,
        interpolation: csr_array,
        restriction: csr_array | None = None,
        start: Array | None = None,
    ) -> MultigridLevel:
        """With an estimate of the largest eigenvalue from a random vector `start`."""
        if restriction is None:
            restriction = csr_array(interpolation.T)
        if start is None:
            start = np.random.default_rng(0).uniform(-1.0, 1.0, len(diagonal))
        safe = np.where(diagonal > 0.0, diagonal, 1.0)
        top = 1.1 * largest_eigenvalue(apply, safe, start)
        return cls(apply, 1.0 / safe, interpolation, restriction, top)

    def smooth(self, b: Array, x: Array | None) -> Array:
        """x after a smoothing of A x = b; None: from zero, which spares a product."""
        centre = 0.5 * self.top * (1.0 + 1.0 / RANGE)
        half = 0.5 * self.top * (1.0 - 1.0 / RANGE)
        r = b.copy() if x is None else b - self.apply(x)
        step = self.inverse * r
        step /= centre
        x = step.copy() if x is None else x + step
        rho, scaled = half / centre, np.empty_like(r)
        for _ in range(DEGREE - 1):
            r -= self.apply(step)
            next_rho = 1.0 / (2.0 * centre / half - rho)
            np.multiply(self.inverse, r, out=scaled)
            scaled *= 2.0 * next_rho / half
            step *= next_rho * rho
            step += scaled
            rho = next_rho
            x += step
        return x


@dataclass(frozen=True, eq=False)
class MultigridCycle:
    """Levels, the finest first, and a solver of the coarsest."""

    levels: Sequence[MultigridLevel]
    coarsest: Apply

    def __call__(self, b: Array) -> Array:
        """One cycle for A x = b from zero."""
        return self._cycle(b, 0)

    def _cycle(self, b: Array, k: int) -> Array:
        if k == len(self.levels):
            return self.coarsest(b)
        level = self.levels[k]
        x = level.smooth(b, None)
        r = level.restriction @ (b - level.apply(x))
        x = x + level.interpolation @ self._cycle(r, k + 1)
        return level.smooth(b, x)


def largest_eigenvalue(apply: Apply, diagonal: Array, start: Array) -> float:
    """Largest eigenvalue of an operator over its diagonal, estimated by Lanczos' method."""
    root = 1.0 / np.sqrt(diagonal)
    v = start / float(np.linalg.norm(start))
    previous, beta = np.zeros_like(v), 0.0
    alphas, betas = [], []
    for _ in range(_POWERS):
        w = root * apply(root * v) - beta * previous
        alphas.append(float(w @ v))
        w -= alphas[-1] * v
        beta = float(np.linalg.norm(w))
        if not beta > 1e-12 * abs(alphas[0]):
            break
        betas.append(beta)
        previous, v = v, w / beta
    size = len(alphas)
    T = np.diag(alphas) + np.diag(betas[: size - 1], 1) + np.diag(betas[: size - 1], -1)
    return float(np.abs(np.linalg.eigvalsh(T)).max())
