"""Call of a kernel: arguments of its family, and their checks.

The shapes, orders and units of every array are those of `codegen/abi.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from softehl.function_address import FunctionAddress, FunctionAddressError, address_of
from softehl.runtime.arrays import Array, frozen
from softehl.runtime.kernels.array_data import data_of
from softehl.runtime.kernels.run_time_arrays import (
    ArrayDataError,
    RunTimeArray,
    is_packed,
    packed,
    require_equal_lengths,
    unpacked,
)
from softehl.runtime.kernels.shared_library import KernelError, Library


class ArgumentError(KernelError, ValueError):
    """An array has a wrong shape or kind, or a task is not offered."""


_NOTHING = np.empty(0)


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature rule and, for the film, the pressure shape functions at its points.

    points: (q, dim) reference coordinates; weights: (q,); basis: (q, modes, 2) value and d/dxi of
    every pressure shape function at every point, or None; a facet has two such pairs, (q, modes,
    4). All arrays are read-only.
    """

    points: Array
    weights: Array
    basis: Array | None = None

    def __post_init__(self) -> None:
        for name in ("points", "weights", "basis"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(np.asarray(getattr(self, name))))

    @cached_property
    def table(self) -> Array:
        """Points with their weights, (q, dim + 1)."""
        points = np.asarray(self.points, dtype=np.float64).reshape(len(self.weights), -1)
        return np.column_stack([points, self.weights])

    @cached_property
    def shape_functions(self) -> Array:
        """The basis, contiguous; empty for none."""
        basis = _NOTHING if self.basis is None else self.basis
        return np.ascontiguousarray(basis, dtype=np.float64)


Condition = tuple[str, str, float, str]
"""Name of a parameter or datum, relation, bound, and the line of the page that demands it."""
RELATIONS = {">": np.greater, ">=": np.greater_equal, "<": np.less, "<=": np.less_equal}


@dataclass(frozen=True)
class Family:
    """Arguments of one kernel family.  Calls take n elements at once, as arrays of float64.

    coordinates (n, nodes*len(coordinates)) (any, for a kernel that has none), dofs (n, ndof),
    data (n, len(data)), point_data (n, points, len(point_data)), parameters (len(parameters),) or
    a mapping by name, rule None for the model's default (the only one when `unrolled`).
    places: of every unknown its name without number, and its node or None. history: point data
    whose new values the last fields are. internal: unknowns of one element alone. functions:
    parameters that are addresses of C functions; addresses: those that the page knows. cell: on
    which a page of fields stands. kept: numbers that products by sum factorisation keep at a point,
    0 where the family has none. coarse: unknowns of the cell of the next lower order, whose
    tangents follow from these numbers. term_groups: arrays of equal lengths. term_history: names of
    history of terms, each with the array whose length it has; lengths: of all arrays, once they
    are known and have given names to this history. point_rates: whether point data have rates.
    """

    name: str
    nodes: int
    coordinates: tuple[str, ...]
    unknowns: tuple[str, ...]
    interpolated: str | None
    parameters: tuple[str, ...]
    data: tuple[str, ...]
    point_data: tuple[str, ...]
    fields: tuple[str, ...]
    tasks: tuple[str, ...]
    default_rule: Rule
    unrolled: bool
    signature: str
    library: Library
    components: int = 2
    conditions: tuple[Condition, ...] = ()
    places: tuple[tuple[str, int | None], ...] = ()
    history: tuple[str, ...] = ()
    internal: tuple[str, ...] = ()
    point_rates: bool = False
    functions: tuple[str, ...] = ()
    addresses: Mapping[str, FunctionAddress] = field(default_factory=dict, compare=False)
    cell: str = ""
    kept: int = 0
    coarse: int = 0
    arrays: tuple[RunTimeArray, ...] = ()
    term_groups: tuple[tuple[str, ...], ...] = ()
    term_history: tuple[tuple[str, str], ...] = ()
    lengths: tuple[int, ...] | None = None

    def with_lengths(self, lengths: Sequence[int] | None) -> Self:
        """Return the family with a name for each number of history of terms: h[0], h[1], ...

        lengths: of all run-time arrays.
        """
        if not self.term_history or self.lengths is not None or lengths is None:
            return self
        of = {a.name: n for a, n in zip(self.arrays, lengths, strict=True)}
        names = tuple(f"{h}[{k}]" for h, array in self.term_history for k in range(of[array]))
        new = tuple(f"new_{n}" for n in names)
        half = len(self.point_data) // 2 if self.point_rates else len(self.point_data)
        rates = tuple(f"rate_{n}" for n in names) if self.point_rates else ()
        return replace(
            self,
            point_data=(*self.point_data[:half], *names, *self.point_data[half:], *rates),
            fields=(*self.fields, *new),
            history=(*self.history, *names),
            lengths=tuple(lengths),
        )

    def with_arrays(self, parameters: Sequence[float] | Array, given: Mapping[str, Any]) -> Array:
        """Parameters as C reads them: numbers, then the arrays that `given` has by name.

        Raises ArgumentError.
        """
        data = {}
        for array in self.arrays:
            try:
                data[array.name] = data_of(array, given[array.name])
            except ArrayDataError as error:
                raise ArgumentError(f"{self.name}: {array.name}: {error}") from None
        try:
            require_equal_lengths(self.term_groups, data)
        except ArrayDataError as error:
            raise ArgumentError(f"{self.name}: {error}") from None
        return packed(parameters, [a.numbers for a in data.values()])


