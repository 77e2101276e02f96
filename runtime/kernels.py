"""Generated kernels as functions of NumPy arrays: the only module that knows cffi.

The shapes, orders and units of every array are those of `codegen/abi.py`; names and counts come
from `generated/manifest.json`.  No SymPy is needed.
"""

from __future__ import annotations

import hashlib
import json
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np
import numpy.typing as npt

from softehl.runtime.fem.rules import Rule

Array = npt.NDArray[np.float64]

GENERATED = Path(__file__).resolve().parent.parent / "generated"
LIBRARY = "kernels" + (sysconfig.get_config_var("SHLIB_SUFFIX") or ".so")
REMEDY = "run `python -m softehl.codegen.tools.build` (make does it)"
REMEDY_OF_OTHERS = "run `softehl generate` with its model file"

_SIGNATURE = (
    "(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *, const double *, const double *,"
    " const double *, const double *, const double *, const double *, double *, double *);"
)


class KernelError(RuntimeError):
    """A kernel cannot be used; the message says what to do."""


class MissingKernelsError(KernelError):
    """The library has not been built, or has no such kernel."""


class StaleKernelsError(KernelError):
    """The library was built from other C than what stands in `generated/` now."""


class ArgumentError(KernelError, ValueError):
    """An array has a wrong shape or kind, or a task is not offered."""


Condition = tuple[str, str, float, str]
"""Name of a parameter or datum, relation, bound, and the line of the page that demands it."""
RELATIONS = {">": np.greater, ">=": np.greater_equal, "<": np.less, "<=": np.less_equal}


@dataclass(frozen=True)
class Kernel:
    """One kernel family.  Calls take n elements at once; arrays are converted to float64.

    coordinates (n, nodes*len(coordinates)) (any, for a kernel that has none), dofs (n, ndof),
    data (n, len(data)), point_data (n, points, len(point_data)), parameters (len(parameters),) or
    a mapping by name, rule None for the model's default (the only one when `unrolled`).
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
    library: Any
    components: int = 2
    conditions: tuple[Condition, ...] = ()

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
        self.function = getattr(kernel.library, f"softehl_{kernel.name}_{task}")
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
        self.function(
            self.n,
            len(self.rule.weights),
            self.modes,
            *(_pointer(a, "const double *") for a in read),
            _pointer(values, "double *"),
            _ffi.NULL if tangent is None else _pointer(tangent, "double *"),
        )
        return values


def _or_empty(value: Array | None) -> Array:
    return np.empty(0) if value is None else value


_ffi = cffi.FFI()


def _pointer(array: Array, kind: str) -> Any:
    return _ffi.cast(kind, array.ctypes.data)


def _sources_signature(directory: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(directory.glob("*.[ch]")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def manifest(directory: Path = GENERATED) -> dict[str, Any]:
    """Kernel families of a directory of generated C, by name."""
    path = directory / "manifest.json"
    if not path.exists():
        raise MissingKernelsError(f"{path} is missing: run `softehl generate`")
    kernels: dict[str, Any] = json.loads(path.read_text())["kernels"]
    return kernels


@cache
def _library(directory: Path) -> Any:
    path = directory / LIBRARY
    remedy = REMEDY if directory == GENERATED else REMEDY_OF_OTHERS
    if not path.exists():
        raise MissingKernelsError(f"the kernels are not built: {remedy}")
    _ffi.cdef(_declarations(directory), override=True)
    library: Any = _ffi.dlopen(str(path))
    if _built_from(library) != _sources_signature(directory):
        _ffi.dlclose(library)
        raise StaleKernelsError(
            f"{path.name} was built from other sources than {directory.name}/ holds now: {remedy}"
        )
    return library


def _built_from(library: Any) -> str:
    """Signature of the sources that a library was built from."""
    text: bytes = _ffi.string(library.softehl_signature())
    return text.decode()


def _declarations(directory: Path) -> str:
    functions = [
        f"void softehl_{name}_{task}{_SIGNATURE}"
        for name, entry in manifest(directory).items()
        for task in entry["tasks"]
    ]
    return "\n".join([*functions, "const char *softehl_signature(void);"])


@cache
def load_kernel(name: str, directory: Path = GENERATED) -> Kernel:
    """The kernel family `name`; raises `KernelError` when it is missing or stale."""
    entries = manifest(directory)
    if name not in entries:
        raise MissingKernelsError(f"no kernel {name!r}; there are {', '.join(entries)}")
    entry = entries[name]
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
        library=_library(directory),
        components=entry["components"],
        conditions=tuple((n, r, b, w) for n, r, b, w in entry["conditions"]),
    )


def kernel_in(directory: Path, name: str | None = None) -> Kernel:
    """The kernel of a folder of generated C; `name` is needed if it holds several.

    Raises `KernelError`, also when the folder has changed since this process loaded it.
    """
    entries = manifest(directory)
    if name is None and len(entries) > 1:
        raise MissingKernelsError(f"{directory.name} holds {', '.join(entries)}: name one of them")
    kernel = load_kernel(name or next(iter(entries)), directory)
    if _built_from(kernel.library) != _sources_signature(directory):
        raise StaleKernelsError(
            f"{directory.name}/ has changed since it was loaded: start Python anew, or load the "
            "model file itself"
        )
    return kernel
