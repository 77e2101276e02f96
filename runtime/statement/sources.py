"""The kernel of a page: by the front door, which knows when the generator is needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

from softehl.runtime.kernels import Kernel
from softehl.runtime.statement.pages import is_folder, require_page

Source: TypeAlias = "str | Path | Kernel | object"
"""A model file, a folder of generated C, the name of a shipped kernel, a kernel, a Definition, or a
function decorated by `softehl.page`."""


@dataclass(frozen=True)
class Origin:
    """Origin of kernels. model: one of several of a source. law: it is a stress law."""

    source: Any
    model: str | None
    geometry: str
    law: bool

    def loaded(self, kind: str | None) -> Kernel:
        """The kernel on a kind of cell; a kernel is there already."""
        if isinstance(self.source, Kernel):
            return self.source
        require_page(self.source)
        import softehl

        return softehl.load_kernel(
            self.source, self.model, cell=kind, geometry=self.geometry, materials=self.law
        )

    def differentiated(self, kernel: Kernel) -> Callable[[], Kernel] | None:
        """Maker of the kernel of derivatives of a page, which is derived when it is asked for."""
        if isinstance(self.source, Kernel) or is_folder(self.source):
            return None
        if "pseudo_load" in kernel.tasks and not kernel.point_data:
            return None  # it comes with what is needed
        import softehl

        return cache(
            lambda: softehl.load_kernel(
                self.source,
                self.model or (None if kernel.cell else kernel.name),
                cell=kernel.cell or None,
                geometry=self.geometry,
                materials=self.law,
                derivatives=True,
            )
        )
