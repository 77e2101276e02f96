"""From models to a folder with their C and the compiled kernels, by way of the user's cache.

Two keys, so that nothing is derived or compiled twice: what the C was derived from (the text of
the model file or the graph of a definition, the text of this generator, the version of SymPy), and
what the library was compiled from (the C, the compiler, its flags, the processor, the ABI).
What else a model has read (a table of constants, a module that it imports by a computed name) is
stored beside the C with its digest. A model that imports a module of another folder which the
process had imported before is run every time: that module may be older than its file. Nobody sees
whether a model asks for the time, its environment, or the names in a folder; `softehl generate`
runs it in any case.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Timer
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

from softehl.codegen import abi
from softehl.codegen.c_compiler import note
from softehl.codegen.tools import build, model_text
from softehl.codegen.tools import cache_store as store
from softehl.codegen.tools.model_text import ModelFileError
from softehl.log import LOG

if TYPE_CHECKING:
    from softehl.codegen.graph.graph import Node
    from softehl.codegen.language.definition import Definition
    from softehl.codegen.language.material import Law
    from softehl.codegen.language.weak_form import CellOptions, Page


CellKey: TypeAlias = "tuple[tuple[str, ...], str, bool, tuple[tuple[str, str], ...]]"
"""Cells and geometry ("": the usual one) of weak forms, whether materials are wanted, and
parameters that become data or point data.
"""

Variant: TypeAlias = "int | tuple[str, ...]"
"""Order of derivatives, 0 for the kernels themselves, or names of values."""


@dataclass(frozen=True)
class CachedLibrary:
    """Files and compiled kernels of some models.

    folder: in the cache; holds `files` and the shared library.  derived, compiled: seconds by
    kernel; empty where the cache had them.
    """

    folder: Path
    files: Mapping[str, str]
    derived: Mapping[str, float]
    compiled: Mapping[str, float]


def folder_of(
    source: Path | Definition | Page | Law,
    where: CellKey = ((), "", False, ()),
    *,
    derivatives: Variant = 0,
) -> Path:
    """Folder of compiled kernels of a model file (SymPy is imported only if it must be derived).

    where: cells and geometry of weak forms, and whether materials are wanted. derivatives: 1 or 2
    for the kernels of `Definition.for_derivatives` or `for_second_derivatives` instead, names for
    those of `Definition.for_values`.
    """
    folder = _folder_of(source, where, derivatives=derivatives)
    text = model_text.digest(model_text.sources(source)) if isinstance(source, Path) else ""
    _ORIGINS[folder] = Origin(source, where, text)
    return folder


@dataclass(frozen=True)
class Origin:
    """Source of the kernels of a folder: a model or the name of a law; digest of a file."""

    source: Path | Definition | Page | Law | str
    where: CellKey
    text: str = ""


_ORIGINS: dict[Path, Origin] = {}
"""Of the folders that this process has loaded."""


def definition_of(folder: Path, kernel: str) -> Definition | None:
    """The model of a kernel of a folder that this process has loaded; None where it is not known.

    Raises `ModelFileError` if its file has changed since.
    """
    from softehl.codegen.models.material_elements import law
    from softehl.codegen.tools import model_loader

    origin = _ORIGINS.get(folder)
    if origin is None:
        return None
    source, where = origin.source, origin.where
    if isinstance(source, Path):
        if model_text.digest(model_text.sources(source)) != origin.text:
            raise ModelFileError(f"{source} has changed since it was loaded: start Python anew")
        definitions = model_loader.definitions(source, _on(where))
    else:
        definitions = _definitions(law(source) if isinstance(source, str) else source, where)
    return next((d for d in definitions if d.name == kernel), None)


def _folder_of(
    source: Path | Definition | Page | Law, where: CellKey, *, derivatives: Variant
) -> Path:
    if derivatives:
        return _for_derivatives(source, where, derivatives)
    if not isinstance(source, Path):
        return library(_definitions(source, where)).folder
    sources = model_text.sources(source)
    anywhere = _file_key(sources)
    on_cells = _file_key(sources, _texts(where))
    _, _, materials, varying = where
    files: Mapping[str, str] | None = store.recall(on_cells, source)
    if files is None and not (materials or varying):
        files = store.recall(anywhere, source)
    if files is None:
        from softehl.codegen.tools import model_loader

        definitions, inputs = model_loader.definitions_and_inputs(source, _on(where))
        read = inputs.beyond(source, sources)
        any_varies = any(d.varying for d in definitions)
        usual = _file_key(sources, _texts((*where[:3], ())))
        on_any = not any(d.cell for d in definitions)
        key = on_cells if any_varies else anywhere if on_any else usual
        if varying and not any_varies and read is not None:
            files = store.recall(key, source)
        files = files or library(definitions, None if read is None else key, read).files
        if key != on_cells and varying and read is not None:
            store.remember(on_cells, files, read)
    return compiled(files)[0]


def _for_derivatives(
    source: Path | Definition | Page | Law, where: CellKey, order: Variant
) -> Path:
    """Folder of the kernels of derivatives or of named values of results."""
    key, read = None, None
    if isinstance(source, Path):
        options = [*_texts(where), f"derivatives {order}"]
        sources = model_text.sources(source)
        key = _file_key(sources, options)
        files = store.recall(key, source)
        if files is not None:
            return compiled(files)[0]
        from softehl.codegen.tools import model_loader

        definitions, inputs = model_loader.definitions_and_inputs(source, _on(where))
        read = inputs.beyond(source, sources)
        key = None if read is None else key
    else:
        definitions = _definitions(source, where)
    free = [d for d in definitions if isinstance(order, tuple) or not d.prescribed]
    if not free:
        names = ", ".join(d.name for d in definitions)
        raise ModelFileError(f"{names}: gives derivatives of its own, and results have none by it")
    return library([_differentiated(d, order) for d in free], key, read).folder


def _differentiated(d: Definition, order: Variant) -> Definition:
    """The model from which derivatives of an order, or named values are computed; itself for 0."""
    if isinstance(order, tuple):
        return d.for_values(order)
    makers = (lambda: d, d.for_derivatives, d.for_second_derivatives)
    return makers[order]()


def of_law(name: str, where: CellKey, *, derivatives: Variant = 0) -> Path:
    """Folder of the kernels of a material that ships; raises ValueError for another name."""
    folder = _folder_of_law(name, where, derivatives=derivatives)
    _ORIGINS[folder] = Origin(name, where)
    return folder


def _folder_of_law(name: str, where: CellKey, *, derivatives: Variant) -> Path:
    key = store.digest(["law", generator(), name, *_texts(where), str(derivatives)])
    files = store.recall(key)
    if files is not None:
        return compiled(files)[0]
    from softehl.codegen.models.material_elements import law

    definitions = _definitions(law(name), where)
    return library([_differentiated(d, derivatives) for d in definitions], key).folder


def _definitions(source: Definition | Page | Law, where: CellKey) -> list[Definition]:
    from softehl.codegen.language.material import Law
    from softehl.codegen.language.weak_form import Page
    from softehl.codegen.tools import model_loader

    if isinstance(source, Law):
        source = source.page()
    if isinstance(source, Page):
        with model_loader.errors_of(source):
            return source.definitions(replace(_on(where), materials=False))
    return [source]


def _on(where: CellKey) -> CellOptions:
    """Options of weak forms."""
    from softehl.codegen.language.weak_form import CellOptions

    cells, geometry, materials, varying = where
    return CellOptions(cells, geometry or None, materials, varying)


def _texts(where: CellKey) -> list[str]:
    """`CellOptions.options` without an import of SymPy."""
    cells, geometry, materials, varying = where
    moved = [f"{name} as {array}" for name, array in varying]
    return [*cells, geometry, "materials" if materials else "", *moved]


def of_files(
    paths: Sequence[Path], on: CellOptions | None = None
) -> tuple[list[Definition], CachedLibrary]:
    """The models of some files, which are run, and their library."""
    from softehl.codegen.language.weak_form import DEFAULT_CELL
    from softehl.codegen.tools import model_loader

    on = on or DEFAULT_CELL
    sources = [model_text.sources(p) for p in paths]
    runs = [model_loader.definitions_and_inputs(p, on) for p in paths]
    models = [d for definitions, _ in runs for d in definitions]
    model_loader.check_names(" ".join(p.name for p in paths), models)
    if len(paths) > 1:
        return models, library(models, check=False)
    read = runs[0][1].beyond(paths[0], sources[0])
    key = None if read is None else _file_key(sources[0], on.options())
    return models, library(models, key, read, check=False)


def library(
    definitions: Sequence[Definition],
    key: str | None = None,
    read: Mapping[str, str] | None = None,
    *,
    check: bool = True,
) -> CachedLibrary:
    """Library of some models; the derived C is stored under `key` as well.

    read: as in `cache.remember`. check: with the quick check of kernels that have not been through
    it (`verify.quick_check`).
    """
    names = ", ".join(d.name for d in definitions)
    with BuildProgress() as progress:
        files, derived = derive(definitions, progress)
        progress.begin(f"compiling {names}{note()}")
        folder, seconds = compiled(files)
        if check:
            progress.begin(f"checking {names}")
            _checked(definitions, files, folder)
    if key is not None:
        store.remember(key, files, read)
    return CachedLibrary(folder, files, derived, seconds)


def _checked(definitions: Sequence[Definition], files: Mapping[str, str], folder: Path) -> None:
    """Check kernels once for each text of theirs; raises `quick.WrongKernelError`."""
    passed = store.digest(["checked", generator(), store.content(files)])
    if store.recall(passed) is not None:
        return
    from softehl.codegen.verify import quick_check

    kernels = json.loads(files["manifest.json"])["kernels"]
    for d in definitions:
        quick_check.check(d, list(kernels[d.name]["tasks"]), folder / build.LIBRARY)
    store.remember(passed, {"checked": ""})


PATIENCE = 2.0
"""Seconds after which a build is reported."""


class BuildProgress:
    """Report of what is being built, from `PATIENCE` on: in the log, and on a terminal.

    A context, at whose end nothing more is reported.
    """

    def __init__(self) -> None:
        self._start = perf_counter()
        self._timer: Timer | None = None

    def __enter__(self) -> BuildProgress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def begin(self, task: str) -> None:
        """Report a stage at once, or as soon as it is late enough and goes on."""
        self.__exit__()
        left = self._start + PATIENCE - perf_counter()
        if left <= 0:
            _report(task)
            return
        self._timer = Timer(left, _report, [task])
        self._timer.daemon = True
        self._timer.start()


def _report(message: str) -> None:
    LOG.info(message)
    if sys.stderr.isatty() and multiprocessing.parent_process() is None:
        print(f"softehl: {message}", file=sys.stderr)


def derive(
    definitions: Sequence[Definition], progress: BuildProgress | None = None
) -> tuple[dict[str, str], dict[str, float]]:
    """Every generated file, and seconds by kernel (empty if they were remembered)."""
    from softehl.codegen.tools.model_loader import require_file_name
    from softehl.codegen.verify.random_states import check_external_functions

    for d in definitions:
        require_file_name(d.name)
        if d.addresses:  # a function of this process, which no digest knows
            check_external_functions(d)
    key = store.digest(["models", generator(), *(fingerprint(d) for d in definitions)])
    files = store.recall(key)
    if files is not None:
        return files, {}
    from softehl.codegen import pipeline
    from softehl.codegen.graph.partial_derivatives import DifferentiationError
    from softehl.codegen.tools import output_files

    kernels, seconds = [], {}
    with _without_collection():
        for d in definitions:
            check_external_functions(d)
            if progress is not None:
                size = f"{len(d.unknowns)} unknowns, {len(d.rule.points)} points"
                progress.begin(f"deriving {d.name}: {size}")
            start = perf_counter()
            try:
                kernels.append(pipeline.compile_model(d))
            except ZeroDivisionError:
                raise ModelFileError(
                    f"{d.name}: something is divided by a value that is always zero, or a root of "
                    "it is differentiated"
                ) from None
            except DifferentiationError as error:
                raise ModelFileError(f"{d.name}: {error}") from None
            seconds[d.name] = perf_counter() - start
    files = output_files.files(kernels)
    store.remember(key, files)
    return files, seconds


@contextmanager
def _without_collection() -> Iterator[None]:
    """Time without the collector of cycles: a graph has none, and a third went into the search."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def compiled(files: Mapping[str, str], *, keep: bool = False) -> tuple[Path, dict[str, float]]:
    """The folder of these files and their library, and seconds by kernel (empty if cached).

    keep: as in `cache.folder`.
    """
    content = store.content(files)
    flags, compiler = build.tuned_flags()
    key = store.digest([content, str(abi.VERSION), compiler])
    seconds: dict[str, float] = {}

    def complete(folder: Path) -> bool:
        return build.is_intact(folder) and _content_of(folder, files) == content

    def make(folder: Path) -> None:
        for name, text in files.items():
            store.write(folder / name, text.encode(), mode=0o644)
        seconds.update(build.build(folder, flags=flags))

    return store.folder(key, complete, make, keep=keep), seconds


