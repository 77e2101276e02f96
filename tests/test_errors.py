"""Errors: one base, what they are besides, and their way out of a process of a pool."""

from __future__ import annotations

import ast
import importlib
import pickle
from pathlib import Path

import numpy as np
import pytest

import softehl
from softehl import SoftehlError
from softehl.codegen.language.errors import ModelError
from softehl.runtime.solve.solution import NotConverged, Solution, Status

ROOT = Path(__file__).parents[1]
INNER = {"OutOfTimeError", "NotRealError", "DomainError", "StageError", "_CycleError"}
"""Caught where they are raised for."""
WRAPPED = {
    "a MeshError that names the file": {"AbaqusError", "GmshError", "UnvError"},
    "a pydantic.ValidationError that names the key": {"NotUnderstoodError", "OutlineError"},
    "another library, or engine": {"NoProductError", "NotTunedError"},
    "nothing: a fault of the compiler": {"IllegalGraphError"},
}
"""Errors that become others before they reach a user."""


def errors_of(path: Path) -> list[type[Exception]]:
    """Classes of errors that a file defines."""
    classes = [n for n in ast.parse(path.read_text("utf-8")).body if isinstance(n, ast.ClassDef)]
    names = [c.name for c in classes if any("Error" in n or "Exception" in n for n in bases(c))]
    dotted = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    found = [getattr(importlib.import_module(f"softehl.{dotted}"), name) for name in names]
    return [kind for kind in found if issubclass(kind, Exception) and kind.__name__ not in INNER]


def bases(kind: ast.ClassDef) -> list[str]:
    return [ast.unparse(base) for base in kind.bases]


def test_all_errors_have_one_base() -> None:
    files = [p for room in ("codegen", "runtime", "cases") for p in (ROOT / room).rglob("*.py")]
    found = [kind for path in files for kind in errors_of(path)]
    assert [kind for kind in found if not issubclass(kind, SoftehlError)] == []
    assert len(found) > 20
    public = {getattr(softehl, name) for name in softehl.__all__} - {SoftehlError}
    wrapped = set().union(*WRAPPED.values())
    inner = {kind.__name__ for kind in found if not public & {*kind.__mro__}}
    assert inner == wrapped


@pytest.mark.parametrize(
    ("name", "base"),
    [
        ("StudyError", ValueError),
        ("MeshError", ValueError),
        ("ModelError", ValueError),
        ("ProblemError", ValueError),
        ("NotConverged", RuntimeError),
        ("KernelError", RuntimeError),
        ("SymPyNeededError", ModuleNotFoundError),
    ],
)
def test_public_errors_are_errors_of_python(name: str, base: type[Exception]) -> None:
    assert issubclass(getattr(softehl, name), (base,))


def test_errors_are_pickled_with_what_they_know() -> None:
    solution = Solution(np.ones(2), Status.DIVERGED, "it grew", (1.0, 9.0), 1, 1)
    error = pickle.loads(pickle.dumps(NotConverged(solution, "the last result")))
    assert str(error) == str(NotConverged(solution))
    assert (error.result.message, error.reached) == ("it grew", "the last result")
    wrong = pickle.loads(pickle.dumps(ModelError("no", "page.py:3")))
    assert (str(wrong), wrong.where, wrong.text) == ("page.py:3: no", "page.py:3", "no")
