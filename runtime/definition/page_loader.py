"""Loader of kernels from pages; the package `softehl` sets it, as the runtime has no compiler."""

from __future__ import annotations

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
    ) -> Kernel:
        """Return the kernel."""
        ...


load_page: PageLoader
"""`softehl.load_kernel`; the package sets it when it is imported."""
