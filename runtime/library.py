"""Where compiled kernels are found, and calls into them: the only module that knows cffi.

A folder holds generated C, its `manifest.json` and the shared library that was built from it.
"""

from __future__ import annotations

import hashlib
import json
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cffi

from softehl.runtime.arrays import Array

GENERATED = Path(__file__).resolve().parent.parent / "generated"
LIBRARY = "kernels" + (sysconfig.get_config_var("SHLIB_SUFFIX") or ".so")
REMEDY = "run `python -m softehl.codegen.tools.build` (make does it)"
REMEDY_OF_OTHERS = "run `softehl generate` with its model file"

_SIGNATURE = (
    "(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *, const double *, const double *,"
    " const double *, const double *, const double *, const double *, double *, double *);"
)
_ffi = cffi.FFI()

Function = Callable[[tuple[int, int, int], Sequence[Array], Array, "Array | None"], None]
"""counts (elements, points, modes), arrays that are read, values and tangent that are written; the
order and the shapes are those of `codegen/abi.py`."""


class KernelError(RuntimeError):
    """A kernel cannot be used; the message says what to do."""


class MissingKernelsError(KernelError):
    """The library has not been built, or has no such kernel."""


class StaleKernelsError(KernelError):
    """The library was built from other C than what stands in its folder now."""


@dataclass(frozen=True, eq=False)
class Library:
    """The shared library of a folder, loaded."""

    directory: Path
    loaded: Any

    def function(self, kernel: str, task: str) -> Function:
        """The C function of a task of a kernel."""
        function = getattr(self.loaded, f"softehl_{kernel}_{task}")

        def call(
            counts: tuple[int, int, int],
            read: Sequence[Array],
            values: Array,
            tangent: Array | None,
        ) -> None:
            function(
                *counts,
                *(_pointer(array, "const double *") for array in read),
                _pointer(values, "double *"),
                _ffi.NULL if tangent is None else _pointer(tangent, "double *"),
            )

        return call

    @property
    def current(self) -> bool:
        """Whether it was built from the sources that its folder holds now."""
        built_from: bytes = _ffi.string(self.loaded.softehl_signature())
        return built_from.decode() == _sources_signature(self.directory)

    def close(self) -> None:
        """Unload it."""
        _ffi.dlclose(self.loaded)


@cache
def manifest(directory: Path = GENERATED) -> dict[str, Any]:
    """Kernel families of a directory of generated C, by name."""
    path = directory / "manifest.json"
    if not path.exists():
        raise MissingKernelsError(f"{path} is missing: run `softehl generate`")
    kernels: dict[str, Any] = json.loads(path.read_text())["kernels"]
    return kernels


@cache
def library_of(directory: Path) -> Library:
    """The library of a folder; raises `KernelError` when it is missing or stale."""
    path = directory / LIBRARY
    remedy = REMEDY if directory == GENERATED else REMEDY_OF_OTHERS
    if not path.exists():
        raise MissingKernelsError(f"the kernels are not built: {remedy}")
    _ffi.cdef(_declarations(directory), override=True)
    library = Library(directory, _ffi.dlopen(str(path)))
    if not library.current:
        library.close()
        raise StaleKernelsError(
            f"{path.name} was built from other sources than {directory.name}/ holds now: {remedy}"
        )
    return library


def _pointer(array: Array, kind: str) -> Any:
    return _ffi.cast(kind, array.ctypes.data)


def _sources_signature(directory: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(directory.glob("*.[ch]")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _declarations(directory: Path) -> str:
    functions = [
        f"void softehl_{name}_{task}{_SIGNATURE}"
        for name, entry in manifest(directory).items()
        for task in entry["tasks"]
    ]
    return "\n".join([*functions, "const char *softehl_signature(void);"])
