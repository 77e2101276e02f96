"""Shared libraries of compiled kernels: finding, loading and calling them by cffi.

A folder holds generated C, its `manifest.json` and the shared library that was built from it.  Of
the kernels that ship the library is one tuned to the processor (`native_build`), or where there is
none the plain one of the wheel.  No library is opened before its SHA-256 is that in the file beside
it.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import sys
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cffi

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array
from softehl.runtime.kernels import native_build

GENERATED = Path(__file__).resolve().parents[2] / "generated"
LIBRARY = "kernels" + (sysconfig.get_config_var("SHLIB_SUFFIX") or ".so")
DIGEST = f"{LIBRARY}.sha256"

_SIGNATURE = (
    "(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *, const double *, const double *,"
    " const double *, const double *, const double *, const double *, double *, double *);"
)
_ACTION = (
    "(ptrdiff_t, ptrdiff_t, const double *, const double *, const int *, const double *, double *);"
)
_COARSE = "(ptrdiff_t, ptrdiff_t, const double *, const double *, double *, double *);"
_ffi = cffi.FFI()
_INTS = _ffi.typeof("int[]")
_DOUBLES = _ffi.typeof("double[]")
_ffi.cdef("const char *softehl_signature(void);")

Function = Callable[[tuple[int, int, int], Sequence[Array], Array, "Array | None"], None]
"""counts (elements, points, modes), arrays that are read, values and tangent that are written; the
order and the shapes are those of `codegen/abi.py`."""


Action = Callable[[tuple[int, int], Array, Array, Any, Array, Array], None]
"""Elements (first, last), parameters, what was kept, node numbers, x, and y, which it adds to."""


Coarse = Callable[[tuple[int, int], Array, Array, Array, Array], None]
"""Elements (first, last), parameters, what was kept, and the diagonals and tangents it writes."""


class KernelError(SoftehlError, RuntimeError):
    """Error: a kernel cannot be used; the message gives the remedy."""


class MissingKernelsError(KernelError):
    """The library has not been built, or has no such kernel."""


class StaleKernelsError(KernelError):
    """The library was built from other C than what stands in its folder now, or is damaged."""


@dataclass(frozen=True, eq=False)
class Library:
    """The shared library of a folder of C, loaded.

    kind: "tuned" (to the processor of this machine) or "plain" (for all of its platform).
    reason: why it is not tuned; empty if it is.
    """

    directory: Path
    loaded: Any
    path: Path
    kind: str = "tuned"
    reason: str = ""

    def function(self, kernel: str, task: str) -> Function:
        """The C function of a task of a kernel."""
        function = self._plain(kernel, task)

        def call(
            counts: tuple[int, int, int],
            read: Sequence[Array],
            values: Array,
            tangent: Array | None,
        ) -> None:
            elements, points, modes = counts
            function(
                elements,
                points,
                modes,
                *map(_pointer, read),
                _pointer(values),
                _ffi.NULL if tangent is None else _pointer(tangent),
            )

        return call

    def again(
        self, kernel: str, task: str, counts: tuple[int, int, int], read: Sequence[Array]
    ) -> Callable[[Array, Array, Array | None], None]:
        """A task whose arrays stay where they are but for the unknowns, the second that it reads:
        a function of these, of the values and of the tangent that it writes.
        """
        function = self._plain(kernel, task)
        elements, points, modes = counts
        first, *others = (_pointer(array) for k, array in enumerate(read) if k != 1)

        def call(dofs: Array, values: Array, tangent: Array | None) -> None:
            written = _ffi.NULL if tangent is None else _pointer(tangent)
            unknowns, result = _pointer(dofs), _pointer(values)
            function(elements, points, modes, first, unknowns, *others, result, written)

        return call

    def action(self, kernel: str) -> Action:
        """The C function of products by sum factorisation (`sum_factored_product`)."""
        name = f"softehl_{kernel}_action"
        _declare(name, _ACTION)
        function = getattr(self.loaded, name)

        def call(
            span: tuple[int, int], parameters: Array, cached: Array, index: Any, x: Array, y: Array
        ) -> None:
            begin, end = span
            numbers, data = _ffi.from_buffer(_INTS, index), (_pointer(parameters), _pointer(cached))
            function(begin, end, data[0], data[1], numbers, _pointer(x), _pointer(y))

        return call

    def coarse(self, kernel: str) -> Coarse:
        """The C function of tangents at a lower order (`codegen.emit.points.coarse_tangent`)."""
        name = f"softehl_{kernel}_coarse"
        _declare(name, _COARSE)
        function = getattr(self.loaded, name)

        def call(
            span: tuple[int, int], parameters: Array, cached: Array, diagonals: Array, low: Array
        ) -> None:
            function(*span, *map(_pointer, (parameters, cached, diagonals, low)))

        return call

    @property
    def current(self) -> bool:
        """True if it was built from the sources that its folder holds now."""
        built_from: bytes = _ffi.string(self.loaded.softehl_signature())
        return built_from.decode() == _sources_signature(self.directory)

    def _plain(self, kernel: str, task: str) -> Any:
        """As it is: for pointers."""
        name = f"softehl_{kernel}_{task}"
        _declare(name)
        return getattr(self.loaded, name)

    def close(self) -> None:
        """Unload it."""
        _ffi.dlclose(self.loaded)


@cache
def manifest(directory: Path = GENERATED) -> dict[str, Any]:
    """Kernel families of a directory of generated C, by name.  Raises `KernelError`."""
    path = directory / "manifest.json"
    if not path.exists():
        raise MissingKernelsError(f"{path} is missing: run `softehl generate`")
    try:
        kernels = json.loads(path.read_text(encoding="utf-8"))["kernels"]
        if all("tasks" in entry for entry in kernels.values()):
            return dict(kernels)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass
    raise damaged_manifest(directory)


def damaged_manifest(directory: Path) -> StaleKernelsError:
    """The error of a manifest that cannot be understood."""
    path = directory / "manifest.json"
    return StaleKernelsError(f"{path} is damaged: {_remedy(directory)}")


def library_of(directory: Path = GENERATED) -> Library:
    """Library of a folder; for the shipped kernels the best one available.

    Raises `KernelError` when it is missing, stale or damaged.
    """
    return _library_of(directory)


@cache
def _library_of(directory: Path) -> Library:
    if directory != GENERATED:
        return _opened(directory / LIBRARY, directory)
    try:
        return _opened(native_build.tuned(), directory, "set SOFTEHL_CACHE to another folder")
    except (KernelError, native_build.NotTunedError) as error:
        reason = " ".join(str(error).split())
        expected = isinstance(error, native_build.NotTunedError) and error.expected
    if not (directory / DIGEST).exists():
        raise MissingKernelsError(f"the kernels are not built, nor are there plain ones: {reason}")
    if not expected and multiprocessing.parent_process() is None:
        print(f"softehl: the plain kernels are used: {reason}", file=sys.stderr)
    return replace(_opened(directory / LIBRARY, directory), kind="plain", reason=reason)


def _opened(path: Path, directory: Path, remedy: str = "") -> Library:
    """Open a library that is whole and was built from the C of a directory."""
    remedy = remedy or _remedy(directory)
    if not path.exists():
        raise MissingKernelsError(f"the kernels are not built: {remedy}")
    if not _has_digest(path):
        raise StaleKernelsError(f"{path} or the digest beside it is damaged: {remedy}")
    try:
        manifest(directory)
        library = Library(directory, _ffi.dlopen(str(path)), path)
        current = library.current
    except (OSError, AttributeError, UnicodeError, cffi.CDefError) as error:
        reason = " ".join(str(error).split())
        raise StaleKernelsError(f"{path} cannot be used ({reason}): {remedy}") from None
    if not current:
        library.close()
        raise StaleKernelsError(
            f"{path.name} was built from other sources than {directory.name}/ holds now: {remedy}"
        )
    return library


def _has_digest(path: Path) -> bool:
    """True if the file beside a library has its SHA-256."""
    try:
        digest = path.with_name(DIGEST).read_text(encoding="ascii").split()
        return digest[:1] == [hashlib.sha256(path.read_bytes()).hexdigest()]
    except (OSError, UnicodeDecodeError):
        return False


def _remedy(directory: Path) -> str:
    return (
        "install softehl anew"
        if directory == GENERATED
        else "run `softehl generate` with its model file"
    )


def _pointer(array: Array) -> Any:
    """Pointer to an array that is contiguous in memory; raises otherwise."""
    return _ffi.from_buffer(_DOUBLES, array)


def _sources_signature(directory: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(directory.glob("*.[ch]")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def _declare(name: str, signature: str = _SIGNATURE) -> None:
    """Declare a C function to cffi; declaring all of them at once takes half a second."""
    _ffi.cdef(f"void {name}{signature}")
