"""Printer of device kernels and their compiler for the processor; `softehl` sets both.

The runtime has no compiler of pages.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from softehl.device_source import DeviceSource


class DeviceSourceOf(Protocol):
    """Function that prints the device kernels of a kernel of a library in a folder."""

    def __call__(self, folder: Path, kernel: str, real: str) -> DeviceSource:
        """Return them; raises `TargetError` for a page that a device cannot run."""
        ...


class EmulatedLibraryOf(Protocol):
    """Function that compiles device kernels for the processor; fibers: a thread is a fiber."""

    def __call__(self, source: DeviceSource, fibers: bool) -> Path:
        """Return the library; raises `BuildError` without a C++ compiler."""
        ...


device_source: DeviceSourceOf
emulated_library: EmulatedLibraryOf
"""The package sets both when it is imported."""
