"""Loader of the models in a user's file.

A model file is ordinary Python and is *run* to obtain its models: run only files you trust, as you
would with any script.  Its models are

- the functions of the file that take no argument and are annotated `-> Definition`,
- the names of the file that hold a `Definition`, and
- the functions decorated by `softehl.page`, on each cell that is asked for,

in the order in which they are written.  Where there is none of these, or where they are asked for,
the models are bodies of its materials (`@softehl.material`), which hosts take by themselves.  Where
the file has a mapping or list `MODELS` (of such functions or definitions), those alone.  Names that
begin with an underscore are left out.
"""

from __future__ import annotations

import inspect
import math
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any

from sympy.matrices import ShapeError

from softehl.codegen.language import named_symbols
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError, WrongDomainError
from softehl.codegen.language.material import Law
from softehl.codegen.language.model import Model
from softehl.codegen.language.model_builder import varying_parameters
from softehl.codegen.language.weak_form import DEFAULT_CELL, CellOptions, Page
from softehl.codegen.tools.import_record import FilesRead, code_of, imports_from
from softehl.codegen.tools.model_text import ModelFileError, read
from softehl.system import name_fault

_RECIPE = (
    "write `def my_model() -> Definition:` that ends in `return m.finish()`, or `@softehl.page` "
    "above `def my_page(m):`"
)
_TRUTH = (
    "a condition on symbols is neither true nor false while the page is read: write a branch as "
    "sp.Piecewise((value, condition), (other, True))"
)


_NUMERIC = re.compile(r"no callable \w+ method|[Cc]annot convert expression to float")
_FUNCTION = re.compile(r"\b(math|np|numpy)\.(\w+)")
_IN_SYMPY = {"fabs": "Abs", "abs": "Abs", "absolute": "Abs", "pow": "Pow", "power": "Pow"} | {
    f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "tan2")
}


def definitions(path: Path, on: CellOptions = DEFAULT_CELL) -> list[Definition]:
    """The models of a file, which is run; raises `ModelFileError`.

    on: where its weak forms stand.
    """
    return definitions_and_inputs(path, on)[0]


def definitions_and_inputs(
    path: Path, on: CellOptions = DEFAULT_CELL
) -> tuple[list[Definition], FilesRead]:
    """As `definitions`, with what the run has read."""
    definitions, inputs = _pages_and_inputs(path, on, laws_only=False)
    return [d for d in definitions if isinstance(d, Definition)], inputs


def pages(path: Path, on: CellOptions = DEFAULT_CELL) -> list[Definition | Law]:
    """The models and the materials of a file, which is run; raises `ModelFileError`."""
    return _pages_and_inputs(path, on, laws_only=True)[0]


def _pages_and_inputs(
    path: Path, on: CellOptions, *, laws_only: bool
) -> tuple[list[Definition | Law], FilesRead]:
    """Models of a file; its materials as laws, or as bodies if it has no models."""
    path = path.resolve()
    text = read(path)
    with imports_from(path.parent) as inputs, _errors_of(path):
        entries = _entries(path, _run(path, text, inputs))
        laws = [entry for entry in entries if isinstance(entry, Law)]
        others = [entry for entry in entries if not isinstance(entry, Law)]
        if on.materials and not laws:
            raise ModelFileError(
                f"{path.name} has no material: write `@softehl.material` above `def my_law(m):`"
            )
        if not (laws_only or others or on.cells) and laws:
            raise ModelFileError(
                f"{path.name} has materials only, which have no kernel of their own: give a --cell "
                "for bodies of them, or a --target that takes materials"
            )
        if not laws_only:
            entries = others if others and not on.materials else [law.page() for law in laws]
        with varying_parameters(on.varying):
            pages = _make_all(entries, on)
    if not pages:
        raise ModelFileError(f"{path.name} has no model: {_RECIPE}")
    check_names(path.name, pages)
    return pages, inputs


def written_out(
    path: Path, seconds: float = math.inf, on: CellOptions = DEFAULT_CELL
) -> dict[str, Definition]:
    """The models of a file that is run again, with names as `language.named_symbols.ExpandedName`.

    A model that loses a dependence through a name, because SymPy took it for a constant, says
    something else then. Empty where SymPy cannot do with such names what the model asks for, or not
    in so many seconds.
    """
    try:
        with named_symbols.written_out(), redirect_stdout(StringIO()), _at_most(seconds):
            return {d.name: d for d in definitions(path, on)}
    except (ModelFileError, RecursionError, _Over):
        return {}


class _Over(BaseException):
    """Time is over."""


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """End what takes longer, at its next call of a function: SymPy may look at a tree for hours."""
    deadline, previous = perf_counter() + seconds, sys.getprofile()

    def watch(*_: Any) -> None:
        if perf_counter() > deadline:
            raise _Over

    sys.setprofile(watch)
    try:
        yield
    finally:
        sys.setprofile(previous)


def check_names(where: str, models: Iterable[Definition | Law]) -> None:
    """Raise `ModelFileError` unless the names are different, and names of files everywhere."""
    seen: set[str] = set()
    for d in models:
        require_file_name(d.name)
        if d.name in seen:
            raise ModelFileError(f"{where}: two models are called {d.name}; rename one")
        seen.add(d.name)


