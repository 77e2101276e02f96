"""Compiled device kernels: on a GPU by CuPy and NVRTC, or emulated by a C++ compiler.

Both have the module `xp` of their arrays, NumPy or CuPy, and start kernels by name.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from softehl.device_source import DeviceSource
from softehl.errors import SoftehlError
from softehl.runtime.device import device_printer

DEVICES = ("cuda", "emulated")


class DeviceError(SoftehlError, RuntimeError):
    """A device, or what it needs, is missing; the message says what to do."""


class DeviceModule:
    """Compiled kernels of a source, and arrays where they run.

    xp: module of the arrays, NumPy or CuPy.
    """

    def __init__(self, source: DeviceSource, xp: Any) -> None:
        self.source, self.xp = source, xp

    def launch(self, kernel: str, n: int, arrays: Sequence[Any]) -> None:
        """Run a kernel for n elements with its arrays; None is a null pointer."""
        raise NotImplementedError

    def array(self, a: Any) -> Any:
        """An array of the device with the values of one of the host."""
        return self.xp.asarray(np.ascontiguousarray(a))

    def real(self, a: Any) -> Any:
        """An array of the device in the precision of the kernels."""
        return self.array(np.asarray(a, dtype=self.source.real))

    def zeros(self, *shape: int) -> Any:
        """An array of zeros in the precision of the kernels."""
        return self.xp.zeros(shape, dtype=self.source.real)

    def host(self, a: Any) -> Any:
        """An array of the host with the values of one of the device."""
        return np.asarray(a)

    def sparse(self, A: csr_array) -> Any:
        """A sparse matrix of the device."""
        return A


class EmulatedModule(DeviceModule):
    """The kernels compiled as C++, one block of threads after the other; arrays of NumPy."""

    def __init__(self, source: DeviceSource, *, fibers: bool = False) -> None:
        super().__init__(source, np)
        self._fibers = fibers
        self._library = ctypes.CDLL(str(device_printer.emulated_library(source, fibers)))

    def launch(
        self, kernel: str, n: int, arrays: Sequence[Any], *, backwards: bool = False
    ) -> None:
        """See `DeviceModule`; backwards: the order of the threads of fibers."""
        pointers = [None if a is None else ctypes.c_void_p(a.ctypes.data) for a in arrays]
        function = getattr(self._library, kernel)
        if self._fibers:
            place = ctypes.cast(function, ctypes.c_void_p)
            given = (ctypes.c_void_p * len(pointers))(*pointers)
            for block in range(self.source.blocks(n)):
                self._library.softehl_block(
                    place, block, self.source.threads, n, given, len(pointers), int(backwards)
                )
            return
        function.restype = None
        for block in range(self.source.blocks(n)):
            function(ctypes.c_int(block), ctypes.c_int(n), *pointers)


class CudaModule(DeviceModule):
    """The kernels compiled by NVRTC for the current GPU; arrays of CuPy."""

    def __init__(self, source: DeviceSource) -> None:
        super().__init__(source, import_cupy())

    @cached_property
    def _module(self) -> Any:
        return self.xp.RawModule(code=self.source.joined, options=OPTIONS)

    def launch(self, kernel: str, n: int, arrays: Sequence[Any]) -> None:
        """See `DeviceModule`."""
        given = [np.uintp(0) if a is None else a for a in arrays]
        function = self._module.get_function(kernel)
        if not n:
            return  # CUDA refuses a grid of no blocks
        function((self.source.blocks(n),), (self.source.threads,), (np.int32(n), *given))

    def host(self, a: Any) -> Any:
        """See `DeviceModule`."""
        return self.xp.asnumpy(a)

    def sparse(self, A: csr_array) -> Any:
        """See `DeviceModule`."""
        from cupyx.scipy.sparse import csr_matrix

        parts = tuple(self.array(a) for a in (A.data, A.indices, A.indptr))
        return csr_matrix(parts, shape=A.shape)


OPTIONS = ("-std=c++17", "-default-device")
"""Of NVRTC."""


def device_module(source: DeviceSource, device: str) -> DeviceModule:
    """The kernels on a device of `DEVICES`.  Raises DeviceError."""
    return CudaModule(source) if device == "cuda" else EmulatedModule(source)


def import_cupy() -> Any:
    """CuPy where there is a GPU.  Raises DeviceError."""
    hint = "pip install 'softehl[cuda]' on a machine with a GPU, or take device = \"emulated\""
    try:
        import cupy
    except ImportError as error:
        raise DeviceError(f'device = "cuda": CuPy is missing ({error}): {hint}') from None
    try:
        count = cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        raise DeviceError(f'device = "cuda": there is no GPU ({error}): {hint}') from None
    if not count:
        raise DeviceError(f'device = "cuda": there is no GPU: {hint}')
    return cupy