@dataclass(frozen=True, eq=False)
class CallArguments:
    """Arguments of a call besides coordinates and unknowns; see `Family` for the shapes."""

    data: Array | None = None
    point_data: Array | None = None
    direction: Array | None = None
    parameters: Array | Mapping[str, float] | tuple[float, ...] = ()
    rule: Rule | None = None


def _lengths(kernel: Family, parameters: Any) -> list[int]:
    """Lengths of the run-time arrays of a call.  Raises ArgumentError."""
    if not isinstance(parameters, Mapping):
        count = len(kernel.parameters)
        return [len(a) for a in unpacked(np.asarray(parameters), count, len(kernel.arrays))]
    missing = [a.name for a in kernel.arrays if a.name not in parameters]
    if missing:
        raise ArgumentError(f"{kernel.name} needs {', '.join(missing)}")
    return [np.size(parameters[a.name]) for a in kernel.arrays]


class Call:
    """Checked arguments of one call.

    rule: in use; n, modes, ndof: numbers of elements, of shape functions of the interpolated field
    and of element unknowns.
    """

    def __init__(
        self, kernel: Family, task: str, coordinates: Array, dofs: Array, arguments: CallArguments
    ) -> None:
        """Raises ArgumentError for a task, shape, kind or value that does not fit."""
        if task not in kernel.tasks:
            raise ArgumentError(f"{kernel.name} offers {', '.join(kernel.tasks)}, not {task}")
        if kernel.term_history and kernel.lengths is None:
            kernel = kernel.with_lengths(_lengths(kernel, arguments.parameters))
        self.kernel, self.task = kernel, task
        self.function = kernel.library.function(kernel.name, task)
        self.rule = self._rule(arguments.rule)
        self.modes = self._modes()
        self.n = len(dofs)
        self.ndof = len(kernel.unknowns) + self.modes
        width = kernel.nodes * len(kernel.coordinates)
        self.read = (
            self._array("coordinates", coordinates, (self.n, width)) if width else _NOTHING,
            self._array("dofs", dofs, (self.n, self.ndof)),
            *self._constants(arguments),
            _NOTHING
            if arguments.direction is None
            else self._array("direction", arguments.direction, (self.n, self._along(task, width))),
            *self._tables(),
        )

    def run(self, values: Array, tangent: Array | None = None) -> Array:
        """Call the C function; `values` and `tangent` are written in place."""
        self.function((self.n, len(self.rule.weights), self.modes), self.read, values, tangent)
        return values

    def again(self) -> Callable[[Array, Array, Array | None], None]:
        """The call with other unknowns (n, ndof), float64 and contiguous: they are not checked."""
        counts = self.n, len(self.rule.weights), self.modes
        return self.kernel.library.again(self.kernel.name, self.task, counts, self.read)

    def _along(self, task: str, width: int) -> int:
        """Values of `direction` for an element: of its coordinates, data, parameters and dofs."""
        if task == "product":
            return self.ndof
        design = width + len(self.kernel.data) + len(self.kernel.parameters)
        vectors = {"fields_rate": 1, "adjoint_rate": 3, "point_adjoint_rate": 3}
        return design + vectors.get(task, 0) * self.ndof

    def _rule(self, arguments: Rule | None) -> Rule:
        if arguments is None:
            return self.kernel.default_rule
        if self.kernel.unrolled:
            raise ArgumentError(
                f"the quadrature rule of {self.kernel.name} is written into it: give none, or "
                "write unroll=False on its page"
            )
        return arguments

    def _constants(self, arguments: CallArguments) -> tuple[Array, Array]:
        """Data of elements and of their points side by side, (n, columns), and parameters."""
        kernel, n, points = self.kernel, self.n, len(self.rule.weights)
        data = np.empty((n, 0)) if arguments.data is None else arguments.data
        data = self._array("data", data, (n, len(kernel.data)))
        parameters = self._parameters(arguments.parameters)
        columns = len(kernel.point_data)
        if columns or arguments.point_data is not None:
            at_points = _NOTHING if arguments.point_data is None else arguments.point_data
            at_points = self._array("point_data", at_points, (n, points, columns))
        else:
            at_points = np.empty((n, points, 0))
        for condition in kernel.conditions:
            self._check(data, at_points, parameters, condition)
        if columns or arguments.point_data is not None:
            data = np.hstack([data, at_points.reshape(n, points * columns)])
        return data, parameters

    def _tables(self) -> tuple[Array, Array]:
        """Points with their weights, (q, dim + 1), and the basis at them."""
        table, default = self.rule.table, self.kernel.default_rule.table
        if table.shape[1] != default.shape[1]:
            raise ArgumentError(
                f"{self.kernel.name}: points of the rule are {table.shape[1] - 1}-dimensional, "
                f"must be {default.shape[1] - 1}-dimensional"
            )
        return table, self.rule.shape_functions

    def _check(
        self, data: Array, at_points: Array, parameters: Array, condition: Condition
    ) -> None:
        name, relation, bound, where = condition
        kernel = self.kernel
        if name in kernel.parameters:
            values = parameters[[kernel.parameters.index(name)]]
        elif name in kernel.data:
            values = data[:, kernel.data.index(name)]
        else:
            values = at_points[:, :, kernel.point_data.index(name)]
        invalid = ~RELATIONS[relation](values, bound)
        if invalid.any():
            value_text, allowed = f"{values[invalid][0]:g}", f"{relation} {bound:g}"
            raise ArgumentError(
                f"{kernel.name}: {name} = {value_text}, must be {allowed} ({where})"
            )

    def _modes(self) -> int:
        if self.kernel.interpolated is None:
            return 0
        if self.rule.basis is None:
            raise ArgumentError(
                f"{self.kernel.name} interpolates {self.kernel.interpolated}: give it a rule with "
                "a basis, e.g. softehl.runtime.discretisation.quadrature.film_rule(m_p)"
            )
        shape = np.shape(self.rule.basis)
        components = self.kernel.components
        if len(shape) != 3 or shape[0] != len(self.rule.weights) or shape[2] != components:
            raise ArgumentError(
                f"{self.kernel.name}: basis has shape {shape}, "
                f"must be (points, modes, {components})"
            )
        return int(shape[1])

    def _parameters(self, parameters: Any) -> Array:
        """Parameters in order, with the arrays behind them."""
        kernel, count = self.kernel, len(self.kernel.parameters)
        if not isinstance(parameters, Mapping):
            if not kernel.arrays:
                return self._array("parameters", parameters, (count,))
            if not isinstance(parameters, np.ndarray) or not is_packed(
                parameters, count, len(kernel.arrays)
            ):
                names = [*kernel.parameters, *(a.name for a in kernel.arrays)]
                raise ArgumentError(
                    f"{kernel.name} has curves or networks: give its parameters by name, "
                    f"parameters=dict({', '.join(f'{n}=...' for n in names)})"
                )
            return np.ascontiguousarray(parameters, dtype=np.float64)
        needed = [*kernel.parameters, *(a.name for a in kernel.arrays)]
        parameters = {**kernel.addresses, **parameters}
        missing = [p for p in needed if p not in parameters]
        if missing:
            raise ArgumentError(f"{kernel.name} needs {', '.join(missing)}")
        try:
            ordered = [
                address_of(p, parameters[p]) if p in kernel.functions else parameters[p]
                for p in kernel.parameters
            ]
        except FunctionAddressError as error:
            raise ArgumentError(f"{kernel.name}: {error}") from None
        numbers = self._array("parameters", ordered, (count,))
        return kernel.with_arrays(numbers, parameters) if kernel.arrays else numbers

    def _array(self, what: str, value: Any, shape: tuple[int, ...]) -> Array:
        if isinstance(value, np.ma.MaskedArray):
            raise ArgumentError(f"{self.kernel.name}: {what} is a masked array: fill it first")
        converted = np.asarray(value)
        if converted.dtype.kind not in "fiu":
            raise ArgumentError(
                f"{self.kernel.name}: {what} holds {converted.dtype}, must be real numbers"
            )
        array = np.ascontiguousarray(converted, dtype=np.float64)
        if array.shape != shape:
            raise ArgumentError(
                f"{self.kernel.name}: {what} has shape {array.shape}, must be {shape}"
            )
        return array
