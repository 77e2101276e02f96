"""Discrete gradient: mean forces along a step, whose work is the change of the energy.

The mean-value discrete gradient (Harten, Lax and van Leer; "average vector field"):

    f = integral from 0 to 1 of f(u0 + s (u - u0)) ds ,  f . (u - u0) = W(u) - W(u0) ,

by Gauss's rule of three points: exact for energies of sixth degree in u, and so good for others
that the error of the energy is of the seventh order in the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import roots_legendre

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.element_blocks import ElementBlock

POINTS = 3
"""The energy of a beam of neo-Hooke that swings by a sixth of its length is constant to 3e-9 over
ten periods of 40 steps; with two points to 1e-6, and a step costs little less."""


@dataclass(frozen=True, eq=False)
class DiscreteGradientKernel:
    """A kernel at the points of a step from unknowns `old`, which are the last columns of its data.

    timed: (number of a parameter, columns of data, unknowns that they belong to): coefficient c and
    rest r of time derivatives c u + r, which are constant in a step. length: number of the
    parameter that is the length of the step, None where there is none. multipliers: columns of
    unknowns that are one number in a step, and whose equations hold at its end.
    """

    kernel: Any
    timed: tuple[tuple[int, Integers, Integers], ...] = ()
    length: int | None = None
    multipliers: Integers = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __getattr__(self, name: str) -> Any:
        """Everything else, names above all, is the kernel's."""
        if name == "kernel":
            raise AttributeError(name)
        return getattr(self.kernel, name)

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Mean of the residuals (n, ndof)."""
        forces = np.zeros(dofs.shape)
        for _, weight, at, values in self._points(dofs, kwargs):
            forces += weight * self.kernel.residual(coordinates, at, **values)
        if (columns := self.multipliers).size:
            end = self.kernel.residual(coordinates, dofs, **self._end(dofs, kwargs))
            forces[:, columns] = end[:, columns]
        return forces

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Means of residuals and of their derivatives by the unknowns at the end."""
        forces, tangents = np.zeros(dofs.shape), np.zeros((*dofs.shape, dofs.shape[1]))
        for s, weight, at, values in self._points(dofs, kwargs):
            r, K = self.kernel.tangent(coordinates, at, **values)
            forces += weight * r
            moving = np.full(dofs.shape[1], weight * s)
            moving[self.multipliers] = weight
            tangents += moving * K
        if (columns := self.multipliers).size:
            r, K = self.kernel.tangent(coordinates, dofs, **self._end(dofs, kwargs))
            forces[:, columns], tangents[:, columns] = r[:, columns], K[:, columns]
        return forces, tangents

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """None, (n, 0, 0): fields belong to states."""
        return np.empty((len(dofs), 0, 0))

    def _end(self, dofs: Array, kwargs: dict[str, Any]) -> dict[str, Any]:
        """Arguments at the end of the step."""
        kernel_data = kwargs["data"][:, : -dofs.shape[1]]
        return {
            **kwargs,
            "data": np.ascontiguousarray(kernel_data) if kernel_data.shape[1] else None,
        }

    def _points(self, dofs: Array, kwargs: dict[str, Any]) -> Any:
        """Place along the step, weight, unknowns and other arguments at each point."""
        kernel_data, old = np.split(kwargs["data"], [-dofs.shape[1]], axis=1)
        for xi, weight in zip(*roots_legendre(POINTS), strict=True):
            s = 0.5 * (1.0 + xi)
            data, parameters = kernel_data.copy(), kwargs["parameters"].copy()
            for number, columns, unknowns in self.timed:
                # (c / s) u(s) + r' is c u + r for every s
                data[:, columns] -= parameters[number] * (1.0 / s - 1.0) * old[:, unknowns]
                parameters[number] /= s
            if self.length is not None:
                parameters[self.length] *= s
            data_or_none = data if data.shape[1] else None
            at = np.ascontiguousarray(old + s * (dofs - old))
            at[:, self.multipliers] = dofs[:, self.multipliers]
            yield s, 0.5 * weight, at, {**kwargs, "data": data_or_none, "parameters": parameters}


def with_old(block: ElementBlock, old: Array) -> ElementBlock:
    """A block of an averaged kernel in the step from unknowns (n,)."""
    columns = old[block.dofs]
    data = columns if block.data is None else np.concatenate([block.data, columns], axis=1)
    return replace(block, data=np.ascontiguousarray(data))


def time_derivatives(
    kernel: Any, filled: Sequence[tuple[str, dict[str, int]]]
) -> tuple[tuple[int, Integers, Integers], ...]:
    """See `timed` of the kernel: of parameters, with a table from data to unknowns each."""
    derivatives = []
    for parameter, table in filled:
        if parameter in kernel.parameters:
            columns = [k for k, name in enumerate(kernel.data) if name in table]
            unknowns = [table[kernel.data[k]] for k in columns]
            derivatives.append(
                (kernel.parameters.index(parameter), np.array(columns), np.array(unknowns))
            )
    return tuple(derivatives)
