"""Calling a kernel on states and assembling small dense systems: plumbing of the physics tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softehl.runtime.discretisation import quadrature
from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.mixed import CONSERVING
from tests.reference.states import State

RULES = {
    **dict.fromkeys(CONSERVING, quadrature.rupture_rule),
    "film_rough": quadrature.rupture_rule,
    "film_squeeze": quadrature.content_rule,
    "film_squeeze_rough": quadrature.content_rule,
    "film_upwind_rough": quadrature.film_rule,
}
"""Rules of the films that may rupture, by the order of the pressure."""


def rule_of(state: State) -> Any:
    """The double-precision rule that goes with a state (None: the kernel's own)."""
    if state.family == "film_facet":
        return quadrature.facet_rule((len(state.dofs) - 6) // 2 - 1)
    if state.family in RULES:
        pressures = len(state.dofs) - 4
        both = state.family != "film_upwind_rough"
        return RULES[state.family]((pressures // 2 if both else pressures) - 1)
    if state.family not in ("film", "film_eyring", "film_carreau", "film_upwind"):
        return None
    return quadrature.film_rule(len(state.dofs) - 5, state.kind, state.count)


def call(task: str, state: State) -> Any:
    """`task` ("residual", "tangent", "energy", "fields_at") of the real kernel on one element."""
    data = np.array([state.data]) if state.data else None
    return getattr(load_kernel(state.family), task)(
        np.array([state.coordinates]),
        np.array([state.dofs]),
        data=data,
        point_data=np.array(state.point_data)[None, :, None] if state.point_data else None,
        parameters=np.array(state.parameters),
        rule=rule_of(state),
    )


class Part:
    """Elements of one family in a small problem; `maps` (n, ndof): global numbers of unknowns."""

    def __init__(
        self,
        family: str,
        coordinates: np.ndarray,
        maps: np.ndarray,
        parameters: Sequence[float] | np.ndarray,
        *,
        data: np.ndarray | None = None,
        rule: Any = None,
    ) -> None:
        self.kernel = load_kernel(family)
        self.coordinates = np.ascontiguousarray(coordinates, dtype=float)
        self.maps = np.asarray(maps)
        self.parameters = np.array(parameters, dtype=float)
        self.data = data
        self.rule = rule

    def _arguments(self, x: np.ndarray) -> tuple[tuple[Any, ...], dict[str, Any]]:
        dofs = np.ascontiguousarray(x[self.maps])
        return (self.coordinates, dofs), {
            "data": self.data,
            "parameters": self.parameters,
            "rule": self.rule,
        }

    def elements(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        positional, named = self._arguments(x)
        forces, tangents = self.kernel.tangent(*positional, **named)
        return forces, tangents

    def fields(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """Fields by name, each (n, points)."""
        positional, named = self._arguments(x)
        values = self.kernel.fields_at(*positional, **named)
        return {name: values[:, :, i] for i, name in enumerate(self.kernel.fields)}


def assemble(parts: Sequence[Part], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dense residual and tangent of all parts."""
    n = x.size
    total, matrix = np.zeros(n), np.zeros(n * n)
    for part in parts:
        forces, tangents = part.elements(x)
        places = part.maps[:, :, None] * n + part.maps[:, None, :]
        total += np.bincount(part.maps.ravel(), forces.ravel(), n)
        matrix += np.bincount(places.ravel(), tangents.ravel(), n * n)
    return total, matrix.reshape(n, n)


def solve(
    parts: Sequence[Part], x: np.ndarray, free: np.ndarray, tolerance: float = 1e-12
) -> np.ndarray:
    """Newton on the free unknowns until the relative step is small; x holds the fixed values."""
    x = x.copy()
    for _ in range(30):
        total, matrix = assemble(parts, x)
        step = np.linalg.solve(matrix[np.ix_(free, free)], -total[free])
        x[free] += step
        if np.abs(step).max() <= tolerance * max(np.abs(x).max(), 1e-300):
            return x
    raise AssertionError(f"Newton did not converge: last step {np.abs(step).max():.2e}")


def fitted_order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log(error) over log(size), least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
