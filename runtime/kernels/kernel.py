"""Generated kernels as functions of NumPy arrays.

The shapes, orders and units of every array are those of `codegen/abi.py`; names and counts come
from the `manifest.json` beside the C.  No SymPy is needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.explanation import ElementState, Explanation, explanation
from softehl.runtime.kernels.kernel_call import ArgumentError, Call, CallArguments, Family, Rule
from softehl.runtime.kernels.run_time_arrays import RunTimeArray, unpacked
from softehl.runtime.kernels.shared_library import (
    GENERATED,
    KernelError,
    Library,
    MissingKernelsError,
    StaleKernelsError,
    damaged_manifest,
    library_of,
    manifest,
)
from softehl.runtime.suggestions import short_list

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


@dataclass(frozen=True)
class Kernel(Family):
    """Compiled kernel of one kind of element; arrays hold n elements.

    Calls take by name what the kernel needs besides coordinates and unknowns: `data` (n, k),
    `point_data` (n, points, k), `parameters` (k,) or by name, and `rule`. Curves and weights of
    networks are parameters by name. A kernel is pickled by its name and the folder of its library.
    """

    def __repr__(self) -> str:
        """Summary in one line."""
        arrays = f"; arrays: {short_list([a.name for a in self.arrays])}" if self.arrays else ""
        return (
            f"<Kernel {self.name}: {self.nodes} nodes; unknowns: {short_list(self.unknowns)}; "
            f"parameters: {short_list(self.parameters)}; data: {short_list(self.data)}{arrays}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """For `copy` and `pickle`."""
        folder = _library_folder(self.library)
        return _reloaded, (self.name, folder, self.signature, self.lengths)

    def call(self, task: str, coordinates: Array, dofs: Array, **kwargs: Any) -> Call:
        """Return a checked call of a task, which can be repeated with other unknowns.

        Parameters
        ----------
        task : str
            One of `tasks`.
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        Call
            The call.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        return Call(self, task, coordinates, dofs, CallArguments(**kwargs))

    def energy(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Return the potential of each element.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n,)
            Potentials.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(self, "energy", coordinates, dofs, CallArguments(**kwargs))
        return call.run(np.empty(call.n))

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Return the residuals: internal less external virtual work.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, ndof)
            Residuals.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(self, "residual", coordinates, dofs, CallArguments(**kwargs))
        return call.run(np.empty((call.n, call.ndof)))

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Return residuals and tangents.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        residual : array (n, ndof)
            Residuals.
        tangent : array (n, ndof, ndof)
            dR_i/du_j.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(self, "tangent", coordinates, dofs, CallArguments(**kwargs))
        tangent = np.empty((call.n, call.ndof, call.ndof))
        return call.run(np.empty((call.n, call.ndof)), tangent), tangent

    def product(self, coordinates: Array, dofs: Array, direction: Array, **kwargs: Any) -> Array:
        """Return the tangents times a vector, without the tangents.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        direction : array (n, ndof)
            The vector.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, ndof)
            Products.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(
            self, "product", coordinates, dofs, CallArguments(direction=direction, **kwargs)
        )
        return call.run(np.empty((call.n, call.ndof)))

    def derivative(self, name: str, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Return the derivative of the residuals by an argument.

        Parameters
        ----------
        name : str
            Parameter, datum or coordinate of `Model.offer(derivatives=...)`.
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, ndof)
            Derivatives.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such derivative.
        """
        call = Call(self, f"d_{name}", coordinates, dofs, CallArguments(**kwargs))
        return call.run(np.empty((call.n, call.ndof)))

    def pseudo_load(
        self, coordinates: Array, dofs: Array, direction: Array, **kwargs: Any
    ) -> Array:
        """Return the derivative of the residuals along a variation of the elements.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements, which are held.
        direction : array (n, coordinates + data + parameters)
            Variation of each of these, in this order.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, ndof)
            Derivatives.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(
            self, "pseudo_load", coordinates, dofs, CallArguments(direction=direction, **kwargs)
        )
        return call.run(np.empty((call.n, call.ndof)))

    def fields_rate(
        self, coordinates: Array, dofs: Array, direction: Array, **kwargs: Any
    ) -> Array:
        """Return the derivative of `fields_at` along a variation.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        direction : array (n, coordinates + data + parameters + ndof)
            Variation of each of these, in this order.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, points, fields)
            Derivatives.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(
            self, "fields_rate", coordinates, dofs, CallArguments(direction=direction, **kwargs)
        )
        return call.run(np.empty((call.n, len(call.rule.weights), len(call.kernel.fields))))

    def adjoint_rate(
        self, coordinates: Array, dofs: Array, direction: Array, **kwargs: Any
    ) -> Array:
        """Return the rates, along a variation, of the derivatives of a Lagrangian.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        direction : array (n, coordinates + data + parameters + 3 ndof)
            Variation of each of these and of the unknowns, adjoints of the unknowns, and the
            variation of these.
        **kwargs : array
            Data and parameters; see the class. Data of points are those of the page, their
            variation, adjoints of the history after the step, and the variation of these.

        Returns
        -------
        array (n, coordinates + data + parameters + ndof)
            Rates of the derivatives, by each of these, of adjoints times residual plus adjoints
            times history after the step.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        arguments = CallArguments(direction=direction, **kwargs)
        call = Call(self, "adjoint_rate", coordinates, dofs, arguments)
        design = direction.shape[1] - 2 * call.ndof
        return call.run(np.empty((call.n, design)))

    def point_adjoint_rate(
        self, coordinates: Array, dofs: Array, direction: Array, **kwargs: Any
    ) -> Array:
        """Return the rates of `adjoint_rate`, of the derivatives by the data of points.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        direction : array (n, coordinates + data + parameters + 3 ndof)
            As of `adjoint_rate`.
        **kwargs : array
            As of `adjoint_rate`.

        Returns
        -------
        array (n, points, data of points)
            Rates of the derivatives by the data of points of the page.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        arguments = CallArguments(direction=direction, **kwargs)
        call = Call(self, "point_adjoint_rate", coordinates, dofs, arguments)
        count = len(self.point_data) // 4
        return call.run(np.empty((call.n, len(call.rule.weights), count)))

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Return the fields at the quadrature points.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        array (n, points, fields)
            Values.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or the kernel has no such task.
        """
        call = Call(self, "fields", coordinates, dofs, CallArguments(**kwargs))
        return call.run(np.empty((call.n, len(call.rule.weights), len(call.kernel.fields))))

    def explain(
        self, coordinates: Array, dofs: Array, *, element: int = 0, **kwargs: Any
    ) -> Explanation:
        """Return every named value of the page in one element, and the first that has no value.

        Parameters
        ----------
        coordinates : array (n, coordinates)
            Nodal coordinates of the elements.
        dofs : array (n, ndof)
            Unknowns of the elements.
        element : int
            Number of the element.
        **kwargs : array
            Data and parameters; see the class.

        Returns
        -------
        Explanation
            Values at the quadrature points, with the lines of the page.

        Raises
        ------
        ArgumentError
            An array has a wrong shape, or there is no such element.
        ModelFileError
            The kernel comes from a folder: its page is not known to this process.
        SymPyNeededError
            SymPy is not installed.

        Notes
        -----
        The page is evaluated with 30 digits; the kernel is not called.
        """
        coordinates, dofs = (
            np.atleast_2d(np.asarray(a, dtype=np.float64)) for a in (coordinates, dofs)
        )
        task = next(t for t in ("residual", "tangent", *self.tasks) if t in self.tasks)
        n = len(dofs)
        if not -n <= element < n:
            raise ArgumentError(f"{self.name}: element = {element}; there are {n} elements")
        one = slice(element % n, element % n + 1)
        arguments = {
            k: v[one] if k in _OF_ELEMENTS else v for k, v in kwargs.items() if v is not None
        }
        call = Call(self, task, coordinates[one], dofs[one], CallArguments(**arguments))
        points, columns = len(call.rule.weights), len(self.data)
        data = call.read[2].ravel()
        at_points, terms = _split_terms(call.kernel, data[columns:].reshape(points, -1))
        state = ElementState(
            coordinates=call.read[0].ravel(),
            dofs=call.read[1].ravel(),
            data=data[:columns],
            parameters=call.read[3][: len(self.parameters)],
            point_data=at_points,
            rule=call.rule.table,
            basis=call.rule.shape_functions,
            arrays=tuple(unpacked(call.read[3], len(self.parameters), len(self.arrays))),
            term_history=terms,
        )
        return explanation(self.library.directory, self.name, state)


def _split_terms(kernel: Family, rows: Array) -> tuple[Array, tuple[tuple[Array, ...], ...]]:
    """Data of each point without history of terms, and this history."""
    if kernel.lengths is None:
        return rows, ()
    of = {a.name: n for a, n in zip(kernel.arrays, kernel.lengths, strict=True)}
    counts = [of[array] for _, array in kernel.term_history]
    first = rows.shape[1] - sum(counts)
    offsets = np.cumsum([first, *counts])
    pairs = list(pairwise(offsets))
    return rows[:, :first], tuple(tuple(row[a:b] for a, b in pairs) for row in rows)


_OF_ELEMENTS = ("data", "point_data")
"""Arguments of a call that have a row for each element."""


@cache
def load_kernel(name: str, directory: Path = GENERATED) -> Kernel:
    """The kernel family `name`; raises `KernelError` when it is missing or stale."""
    entries = manifest(directory)
    if name not in entries:
        raise MissingKernelsError(
            f"no kernel {name!r}; there are {', '.join(entries)}; a model file ends in .py, and a "
            "law by name is given as material=..."
        )
    library = library_of(directory)
    try:
        return _kernel(name, entries[name], library)
    except (KeyError, TypeError, ValueError):
        raise damaged_manifest(directory) from None


def _library_folder(library: Library) -> Path | None:
    """Folder of a library; None for the kernels that ship, which each installation has."""
    return None if library.directory == GENERATED else library.directory


def _reloaded(
    name: str, directory: Path | None, signature: str, lengths: tuple[int, ...] | None = None
) -> Kernel:
    """The kernel of that name and signature.  Raises `KernelError` where it is not there."""
    folder = GENERATED if directory is None else directory
    remedy = "run the script that made it again on this machine"
    if not (folder / "manifest.json").exists():
        raise MissingKernelsError(f"the kernel {name} is not in {folder}: {remedy}")
    kernel = load_kernel(name, folder)
    if kernel.signature != signature:
        raise StaleKernelsError(f"the kernel {name} in {folder} is another one now: {remedy}")
    return kernel.with_lengths(lengths)


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
        internal=tuple(entry.get("internal", ())),
        functions=tuple(entry.get("functions", ())),
        term_groups=tuple(map(tuple, entry.get("term_groups", ()))),
        term_history=tuple(entry.get("term_history", {}).items()),
        point_rates=entry.get("point_rates", False),
        cell=entry.get("cell", ""),
        kept=entry.get("kept", 0),
        coarse=entry.get("coarse", 0),
        arrays=tuple(_array(n, a) for n, a in entry.get("arrays", {}).items()),
    )


def _array(name: str, entry: Mapping[str, Any]) -> RunTimeArray:
    """The run-time array that an entry of a manifest describes."""
    options = {key: value for key, value in entry.items() if key not in ("meaning", "kind")}
    return RunTimeArray(name, entry["kind"], options)


def kernel_in(directory: Path, name: str | None = None, cell: str | None = None) -> Kernel:
    """The kernel of a folder of generated C; `name` is needed if it holds several.

    cell: on which a page of fields of that name stands.
    Raises `KernelError`, also when the folder has changed since this process loaded it.
    """
    entries = manifest(directory)
    stands = [n for n, entry in entries.items() if cell and entry.get("cell") == cell]
    if name is None and len(entries) > 1 and len(stands) != 1:
        raise MissingKernelsError(f"{directory.name} holds {', '.join(entries)}: name one of them")
    if name is None:
        selected = stands[0] if len(stands) == 1 else next(iter(entries))
    else:
        named = [n for n in stands if n in (f"{name}_{cell}", f"{name}_{cell}_axisymmetric")]
        selected = name if name in entries or not named else named[0]
    kernel = load_kernel(selected, directory)
    if not kernel.library.current:
        raise StaleKernelsError(
            f"{directory.name}/ has changed since it was loaded: start Python anew, or load the "
            "model file itself"
        )
    return kernel
