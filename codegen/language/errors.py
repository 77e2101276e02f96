"""Errors and warnings about a model, with its file and line."""

from __future__ import annotations

import sys
import warnings
from functools import cache
from pathlib import Path
from types import FrameType

from softehl.errors import SoftehlError


class ModelError(SoftehlError, ValueError):
    """A model has something that no kernel can hold; the message names it and its line.

    `where` is the file and line; left out, it is found among the callers: the first one that is
    not the generator itself (a model that ships is a model like any other). text: without it.
    """

    def __init__(self, message: str, where: str | None = None) -> None:
        self.where, self.text = where or page_line(), message
        super().__init__(f"{self.where}: {message}" if self.where else message)


_CODEGEN = Path(__file__).resolve().parents[1]


def page_line() -> str:
    """File and line of the model that is being read, e.g. `my_model.py:12`."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        path = _page_file(frame.f_code.co_filename)
        if path:
            return f"{path}:{frame.f_lineno}"
        frame = frame.f_back
    return ""


@cache
def _page_file(filename: str) -> str:
    """Path of a file of code that may be a page; empty for the generator and for SymPy."""
    path = Path(filename).resolve()
    internal = path.is_relative_to(_CODEGEN) and not path.is_relative_to(_CODEGEN / "models")
    return "" if internal or "sympy" in path.parts or path.name.startswith("<") else str(path)


class ModelWarning(UserWarning):
    """A model has something that is allowed, but seldom intended."""


_WARNED: dict[str | tuple[str, type[Warning], int], int] = {}
"""What Python's warnings remember, so that a model that is read again does not warn again."""


def warn_page(message: str) -> None:
    """A `ModelWarning` with the model's line."""
    file, _, line = page_line().rpartition(":")
    warnings.warn_explicit(message, ModelWarning, file, int(line or 0), registry=_WARNED)


class NeedsElementError(ModelError):
    """Error of a weak form that needs quantities of the whole element."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}: known in cells only, not on sides and not at a point alone")


class PointwiseError(ModelError):
    """Error of a quantity of the whole element that varies with the point."""

    pointwise = True


class NoEquationsError(ModelError):
    """A model states no equations."""


class WrongDomainError(ModelError):
    """A weak form is not for cells, or not for facets; another one of its file may be."""

    @classmethod
    def no_facet(cls, what: str, cell: str) -> WrongDomainError:
        """Error for a quantity of facets that a weak form uses on a cell."""
        return cls(f'{what}: {cell} is a cell here; facets are on="interior" and sides of a mesh')

    @classmethod
    def no_pair(cls, what: str) -> WrongDomainError:
        """Error for a quantity of pairs that another weak form uses."""
        return cls(f"{what}: only a law of contact has it, study.contact(..., law=page)")
