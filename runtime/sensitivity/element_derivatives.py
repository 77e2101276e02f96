"""Rates of residuals and of history, element by element, along variations of their arguments.

Pages have kernels for it. Loads are known in closed form by their amount; by the places of their
nodes a central difference of order 6 is taken, of which rounding is left: 1e-12 or so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.contact.pair_law import PairLawKernel
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.run_time_arrays import packed, unpacked
from softehl.runtime.sensitivity.tape import Tape

ArrayRates: TypeAlias = Mapping[str, Array]
"""Rates of run-time arrays by name, as C reads these."""
_WIDE = 1e-3
"""Of the size of an element: step of a difference of order 6, whose own error is then 1e-18."""
_WEIGHTS = ((1, 45.0), (2, -9.0), (3, 1.0))


class ElementDerivatives:
    """The elements of a block in a converged step.

    width: of rows, the arguments that may move: coordinates, data and parameters of a page,
    coordinates and amount of a load, coordinates and parameters of a law of contact.
    """

    def __init__(self, tape: Tape, name: str) -> None:
        self.block: ElementBlock = tape.problem.assembler.block(name)
        self.parameters: Array = tape.problem.parameters[name]
        self.dofs = np.ascontiguousarray(tape.x[self.block.dofs])
        self.page = tape.system.blocks.get(name)
        self.coordinates = np.shape(self.block.coordinates)[1]
        self.n = len(self.dofs)
        self._dimension = tape.system.mesh.dimension
        if isinstance(self.block.kernel, PairLawKernel):
            self.width = self.coordinates + len(self.block.kernel.parameters)
        elif self.page is None:
            self.width = self.coordinates + 1
        else:
            kernel = self.page.kernel
            self.width = self.coordinates + len(kernel.data) + len(kernel.parameters)

    def zero_rows(self) -> Array:
        """Rows (n, width) of arguments that do not move."""
        return np.zeros((self.n, self.width))

    def residual(
        self, rows: Array, history: Array | None = None, arrays: ArrayRates | None = None
    ) -> Array:
        """Rate of the residuals (n, ndof) along rows (n, width), unknowns held.

        history: (n, points, k) rates of the point data. arrays: rates of run-time arrays by name.
        """
        law = self.block.kernel
        if isinstance(law, PairLawKernel):
            arguments = {"data": self.block.data, "parameters": self.parameters}
            direction = rows[:, self.coordinates :]
            return law.rate(self.block.coordinates, self.dofs, direction, **arguments)
        if self.page is None:
            return self._load(rows)
        kernel = self._kernel("pseudo_load")
        arguments = self._arguments(history, arrays)
        return kernel.pseudo_load(self.block.coordinates, self.dofs, rows, **arguments)

    def history(
        self,
        rows: Array,
        dofs: Array | None,
        history: Array | None = None,
        arrays: ArrayRates | None = None,
    ) -> Array:
        """Rate of the point data after the step, (n, points, k), along a variation of all.

        dofs: (n, ndof) rates of the unknowns, None for none.
        """
        assert self.page is not None
        if not self.page.kernel.history:  # point data that stay as they are
            assert self.block.point_data is not None
            return np.zeros_like(self.block.point_data)
        kernel, direction = self._kernel("fields_rate"), np.zeros_like(self.dofs)
        along = np.hstack([rows, direction if dofs is None else dofs])
        arguments = self._arguments(history, arrays)
        rates = kernel.fields_rate(self.block.coordinates, self.dofs, along, **arguments)
        page = self.page.kernel
        after = np.zeros((*rates.shape[:2], len(page.point_data)))
        for name in page.history:
            column = kernel.fields.index(f"new_{name}")
            after[:, :, page.point_data.index(name)] = rates[:, :, column]
        return after

    def _arguments(self, history: Array | None, rates: ArrayRates | None) -> dict[str, Any]:
        block = self.block
        arguments = block.given(self.parameters if not rates else self._moving(rates))
        if block.point_data is None:
            return arguments
        direction = np.zeros_like(block.point_data) if history is None else history
        return {**arguments, "point_data": np.concatenate([block.point_data, direction], axis=2)}

    def _moving(self, rates: ArrayRates) -> Array:
        """The parameters with the rates of some run-time arrays."""
        assert self.page is not None
        kernel = self.page.kernel
        count = len(kernel.parameters)
        arrays = unpacked(self.parameters, count, len(kernel.arrays))
        moving = [rates.get(a.name) for a in kernel.arrays]
        return packed(self.parameters[:count], arrays, moving)

    def _kernel(self, task: str) -> Kernel:
        """The kernel of derivatives.  Raises StudyError where there is none."""
        page = self.page
        assert page is not None
        if page.differentiated is not None:
            return page.differentiated().with_lengths(page.kernel.lengths)
        if task not in page.kernel.tasks or page.kernel.point_data:
            raise StudyError(
                f"{page.name!r}: {page.kernel.name} comes as C without derivatives: give its page "
                "instead, or m.offer(pseudo_load=True) where it has no history"
            )
        return page.kernel

    def _load(self, rows: Array) -> Array:
        kernel, width = self.block.kernel, self.coordinates
        rate = np.zeros_like(self.dofs)
        amounts = rows[:, width]
        if amounts.any():
            one, none = self.unit_loads()
            rate += amounts[:, None] * (self._at(one, 0.0) - self._at(none, 0.0))
        coordinates = rows[:, :width]
        if coordinates.any():
            step = _WIDE * self.size() / float(np.abs(coordinates).max())
            for k, weight in _WEIGHTS:
                ahead = self._at(kernel, k * step * coordinates)
                rate += weight / (60.0 * step) * (ahead - self._at(kernel, -k * step * coordinates))
        return rate

    def unit_loads(self) -> tuple[Any, Any]:
        """The load with the amount 1, or with its function, and without any."""
        kernel: Any = self.block.kernel
        name = _amount(kernel)
        value = getattr(kernel, name)
        one = replace(kernel, **{name: value if callable(value) else 1.0})
        return one, replace(kernel, **{name: 0.0})

    def _at(self, kernel: Any, moved: Array | float) -> Array:
        residual = kernel.residual(
            self.block.coordinates + moved, self.dofs, parameters=self.parameters
        )
        return np.asarray(residual)

    def size(self) -> float:
        """Size of the smallest element, or of all of them where they are points."""
        largest = np.abs(self.block.coordinates).max(initial=0.0)
        nodes = self.block.coordinates.reshape(self.n, -1, self._dimension)
        extents = np.ptp(nodes, axis=1).max(axis=1)
        return float(extents.min(where=extents > 0.0, initial=largest or 1.0))


def _amount(kernel: object) -> str:
    if isinstance(kernel, Spring):
        return "stiffness"
    return "offset" if isinstance(kernel, Tie) else "value"
