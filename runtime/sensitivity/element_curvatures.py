"""Rates of the gradients of element Lagrangians along a variation, for second derivatives.

The Lagrangian of an element is L = adjoint . residual + adjoint . history after the step. Pages
have kernels for the rates of its gradient. Those of loads follow from their tangent and amount; by
the places of nodes central differences of order 10 are taken, of which 1e-12 or so is left.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.loads import Pressure
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.sensitivity.differences import WIDE, mixed, slope
from softehl.runtime.sensitivity.element_derivatives import ElementDerivatives


@dataclass(frozen=True, eq=False)
class Adjoints:
    """Adjoints of an element's residual (n, ndof), and of the point data after the step."""

    residual: Array
    history: Array | None = None


@dataclass(frozen=True, eq=False)
class Variation:
    """Rates of the arguments of elements: rows (n, width), dofs (n, ndof), history (n, points, k).

    Rows are those of `ElementDerivatives`. history: point data before the step.
    """

    rows: Array
    dofs: Array
    history: Array | None = None


class ElementCurvatures:
    """The elements of a block in a converged step, whose Lagrangian is differentiated twice."""

    def __init__(self, elements: ElementDerivatives, columns: Collection[int]) -> None:
        """columns: arguments of a load by which is differentiated."""
        self._elements, self._columns = elements, sorted(columns)

    def rates(self, adjoint: Adjoints, along: Variation, adjoint_rate: Adjoints) -> Variation:
        """Rates of the derivatives of L by all arguments, as arguments and adjoints move."""
        if self._elements.page is None:
            return self._of_load(adjoint.residual, along, adjoint_rate.residual)
        return self._of_page(adjoint, along, adjoint_rate)

    def gradient(self, adjoint: Adjoints) -> Variation:
        """Derivatives of L by all arguments: its rates as the adjoint grows from zero."""
        elements = self._elements
        at_rest = Variation(elements.zero_rows(), np.zeros_like(elements.dofs))
        return self.rates(Adjoints(np.zeros_like(adjoint.residual)), at_rest, adjoint)

    def _of_page(self, adjoint: Adjoints, along: Variation, adjoint_rate: Adjoints) -> Variation:
        elements, block = self._elements, self._elements.block
        kernel, arguments = self._kernel(), block.given(elements.parameters)
        vectors = (along.rows, along.dofs, adjoint.residual, adjoint_rate.residual)
        if block.point_data is not None:
            none = np.zeros_like(block.point_data)
            of_points = (along.history, adjoint.history, adjoint_rate.history)
            values = [none if v is None else v for v in of_points]
            arguments["point_data"] = np.concatenate([block.point_data, *values], axis=2)
        X, u, direction = block.coordinates, elements.dofs, np.hstack(vectors)
        rates = kernel.adjoint_rate(X, u, direction, **arguments)
        history = None
        if block.point_data is not None:
            history = kernel.point_adjoint_rate(X, u, direction, **arguments)
        return Variation(rates[:, : elements.width], rates[:, elements.width :], history)

    def _kernel(self) -> Kernel:
        """The kernel of second derivatives.  Raises StudyError where there is none."""
        page = self._elements.page
        assert page is not None
        if page.twice_differentiated is None:
            raise StudyError(
                f"{page.name!r}: {page.kernel.name} comes as C without second derivatives: give "
                "its page instead"
            )
        try:
            return page.twice_differentiated()
        except StudyError:
            raise
        except SoftehlError as error:
            raise StudyError(f"{page.name!r} has no second derivatives: {error}") from error

    def _of_load(self, left: Array, along: Variation, left_rate: Array) -> Variation:
        elements = self._elements
        kernel, width = elements.block.kernel, elements.coordinates
        one, none = elements.unit_loads()
        coordinates, amounts = along.rows[:, :width], along.rows[:, width]

        def work(load: Any, adjoint: Array) -> Callable[[Array, Array], Array]:
            return lambda X, u: (adjoint * self._residual(load, X, u)).sum(axis=1)

        def unit(X: Array, u: Array) -> Array:
            return np.asarray(work(one, left)(X, u) - work(none, left)(X, u))

        def forces(X: Array, u: Array) -> Array:
            return np.asarray(np.einsum("nij,ni->nj", self._tangent(kernel, X, u), left))

        X, u = elements.block.coordinates, elements.dofs
        K, K_one, K_none = (self._tangent(load, X, u) for load in (kernel, one, none))
        by_dofs = np.einsum("nij,ni->nj", K, left_rate)
        by_dofs += amounts[:, None] * np.einsum("nij,ni->nj", K_one - K_none, left)
        if isinstance(kernel, Pressure):
            by_dofs += self._slope(forces, coordinates, along.dofs)
        rows, at_rest = elements.zero_rows(), np.zeros_like(u)
        rows[:, width] = work(one, left_rate)(X, u) - work(none, left_rate)(X, u)
        rows[:, width] += np.einsum("ni,nij,nj->n", left, K_one - K_none, along.dofs)
        if coordinates.any():
            rows[:, width] += self._slope(unit, coordinates, at_rest)
        for j in self._columns:
            if j < width:
                axis = np.zeros_like(X)
                axis[:, j] = 1.0
                rows[:, j] = self._slope(work(kernel, left_rate), axis, at_rest)
                rows[:, j] += amounts * self._slope(unit, axis, at_rest)
                rows[:, j] += self._bend(work(kernel, left), axis, (coordinates, along.dofs))
        return Variation(rows, by_dofs)

    def _residual(self, kernel: Any, X: Array, u: Array) -> Array:
        return np.asarray(kernel.residual(X, u, parameters=self._elements.parameters))

    def _tangent(self, kernel: Any, X: Array, u: Array) -> Array:
        return np.asarray(kernel.tangent(X, u, parameters=self._elements.parameters)[1])

    def _slope(self, f: Callable[[Array, Array], Array], dX: Array, du: Array) -> Array:
        """Derivative of f along a variation of coordinates and unknowns."""
        X, u, size = self._elements.block.coordinates, self._elements.dofs, _size(dX, du)
        if size == 0.0:
            return np.zeros_like(f(X, u))
        return slope(lambda s: f(X + s * dX, u + s * du), self._step / size)

    def _bend(
        self, f: Callable[[Array, Array], Array], axis: Array, along: tuple[Array, Array]
    ) -> Array:
        """Mixed second derivative along a coordinate and along a variation."""
        dX, du = along
        if not isinstance(self._elements.block.kernel, Pressure):
            du = np.zeros_like(du)
        X, u, size = self._elements.block.coordinates, self._elements.dofs, _size(dX, du)
        if size == 0.0:
            return np.zeros(len(X))
        dX, du = dX / size, du / size
        return size * mixed(lambda r, s: f(X + r * axis + s * dX, u + s * du), self._step)

    @property
    def _step(self) -> float:
        """Length of a step of coordinates."""
        return WIDE * self._elements.size()


def _size(dX: Array, du: Array) -> float:
    return float(max(np.abs(dX).max(initial=0.0), np.abs(du).max(initial=0.0)))