def require_file_name(name: str) -> None:
    """Raise `ModelFileError` for a name of a model that no file can have on some system."""
    fault = name_fault(f"{name}.c")
    if fault:
        raise ModelFileError(f"{name} cannot name a model, whose files are called so: {fault}")


# ------------------------------------------------------------------------------------- running it


def _run(path: Path, text: str, inputs: FilesRead) -> ModuleType:
    module = ModuleType(f"softehl_model_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses look there; removed with the neighbours
    exec(code_of(path, text, inputs), module.__dict__)
    return module


def _entries(path: Path, module: ModuleType) -> list[Any]:
    listed_models = getattr(module, "MODELS", None)
    if listed_models is not None:
        return list(listed_models.values() if isinstance(listed_models, Mapping) else listed_models)
    public = [(k, v) for k, v in vars(module).items() if not k.startswith("_")]
    kinds = Definition | Page | Law
    entries = [v for _, v in public if isinstance(v, kinds) or _makes_a_model(module, v)]
    if not entries:
        bare = [k for k, v in public if _own_function(module, v) and _annotation(v) is None]
        if bare:
            raise ModelFileError(
                f"{path.name} has no model: annotate `def {bare[0]}() -> Definition:` if it is one"
            )
    return entries


def _own_function(module: ModuleType, value: Any) -> bool:
    return (
        inspect.isfunction(value)
        and value.__module__ == module.__name__
        and not inspect.signature(value).parameters
    )


def _annotation(function: Callable[..., Any]) -> Any:
    return inspect.get_annotations(function).get("return")


def _makes_a_model(module: ModuleType, value: Any) -> bool:
    if not _own_function(module, value):
        return False
    annotation = _annotation(value)
    if isinstance(annotation, str):
        return annotation.strip("\"' ").rpartition(".")[2] == Definition.__name__
    return annotation is Definition


def _make_all(entries: Iterable[Any], on: CellOptions) -> list[Definition | Law]:
    """All models that fit the cell.  Raises WrongDomainError if none does."""
    made: list[Definition | Law] = []
    refused: list[WrongDomainError] = []
    for entry in entries:
        try:
            made += _made(entry, on)
        except WrongDomainError as error:
            refused.append(error)
    if refused and not made:
        raise refused[0]
    return made


def _made(entry: Any, on: CellOptions) -> list[Definition | Law]:
    if isinstance(entry, Page):
        return [*entry.definitions(on)]
    made = entry() if callable(entry) else entry
    if not isinstance(made, (Definition, Law)):
        label = getattr(entry, "__name__", repr(entry))
        code = getattr(entry, "__code__", None)
        where = f"{Path(code.co_filename).name}:{code.co_firstlineno}: " if code else ""
        what = "a Model that is not finished" if isinstance(made, Model) else type(made).__name__
        raise ModelFileError(f"{where}{label} gives {what}, not a Definition: {_RECIPE}")
    return [made]


@contextmanager
def errors_of(page: Page) -> Iterator[None]:
    """As for a model file, what went wrong while a model of a script ran; ModelError stays."""
    try:
        yield
    except ModelError:
        raise
    except Exception as error:
        with _errors_of(Path(page.code.co_filename)):
            raise error


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    """Report an exception of a model in one line, with the line of the model."""
    try:
        yield
    except ModelFileError:
        raise
    except SyntaxError as error:
        where = f"{Path(error.filename or path).name}:{error.lineno}"
        raise ModelFileError(f"{where}: {error.msg}") from error
    except Exception as error:
        what = str(error) or "no further words"
        if isinstance(error, RecursionError):
            what = "nested too deeply for SymPy: name parts of it with m.define"
        if isinstance(error, ModelError) and what.startswith(str(path.parent)):
            raise ModelFileError(what) from error  # it has found its line itself
        kind = "" if isinstance(error, ModelError) else f"{type(error).__name__}: "
        where, written = _line(path, error)
        if isinstance(error, TypeError) and "truth value of Relational" in what:
            kind, what = "", _TRUTH
        if isinstance(error, TypeError) and ("'list'" in what or "sequence by" in what):
            what += " (m.parameters, m.data and m.rates give a list: (mu,) = m.parameters(...))"
        if isinstance(error, ShapeError):
            what += " (m.grad(u) has as many columns as the mesh has dimensions; "
            what += "m.deformation_gradient(u) is 3 x 3)"
        if isinstance(error, TypeError) and _NUMERIC.search(what):
            function = _FUNCTION.search(written)
            use = f"sp.{_IN_SYMPY.get(function[2], function[2])}" if function else "those of sympy"
            called = function[0] if function else "a function of math or NumPy"
            kind, what = "", f"{called} computes with numbers, not with symbols: use {use}"
        raise ModelFileError(f"{where}: {kind}{what}") from error


def _line(path: Path, error: BaseException) -> tuple[str, str]:
    """File, line and text of the innermost frame in the folder of the model."""
    frames = traceback.extract_tb(error.__traceback__)
    in_folder = [f for f in frames if Path(f.filename).is_relative_to(path.parent)]
    if not in_folder:
        return path.name, ""
    return f"{Path(in_folder[-1].filename).name}:{in_folder[-1].lineno}", in_folder[-1].line or ""