def _content_of(folder: Path, files: Mapping[str, str]) -> str | None:
    try:
        return store.content({n: (folder / n).read_text(encoding="utf-8") for n in files})
    except (OSError, UnicodeDecodeError):
        return None


def _file_key(texts: Mapping[str, str], options: Sequence[str] = ()) -> str:
    return store.digest(["file", generator(), model_text.digest(texts), *options])


_CODEGEN = Path(__file__).parents[1]
LIBRARY = _CODEGEN / "models" / "library"


@cache
def generator() -> str:
    """Digest of the generator: its text and the versions of SymPy and mpmath."""
    paths = sorted(p for p in _CODEGEN.rglob("*.py") if p.parent != LIBRARY)  # models of their own
    texts = [p.read_text(encoding="utf-8") for p in paths]
    return store.digest([*texts, *(version(p) for p in ("sympy", "mpmath"))])


def fingerprint(definition: Definition) -> str:
    """Digest of the content of a definition, with its graphs."""
    return store.digest([_canonical_text(definition), _canonical_text(definition.point)])


def _canonical_text(value: Any) -> str:
    """A record as text: its nodes, numbered from operands to users, then its entries."""
    from softehl.codegen.graph.graph import Routine
    from softehl.codegen.graph.traversal import reachable

    roots: list[Node] = []
    _entries(value, lambda n: roots.append(n) or "")  # type: ignore[func-returns-value]
    numbers = {n: f"#{k}" for k, n in enumerate(reachable(roots))}
    lines = []
    for n in numbers:
        payload = _canonical_text(n.payload) if isinstance(n.payload, Routine) else repr(n.payload)
        lines.append(f"{n.op} {[numbers[a] for a in n.args]} {payload} {n.varying}")
    return "\n".join([*lines, _entries(value, numbers.__getitem__)])


def _counts(f: Field[Any]) -> bool:
    return f.compare and f.name[0] != "_"


def _entries(value: Any, label: Callable[[Node], str]) -> str:
    """A value as text, nodes by their `label`.

    Fields that a record keeps for itself (_name) or does not compare are left out.
    """
    from softehl.codegen.graph.graph import Graph, Node

    if isinstance(value, Node):
        return label(value)
    if isinstance(value, Mapping):
        inside = [f"{_entries(k, label)}: {_entries(v, label)}" for k, v in value.items()]
    elif isinstance(value, (tuple, list)):
        inside = [_entries(v, label) for v in value]
    elif is_dataclass(value):
        named = {f.name: getattr(value, f.name) for f in fields(value) if _counts(f)}
        inside = [type(value).__name__, _entries(named, label)]
    else:
        return "" if isinstance(value, Graph) else repr(value)
    return f"({', '.join(inside)})"
