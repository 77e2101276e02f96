"""Kernel of a body whose stress comes from a model in Python: a unit cell at every point.

The page `linearised_stress` has stress, displacement gradient and moduli as data of its points. The
kernel evaluates the deformation gradient at the points, asks the model for stress and moduli, and
gives them to the page. Data of the points of its block are the states of the model.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from hashlib import sha256
from typing import Any, Protocol, Self

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.kernel_call import Rule


class PointState(Protocol):
    """State of a unit cell at a point of a body; see `Homogenised`."""

    @property
    def F(self) -> Array:
        """Mean deformation gradient (dim, dim)."""
        ...

    @property
    def P(self) -> Array:
        """Mean first Piola-Kirchhoff stress (dim, dim) [MPa]."""
        ...

    @property
    def result(self) -> Any:
        """Result of the cell, for its fields and files."""
        ...


class ConstitutiveModel(Protocol):
    """Stress of points, as a function of their states before a step and their gradients.

    States are (n, points, k), gradients F and stresses P (n, points, dim, dim), moduli dP/dF
    (n, points, dim dim, dim dim); nan where the model has no stress. `parameters` are names among
    t, dt, and their values come with a call.
    """

    @property
    def signature(self) -> str:
        """Identity of the model."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        ...

    def stress(self, states: Array, parameters: Array, F: Array) -> Array:
        """P."""
        ...

    def moduli(self, states: Array, parameters: Array, F: Array) -> tuple[Array, Array]:
        """P and dP/dF."""
        ...

    def renewed(self, states: Array, parameters: Array, F: Array) -> Array:
        """States after the step."""
        ...

    def fault(self, states: Array, parameters: Array, F: Array, element: int) -> str:
        """Reason why an element has no stress; empty if it has one."""
        ...

    def state(
        self, states: Array, parameters: Array, F: Array, element: int, point: int
    ) -> PointState:
        """State of one point at the end of the step."""
        ...


@dataclass(frozen=True)
class ModelKernel(Kernel):
    """Kernel of the page `linearised_stress` with a model in Python.

    page: the kernel of the page. model: stress of the points.
    """

    page: Kernel = field(kw_only=True, repr=False)
    model: ConstitutiveModel = field(kw_only=True, repr=False, compare=False)

    @classmethod
    def of(cls, page: Kernel, model: ConstitutiveModel) -> Self:
        """Return the kernel of a page with a model."""
        family = {f.name: getattr(page, f.name) for f in fields(page)}
        digest = sha256(f"{page.signature} {model.signature}".encode()).hexdigest()
        tasks = tuple(t for t in page.tasks if t in ("residual", "tangent", "fields"))
        changes = {"parameters": model.parameters, "point_data": (), "tasks": tasks}
        return cls(**{**family, **changes, "signature": digest}, page=page, model=model)

    def __reduce__(self) -> tuple[Any, ...]:
        """For `copy` and `pickle`."""
        return _joined, (self.page, self.model)

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """See `Kernel`."""
        states, parameters, rule = _arguments(kwargs)
        F = self.gradients(coordinates, dofs, rule)
        at_points = self._data(F, self.model.stress(states, parameters, F), None)
        return self.page.residual(coordinates, dofs, point_data=at_points, rule=rule)

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """See `Kernel`."""
        states, parameters, rule = _arguments(kwargs)
        F = self.gradients(coordinates, dofs, rule)
        at_points = self._data(F, *self.model.moduli(states, parameters, F))
        return self.page.tangent(coordinates, dofs, point_data=at_points, rule=rule)

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """See `Kernel`."""
        states, parameters, rule = _arguments(kwargs)
        F = self.gradients(coordinates, dofs, rule)
        at_points = self._data(F, self.model.stress(states, parameters, F), None)
        return self.page.fields_at(coordinates, dofs, point_data=at_points, rule=rule)

    def explain(self, *_: Any, **__: Any) -> Any:
        """Raise SoftehlError: there is no page to explain."""
        raise SoftehlError(
            "explain: the body has a unit cell at each point and no page; "
            "result.unit_cell(block, element, point).result.explain(...) is of a cell"
        )

    def renewed(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Return the states (n, points, k) after a step that ends with these unknowns."""
        states, parameters, rule = _arguments(kwargs)
        return self.model.renewed(states, parameters, self.gradients(coordinates, dofs, rule))

    def fault(self, coordinates: Array, dofs: Array, element: int, **kwargs: Any) -> str:
        """Return the reason why an element has no stress."""
        states, parameters, rule = _arguments(kwargs)
        F = self.gradients(coordinates, dofs, rule)
        return self.model.fault(states, parameters, F, element)

    def state(
        self, coordinates: Array, dofs: Array, element: int, point: int, **kwargs: Any
    ) -> PointState:
        """Return the state of a point."""
        states, parameters, rule = _arguments(kwargs)
        F = self.gradients(coordinates, dofs, rule)
        return self.model.state(states, parameters, F, element, point)

    def gradients(self, coordinates: Array, dofs: Array, rule: Rule | None) -> Array:
        """Return the deformation gradients (n, points, dim, dim) at the points."""
        points, dim = len((rule or self.default_rule).weights), len(self.coordinates)
        none = np.zeros((len(dofs), points, len(self.page.point_data)))
        values = self.page.fields_at(coordinates, dofs, point_data=none, rule=rule)
        first = self.fields.index("F_xx")
        return values[:, :, first : first + dim**2].reshape(len(dofs), points, dim, dim)

    def _data(self, F: Array, P: Array, A: Array | None) -> Array:
        """Point data of the page: P, the displacement gradient, the moduli."""
        n, points, dim = F.shape[:3]
        moduli = np.zeros((n, points, dim**4)) if A is None else A
        parts = (P, F - np.eye(dim), moduli)
        return np.concatenate([part.reshape(n, points, -1) for part in parts], axis=2)


def _joined(page: Kernel, model: ConstitutiveModel) -> ModelKernel:
    return ModelKernel.of(page, model)


def _arguments(kwargs: dict[str, Any]) -> tuple[Array, Array, Rule | None]:
    """States, parameters and rule of a call."""
    return kwargs["point_data"], np.asarray(kwargs["parameters"]), kwargs.get("rule")
