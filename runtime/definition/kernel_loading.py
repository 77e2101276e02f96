"""Kernels of pages on kinds of cells, and kernels of their derivatives when they are needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from softehl.runtime.definition import page_loader
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.kernels.kernel import Kernel

Source: TypeAlias = "str | Path | Kernel | object"
"""A model file, a folder of generated C, the name of a shipped kernel, a kernel, a Definition, or a
function decorated by `softehl.page`."""


@dataclass(frozen=True)
class KernelOrigin:
    """Origin of kernels. model: one of several of a source. law: it is a stress law.

    cells: kinds of cells that an element of the library is for; empty for any. varying: parameters
    that become "data" of elements or "point data".
    """

    source: Any
    model: str | None
    geometry: str
    law: bool
    cells: tuple[str, ...] = ()
    varying: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(
        cls,
        block: str,
        source: Source,
        *,
        material: Source,
        element: str | None,
        model: str | None,
        geometry: str,
    ) -> KernelOrigin:
        """Return the origin of a page, an element of the library or a stress law.

        Raises StudyError unless one is given.
        """
        if [source, material, element].count(None) != 2:
            raise StudyError(f"{block!r}: give a page, element=... or material=..., one of them")
        if element is not None:
            file, cells = page_loader.element_file(element)
            return cls(file, model, geometry, law=False, cells=cells)
        if material is None:
            return cls(source, model, geometry, law=False)
        return cls(material, model, geometry, law=True)

    def loaded(self, kind: str | None) -> Kernel:
        """The kernel on a kind of cell; a kernel is there already."""
        if isinstance(self.source, Kernel):
            return self.source
        if self.cells and kind is not None and kind not in self.cells:
            raise StudyError(
                f"element {Path(self.source).stem!r} is for {', '.join(self.cells)}, not for {kind}"
            )
        require_page(self.source)
        return page_loader.load_page(
            self.source,
            self.model,
            cell=kind,
            geometry=self.geometry,
            materials=self.law,
            varying=dict(self.varying),
        )

    def differentiated(self, kernel: Kernel, order: int = 1) -> Callable[[], Kernel] | None:
        """Return the maker of the kernel of derivatives of a page, which derives it when called.

        order: of the derivatives of results, 1 or 2.
        """
        if isinstance(self.source, Kernel) or is_folder(self.source):
            return None
        if (
            order == 1
            and "pseudo_load" in kernel.tasks
            and not (kernel.point_data or kernel.term_history)
        ):
            return None  # it comes with what is needed
        return DerivativeKernel(self, kernel, order)

    def valued(self, kernel: Kernel) -> ValueKernel | None:
        """Return the maker of kernels of named values of a page; None without a page."""
        no_page = isinstance(self.source, Kernel) or is_folder(self.source)
        return None if no_page else ValueKernel(self, kernel)


@dataclass(frozen=True, eq=False)
class _PageKernel:
    """Maker of other kernels of the page of a kernel."""

    origin: KernelOrigin | None
    kernel: Kernel

    def __getstate__(self) -> dict[str, Any]:
        """For `pickle`: a page that stands in no file stays behind."""
        origin = self.origin
        if origin is not None and isinstance(origin.source, str | Path):
            in_file = str(origin.source).endswith(".py")
            source = Path(origin.source).absolute() if in_file else origin.source
            origin = replace(origin, source=source)
        else:
            origin = None
        named = (f.name for f in fields(self))  # without what is cached
        return {**{name: getattr(self, name) for name in named}, "origin": origin}

    def _made(self, what: str, *, derivatives: int = 0, values: tuple[str, ...] = ()) -> Kernel:
        """A kernel of the page.  Raises StudyError where the page is another one meanwhile."""
        if self.origin is None:
            raise StudyError(
                f"{what} of a study from a pickle need the page of {self.kernel.name}: add it "
                "from a model file"
            )
        if self._loaded(self.origin).signature != self.kernel.signature:
            raise StudyError(
                f"the page of {self.kernel.name} is another one than the study was made with, and "
                f"{what} would be those of another model: make the study again"
            )
        return self._loaded(self.origin, derivatives, values)

    def _loaded(
        self, origin: KernelOrigin, derivatives: int = 0, values: tuple[str, ...] = ()
    ) -> Kernel:
        kernel = self.kernel
        return page_loader.load_page(
            origin.source,
            origin.model or (None if kernel.cell else kernel.name),
            cell=kernel.cell or None,
            geometry=origin.geometry,
            materials=origin.law,
            derivatives=derivatives,
            varying=dict(origin.varying),
            values=values,
        )


@dataclass(frozen=True, eq=False)
class DerivativeKernel(_PageKernel):
    """Maker of the kernel of derivatives, of order 1 or 2, of the page of a kernel."""

    order: int = 1

    def __call__(self) -> Kernel:
        """That kernel.  Raises StudyError where the page is another one meanwhile."""
        return self._kernel

    @cached_property
    def _kernel(self) -> Kernel:
        return self._made("derivatives", derivatives=self.order)


@dataclass(frozen=True, eq=False)
class ValueKernel(_PageKernel):
    """Maker of kernels whose fields are named values of the page."""

    def __call__(self, names: tuple[str, ...]) -> Kernel:
        """The kernel with these fields.  Raises StudyError, ModelError for another name."""
        return self._made("values", values=names)


def is_folder(source: object) -> bool:
    """True for a folder of C, from which nothing can be derived."""
    return isinstance(source, str | Path) and Path(source).is_dir()


def require_page(source: object) -> None:
    """Raise StudyError for a source that is no page."""
    if isinstance(source, str | Path) or hasattr(source, "at_point"):
        return
    if callable(source) or hasattr(source, "finish") or not hasattr(source, "unknowns"):
        name = getattr(source, "__name__", type(source).__name__)
        hint = f", or what {name} returns when it is called" if callable(source) else ""
        raise StudyError(
            f"{type(source).__name__} is no page: give a model file, a function under "
            f"@softehl.page, a kernel, a Definition that m.finish() made{hint}"
        )
