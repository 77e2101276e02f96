"""A nonlinear problem as the solvers see it: residual, tangent, norm and admissible steps.

A `Problem` never changes; a load step is another problem that shares blocks and pattern.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import Assembler
from softehl.runtime.fem.dofs import DofLayout


class Guard(Protocol):
    """Keeps the iterates of Newton's method in the set where the equations make sense."""

    def limit(self, x: Array, dx: Array) -> float:
        """Largest admissible fraction of the step dx from x, in (0, 1]."""
        ...


@dataclass(frozen=True, eq=False)
class StaysPositive:
    """Quantities x[dofs] + offsets, such as film thicknesses, may lose one `fraction` in a step."""

    dofs: Integers
    offsets: Array
    fraction: float = 0.9

    def limit(self, x: Array, dx: Array) -> float:
        """See `Guard`: the distance to the boundary, fraction of it at most."""
        value, change = x[self.dofs] + self.offsets, dx[self.dofs]
        falling = (change < 0.0) & (value > 0.0)
        if not falling.any():
            return 1.0
        return min(1.0, self.fraction * float(np.min(value[falling] / -change[falling])))


@dataclass(frozen=True, eq=False)
class KeepsOrientation:
    """Quadrilaterals must not turn inside out, nor radii negative: the step is halved until not.

    coordinates: (n, 8) reference (z, r) of the corners; dofs: (n, 8) their displacements.
    """

    coordinates: Array
    dofs: Integers
    halvings: int = 8

    def limit(self, x: Array, dx: Array) -> float:
        """See `Guard`."""
        corners, change = self.coordinates + x[self.dofs], dx[self.dofs]
        fraction = 1.0
        for _ in range(self.halvings):
            if self._admissible(corners + fraction * change):
                return fraction
            fraction *= 0.5
        return fraction

    def _admissible(self, corners: Array) -> bool:
        points = corners.reshape(-1, 4, 2)
        forward = np.roll(points, -1, axis=1) - points
        backward = np.roll(points, 1, axis=1) - points
        jacobian = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
        return bool(jacobian.min() > 0.0 and points[..., 1].min() > 0.0)


@dataclass(frozen=True, eq=False)
class Problem:
    """Assembled equations with prescribed unknowns; satisfies the solvers' NonlinearProblem.

    parameters: block name -> parameter array; a block that is not named is switched off.
    fixed, values: unknowns that are prescribed, and to what (same length). Their equations are
    x = value, and they are eliminated from the others.
    scales: field -> reference size of its residuals, one or one for each: a force (N), a flux
    (mm^2/s), a gap times area (mm^3); `norm` is then 1 for a residual of the size of the
    reference load.
    """

    assembler: Assembler
    layout: DofLayout
    parameters: Mapping[str, Array]
    scales: Mapping[str, float | Array]
    fixed: Integers = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    values: Array = field(default_factory=lambda: np.empty(0))
    guards: tuple[Guard, ...] = ()

    def residual(self, x: Array) -> Array:
        """R(x), (n,): internal minus external virtual work; x - value for prescribed unknowns."""
        r = self.assembler.residual(x, self.parameters)
        r[self.fixed] = x[self.fixed] - self.values
        return r

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """R(x), (n,), and K = dR/dx, (n, n), with prescribed unknowns eliminated.

        Where x does not yet have the prescribed values, their influence on the other equations
        is moved into R, so that -K^-1 R is the exact Newton step of the whole system.
        """
        return self.linearise_with(x, None)

    def linearise_with(
        self, x: Array, addition: Array | None
    ) -> tuple[Array, csc_array[np.float64]]:
        """As `linearise`, with `addition` (nnz,) to the entries of K before the elimination."""
        r, K = self.assembler.linearise(x, self.parameters)
        if addition is not None:
            K.data += addition
        defect = np.zeros_like(r)
        defect[self.fixed] = x[self.fixed] - self.values
        if defect.any():
            r = r - K @ defect
        r[self.fixed] = defect[self.fixed]
        return r, self._eliminate(K)

    def norm(self, r: Array) -> float:
        """Root of the sum over fields of |R / scale|^2, 2-norms."""
        parts = [
            np.linalg.norm(r[self.layout.part(name)] / scale) for name, scale in self.scales.items()
        ]
        return float(np.linalg.norm(parts))

    def scaled(self, r: Array) -> Array:
        """Residual (n,) over the reference size of its field; `norm` is the 2-norm of it."""
        result = np.zeros_like(r)
        for name, scale in self.scales.items():
            result[self.layout.part(name)] = r[self.layout.part(name)] / scale
        return result

    def step_limit(self, x: Array, dx: Array) -> float:
        """Largest fraction of the step that every guard admits."""
        return min((guard.limit(x, dx) for guard in self.guards), default=1.0)

    def with_parameters(self, **changes: Mapping[str, float] | None) -> Problem:
        """The problem with other parameters: block={name: value, ...}, or block=None to switch off.

        Parameters that are not named keep their value; a block that was off needs all of them.
        """
        parameters = dict(self.parameters)
        for name, values in changes.items():
            if values is None:
                parameters.pop(name, None)
            else:
                parameters[name] = self._changed(name, values)
        return replace(self, parameters=parameters)

    def with_fixed(self, fixed: Sequence[Integers], values: Sequence[Array | float]) -> Problem:
        """The problem with these unknowns prescribed, and no others; parts are joined."""
        full = [
            np.broadcast_to(np.asarray(v, dtype=np.float64), f.shape)
            for f, v in zip(fixed, values, strict=True)
        ]
        return replace(
            self,
            fixed=np.concatenate([np.empty(0, dtype=np.int64), *fixed]),
            values=np.concatenate([np.empty(0), *full]),
        )

    def fields(self, name: str, x: Array) -> dict[str, Array]:
        """Fields of a block that is switched on, at its points: name -> (n, points)."""
        return self.assembler.block(name).fields(x, self.parameters[name])

    def _changed(self, name: str, values: Mapping[str, float]) -> Array:
        names = self.assembler.block(name).kernel.parameters
        unknown = set(values) - set(names)
        if unknown:
            raise KeyError(f"block {name!r} has no parameter {', '.join(sorted(unknown))}")
        old = self.parameters.get(name)
        if old is None and set(values) != set(names):
            raise KeyError(f"block {name!r} is off: give all of {', '.join(names)}")
        before = np.zeros(len(names)) if old is None else old
        return np.array([values.get(n, b) for n, b in zip(names, before, strict=True)])

    def _eliminate(self, K: csc_array[np.float64]) -> csc_array[np.float64]:
        """K with the rows and columns of prescribed unknowns replaced by those of the identity."""
        if not len(self.fixed):
            return K
        K.data[self.assembler.cross(self.fixed)] = 0.0
        K.data[self.assembler.pattern.diagonal[self.fixed]] = 1.0
        return K
