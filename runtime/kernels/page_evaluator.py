"""Evaluator of pages; the package `softehl` sets it, as the runtime has no compiler."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from softehl.runtime.kernels.explanation import ElementState


class PageEvaluator(Protocol):
    """Function that evaluates the page of a kernel; see `softehl.codegen.tools.page_evaluation`."""

    def __call__(
        self, folder: Path, kernel: str, state: ElementState
    ) -> tuple[list[tuple[str, tuple[float, ...], str]], str]:
        """Return name, values and line of each named value, and the fault."""
        ...


evaluate_page: PageEvaluator
"""The package sets it when it is imported."""
