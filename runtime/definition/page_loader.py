"""Loader of kernels from pages; the package `softehl` sets it, as the runtime has no compiler."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from softehl.runtime.kernels.kernel import Kernel


class PageLoader(Protocol):
    """Function that derives, compiles and loads the kernel of a page; see `softehl.load_kernel`."""

    def __call__(
        self,
        source: Any,
        name: str | None = None,
        *,
        cell: str | None = None,
        geometry: str | None = None,
        materials: bool = False,
        derivatives: int = 0,
        varying: Mapping[str, str] | None = None,
        values: tuple[str, ...] = (),
    ) -> Kernel:
        """Return the kernel."""
        ...


class LibraryEntry(Protocol):
    """Function that finds an element of the library."""

    def __call__(self, name: str) -> tuple[Path, tuple[str, ...]]:
        """Return model file and kinds of cells, empty for any; raises SoftehlError if none."""
        ...


element_file: LibraryEntry
"""The package sets it when it is imported."""
load_page: PageLoader
"""`softehl.load_kernel`; the package sets it when it is imported."""
stress_page: Path
"""Model file of a body whose stress is data of its points; the package sets it."""
