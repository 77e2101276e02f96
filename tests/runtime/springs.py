"""A kernel in three lines of NumPy, for tests of assembly that must not depend on compiled C."""

from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Rule


@dataclass(frozen=True)
class Spring:
    """Unsymmetric nonlinear springs: r = stiffness * d * (A u + u^3), d constant in an element."""

    matrix: tuple[tuple[float, ...], ...] = ((2.0, -1.0, 0.5), (-1.5, 3.0, -1.0), (0.0, -1.0, 1.0))
    name: str = "spring"
    signature: str = "spring"
    parameters: tuple[str, ...] = ("stiffness", "unused")
    fields: tuple[str, ...] = ("stretch",)

    def residual(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """See ElementKernel."""
        scale = parameters[0] * (np.ones((len(dofs), 1)) if data is None else data)
        return np.asarray(scale * (dofs @ np.array(self.matrix).T + dofs**3))

    def tangent(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> tuple[Array, Array]:
        """See ElementKernel."""
        scale = parameters[0] * (np.ones((len(dofs), 1)) if data is None else data)
        diagonal = 3.0 * dofs[:, :, None] ** 2 * np.eye(dofs.shape[1])
        tangent = scale[:, :, None] * (np.array(self.matrix)[None] + diagonal)
        given = {"data": data, "parameters": parameters}
        return self.residual(coordinates, dofs, **given), np.asarray(tangent)  # type: ignore[arg-type]

    def fields_at(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """See ElementKernel."""
        return np.asarray(dofs[:, [0]] - dofs[:, [1]])[:, :, None]
