"""Generated kernels as functions of NumPy arrays.

The shapes, orders and units of every array are those of `codegen/abi.py`; names and counts come
from the `manifest.json` beside the C.  No SymPy is needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.library import (
    GENERATED,
    KernelError,
    Library,
    MissingKernelsError,
    StaleKernelsError,
    damaged_manifest,
    library_of,
    manifest,
)

__all__ = [
    "ArgumentError",
    "Kernel",
    "KernelError",
    "MissingKernelsError",
    "Rule",
    "StaleKernelsError",
    "kernel_in",
    "load_kernel",
]


class ArgumentError(KernelError, ValueError):
    """An array has a wrong shape or kind, or a task is not offered."""


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
        for array in (self.points, self.weights, self.basis):
            if array is not None:
                array.setflags(write=False)


Condition = tuple[str, str, float, str]
"""Name of a parameter or datum, relation, bound, and the line of the page that demands it."""
RELATIONS = {">": np.greater, ">=": np.greater_equal, "<": np.less, "<=": np.less_equal}


@dataclass(frozen=True)
class Kernel:
    """One kernel family.  Calls take n elements at once; arrays are converted to float64.

    coordinates (n, nodes*len(coordinates)) (any, for a kernel that has none), dofs (n, ndof),
    data (n, len(data)), point_data (n, points, len(point_data)), parameters (len(parameters),) or
    a mapping by name, rule None for the model's default (the only one when `unrolled`).
    places: of every unknown its name without number, and its node or None. history: point data
    whose new values the last fields are.
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

    def energy(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Potential of each element, (n,)."""
        call = _Call(self, "energy", coordinates, dofs, **given)
        return call.run(np.empty(call.n))

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Internal minus external virtual work, (n, ndof)."""
        call = _Call(self, "residual", coordinates, dofs, **given)
        return call.run(np.empty((call.n, call.ndof)))

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        """Residual (n, ndof) and tangent dR_i/du_j (n, ndof, ndof)."""
        call = _Call(self, "tangent", coordinates, dofs, **given)
        tangent = np.empty((call.n, call.ndof, call.ndof))
        return call.run(np.empty((call.n, call.ndof)), tangent), tangent

    def product(self, coordinates: Array, dofs: Array, direction: Array, **given: Any) -> Array:
        """Tangent times `direction` (n, ndof), without forming the tangent: (n, ndof)."""
        call = _Call(self, "product", coordinates, dofs, direction=direction, **given)
        return call.run(np.empty((call.n, call.ndof)))

    def derivative(self, name: str, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Derivative of the residual by the parameter, datum or coordinate `name`: (n, ndof)."""
        call = _Call(self, f"d_{name}", coordinates, dofs, **given)
        return call.run(np.empty((call.n, call.ndof)))

    def fields_at(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Post-processing values at the quadrature points, (n, points, len(fields))."""
        call = _Call(self, "fields", coordinates, dofs, **given)
        return call.run(np.empty((call.n, len(call.rule.weights), len(self.fields))))


class _Call:
    """Checked arguments of one call."""

    def __init__(
        self,
        kernel: Kernel,
        task: str,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        point_data: Array | None = None,
        direction: Array | None = None,
        parameters: Array | Mapping[str, float] = (),  # type: ignore[assignment]
        rule: Rule | None = None,
    ) -> None:
        if task not in kernel.tasks:
            raise ArgumentError(f"{kernel.name} offers {', '.join(kernel.tasks)}, not {task}")
        self.kernel = kernel
        self.function = kernel.library.function(kernel.name, task)
        if rule is not None and kernel.unrolled:
            raise ArgumentError(
                f"the quadrature rule of {kernel.name} is written into it: give none"
            )
        self.rule = kernel.default_rule if rule is None else rule
        self.modes = self._modes()
        self.n = len(dofs)
        self.ndof = len(kernel.unknowns) + self.modes
        width = kernel.nodes * len(kernel.coordinates)
        self.coordinates = np.empty(0)
        if width:
            self.coordinates = self._array("coordinates", coordinates, (self.n, width))
        self.dofs = self._array("dofs", dofs, (self.n, self.ndof))
        self.data = self._array(
            "data", np.empty((self.n, 0)) if data is None else data, (self.n, len(kernel.data))
        )
        if kernel.point_data or point_data is not None:
            size = (self.n, len(self.rule.weights), len(kernel.point_data))
            at_points = self._array("point_data", _or_empty(point_data), size)
            self.data = np.hstack([self.data, at_points.reshape(self.n, size[1] * size[2])])
        self.parameters = self._array(
            "parameters", self._ordered(parameters), (len(kernel.parameters),)
        )
        for condition in kernel.conditions:
            self._check(*condition)
        points = np.asarray(self.rule.points, dtype=np.float64).reshape(len(self.rule.weights), -1)
        self.direction = np.empty(0)
        if direction is not None:
            self.direction = self._array("direction", direction, (self.n, self.ndof))
        self.table = np.column_stack([points, self.rule.weights])
        default = kernel.default_rule
        dimension = default.points.reshape(len(default.weights), -1).shape[1]
        if points.shape[1] != dimension:
            raise ArgumentError(
                f"{kernel.name}: points of the rule are {points.shape[1]}-dimensional, "
                f"must be {dimension}-dimensional"
            )
        self.basis = np.ascontiguousarray(
            np.empty(0) if self.rule.basis is None else self.rule.basis, dtype=np.float64
        )

    def _check(self, name: str, relation: str, bound: float, where: str) -> None:
        kernel = self.kernel
        if name in kernel.parameters:
            values = self.parameters[[kernel.parameters.index(name)]]
        else:
            values = self.data[:, kernel.data.index(name)]
        wrong = ~RELATIONS[relation](values, bound)
        if wrong.any():
            given, allowed = f"{values[wrong][0]:g}", f"{relation} {bound:g}"
            raise ArgumentError(f"{kernel.name}: {name} = {given}, must be {allowed} ({where})")

    def _modes(self) -> int:
        if self.kernel.interpolated is None:
            return 0
        if self.rule.basis is None:
            raise ArgumentError(
                f"{self.kernel.name} interpolates {self.kernel.interpolated}: give it a rule with "
                "a basis, e.g. softehl.runtime.fem.rules.film_rule(m_p)"
            )
        shape = np.shape(self.rule.basis)
        components = self.kernel.components
        if len(shape) != 3 or shape[0] != len(self.rule.weights) or shape[2] != components:
            raise ArgumentError(
                f"{self.kernel.name}: basis has shape {shape}, "
                f"must be (points, modes, {components})"
            )
        return int(shape[1])

    def _ordered(self, parameters: Array | Mapping[str, float]) -> Any:
        if not isinstance(parameters, Mapping):
            return parameters
        missing = [p for p in self.kernel.parameters if p not in parameters]
        if missing:
            raise ArgumentError(f"{self.kernel.name} needs {', '.join(missing)}")
        return [parameters[p] for p in self.kernel.parameters]

    def _array(self, what: str, value: Any, shape: tuple[int, ...]) -> Array:
        given = np.asarray(value)
        if given.dtype.kind not in "fiu":
            raise ArgumentError(
                f"{self.kernel.name}: {what} holds {given.dtype}, must be real numbers"
            )
        array = np.ascontiguousarray(given, dtype=np.float64)
        if array.shape != shape:
            raise ArgumentError(
                f"{self.kernel.name}: {what} has shape {array.shape}, must be {shape}"
            )
        return array

    def run(self, values: Array, tangent: Array | None = None) -> Array:
        """Call the C function; `values` and `tangent` are written in place."""
        read = (
            self.coordinates,
            self.dofs,
            self.data,
            self.parameters,
            self.direction,
            self.table,
            self.basis,
        )
        counts = (self.n, len(self.rule.weights), self.modes)
        self.function(counts, read, values, tangent)
        return values


def _or_empty(value: Array | None) -> Array:
    return np.empty(0) if value is None else value


@cache
def load_kernel(name: str, directory: Path = GENERATED) -> Kernel:
    """The kernel family `name`; raises `KernelError` when it is missing or stale."""
    entries = manifest(directory)
    if name not in entries:
        raise MissingKernelsError(f"no kernel {name!r}; there are {', '.join(entries)}")
    library = library_of(directory)
    try:
        return _kernel(name, entries[name], library)
    except (KeyError, TypeError, ValueError):
        raise damaged_manifest(directory) from None


def _kernel(name: str, entry: Mapping[str, Any], library: Library) -> Kernel:
    """The kernel that an entry of a manifest describes."""
    rule = entry["rule"]
    return Kernel(
        name=name,
        nodes=entry["nodes"],
        coordinates=tuple(entry["coordinates"]),
        unknowns=tuple(entry["unknowns"]),
        interpolated=entry["interpolated"],
        parameters=tuple(entry["parameters"]),
        data=tuple(entry["data"]),
        point_data=tuple(entry["point_data"]),
        fields=tuple(entry["fields"]),
        tasks=tuple(entry["tasks"]),
        unrolled=entry["unrolled"],
        default_rule=Rule(np.array(rule["points"]), np.array(rule["weights"]), None),
        signature=entry["signature"],
        library=library,
        components=entry["components"],
        conditions=tuple((n, r, b, w) for n, r, b, w in entry["conditions"]),
        places=tuple((n, a) for n, a in entry.get("places", ())),
        history=tuple(entry.get("history", ())),
    )


def kernel_in(directory: Path, name: str | None = None) -> Kernel:
    """The kernel of a folder of generated C; `name` is needed if it holds several.

    Raises `KernelError`, also when the folder has changed since this process loaded it.
    """
    entries = manifest(directory)
    if name is None and len(entries) > 1:
        raise MissingKernelsError(f"{directory.name} holds {', '.join(entries)}: name one of them")
    kernel = load_kernel(name or next(iter(entries)), directory)
    if not kernel.library.current:
        raise StaleKernelsError(
            f"{directory.name}/ has changed since it was loaded: start Python anew, or load the "
            "model file itself"
        )
    return kernel
