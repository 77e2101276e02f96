"""Imports of a model file from its folder, and a record of all files that its run reads.

A model imports its neighbours as a script does, but as they are on the disk now, whatever the
process has imported before: their modules exist for the time of the run only. The record says
whether the run is known by its files, so that its outcome may be stored under a key of these.
"""

from __future__ import annotations

import hashlib
import linecache
import os
import sys
import sysconfig
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import source_from_cache, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from softehl.codegen.tools import model_text

_SOFTEHL = Path(__file__).parents[2]


@dataclass(eq=False)
class FilesRead:
    """Files that a run of a model has read.

    texts: of Python files of its folder that were run, by their path. digests: SHA-256 of other
    files, by the path with which they were opened; tables, say. foreign: modules that the process
    had imported before from elsewhere, which may be older than their files.
    """

    texts: dict[Path, str] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)
    foreign: set[str] = field(default_factory=set)

    def beyond(self, path: Path, sources: Mapping[str, str]) -> dict[str, str] | None:
        """Digests of the files that were read, except the `sources` of the model file.

        Those of the folder of the model file are called as seen from there (`model_text.BESIDE`):
        a copy of the folder elsewhere has files of its own. None where that does not say it all: a
        file was edited between its digest and its run, or a module came from elsewhere.
        """
        folder = path.resolve().parent
        others = {}
        for p, d in self.digests.items():
            resolved = Path(p).resolve()
            if resolved not in self.texts:
                inside = Path(p).is_absolute() and resolved.is_relative_to(folder)
                others[
                    model_text.BESIDE + resolved.relative_to(folder).as_posix() if inside else p
                ] = d
        for file, text in self.texts.items():
            name = file.relative_to(folder).as_posix()
            if name not in sources:
                others[str(file)] = hashlib.sha256(text.encode()).hexdigest()
            elif sources[name] != text:
                return None
        return None if self.foreign else others


_ONE = threading.RLock()
"""Modules and the path of imports are those of the process: one thread runs models at a time."""


@contextmanager
def imports_from(folder: Path) -> Iterator[FilesRead]:
    """Let a model import from its folder, and restore the previous modules afterwards."""
    with _ONE, _isolated(folder) as inputs:
        yield inputs


@contextmanager
def _isolated(folder: Path) -> Iterator[FilesRead]:
    inputs, finder = FilesRead(), _Finder(folder)
    finder.inputs = inputs
    previous = _modules_in(folder, finder)
    for name in previous:
        del sys.modules[name]
    others, writing = dict(sys.modules), sys.dont_write_bytecode
    sys.path.insert(0, str(folder))
    sys.meta_path.insert(0, finder)
    sys.dont_write_bytecode = True
    try:
        with _recorded(inputs):
            yield inputs
        inputs.foreign.update(_foreign(folder, inputs.texts, others))
    finally:
        sys.meta_path.remove(finder)
        with suppress(ValueError):  # a model may change it, too
            sys.path.remove(str(folder))
        sys.dont_write_bytecode = writing
        for name in _modules_in(folder, finder):
            if name not in others:
                _leave(name)
        for name, module in previous.items():
            _put(name, module)


def _leave(name: str) -> None:
    module, (parent, _, last) = sys.modules.pop(name), name.rpartition(".")
    if parent in sys.modules and getattr(sys.modules[parent], last, None) is module:
        delattr(sys.modules[parent], last)


def _put(name: str, module: ModuleType) -> None:
    sys.modules[name] = module
    parent, _, last = name.rpartition(".")
    if parent in sys.modules:
        setattr(sys.modules[parent], last, module)


def _modules_in(folder: Path, finder: _Finder) -> dict[str, ModuleType]:
    """Modules of this process that are of a folder, or are called as files of it are."""
    tops: dict[str, bool] = {}

    def of_folder(name: str, module: ModuleType) -> bool:
        top = name.partition(".")[0]
        if top in ("softehl", "__main__"):
            return False
        if top not in tops:
            tops[top] = finder.file(top, None) is not None
        return tops[top] or any(_inside(path, folder) for path in _paths_of(module))

    return {name: module for name, module in list(sys.modules.items()) if of_folder(name, module)}


def _paths_of(module: ModuleType) -> list[Path]:
    """File of a module and folders of a package."""
    file = getattr(module, "__file__", None)
    with suppress(Exception):  # a package may have anything as its path
        folders = [Path(p) for p in getattr(module, "__path__", ())]
        return [Path(file), *folders] if isinstance(file, str) else folders
    return []


def _inside(path: Path, folder: Path) -> bool:
    return path.is_relative_to(folder) and not installed(path)


@cache
def _system() -> tuple[Path, ...]:
    """Folders of Python and of softehl itself."""
    packages = [
        _SOFTEHL,
        *(_SOFTEHL / room for room in ("codegen", "runtime", "generated", "cases")),
    ]
    paths = [Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")]
    return tuple(path.resolve() for path in [*paths, *packages])


def installed(path: Path) -> bool:
    """True for a file of Python, of softehl or of an installed package, also of a model's folder.

    A virtual environment often lies in the folder of a project.
    """
    if {"site-packages", "dist-packages"} & set(path.parts):
        return True
    return any(path.is_relative_to(folder) for folder in _system())


def _foreign(
    folder: Path, texts: dict[Path, str], previous: dict[str, ModuleType]
) -> Iterator[str]:
    """Modules that these texts import and that the process had from elsewhere, not installed."""
    names = {n for file, text in texts.items() for n in model_text.imported(folder, file, text)}
    for name in names:
        parts = name.split(".")
        for k in range(1, len(parts) + 1):
            module = previous.get(".".join(parts[:k]))
            if module is not None and parts[0] != "softehl" and not _fixed(module):
                yield ".".join(parts[:k])


def _fixed(module: ModuleType) -> bool:
    """True for a module that does not change while a process runs."""
    spec, file = getattr(module, "__spec__", None), getattr(module, "__file__", None)
    if isinstance(file, str):
        return installed(Path(file).resolve())
    return spec is not None  # built in, frozen, or a folder without a file


# ----------------------------------------------------------------------------------- the importer


class _Finder(MetaPathFinder):
    """Finds the modules of a folder, before all others."""

    inputs: FilesRead

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, fullname: str, path: Sequence[str] | None) -> Path | None:
        """The file that an import of this name runs; path: of the package it is in."""
        if fullname.partition(".")[0] == "softehl":
            return None
        last = fullname.rpartition(".")[2]
        for entry in (self.folder,) if path is None else map(Path, path):
            if not _inside(entry, self.folder):
                return None
            for file in (entry / last / "__init__.py", entry / f"{last}.py"):
                if file.is_file():
                    return file
        return None

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module of a file of the folder; None leaves it to the others."""
        file = self.file(fullname, path)
        if file is None:
            return None
        loader = _Loader(fullname, str(file))
        loader.inputs = self.inputs
        inside = [str(file.parent)] if file.name == "__init__.py" else None
        return spec_from_file_location(
            fullname, file, loader=loader, submodule_search_locations=inside
        )


class _Loader(SourceFileLoader):
    """Runs the text of a file, whose bytecode may be that of another text of the same second."""

    inputs: FilesRead

    def get_code(self, fullname: str) -> CodeType:
        """The file as it is now."""
        return code_of(Path(self.path), model_text.read(Path(self.path)), self.inputs)


def code_of(path: Path, text: str, inputs: FilesRead) -> CodeType:
    """A text of a file, to be run."""
    inputs.texts[path.resolve()] = text
    linecache.checkcache(str(path))
    code: CodeType = compile(text, str(path), "exec", dont_inherit=True)
    return code


# ------------------------------------------------------------------------------ files that are read

_recording: list[tuple[int, FilesRead]] = []


@contextmanager
def _recorded(inputs: FilesRead) -> Iterator[None]:
    """Record the files that this thread opens to read them."""
    _hook()
    _recording.append((threading.get_ident(), inputs))
    try:
        yield
    finally:
        _recording.remove((threading.get_ident(), inputs))


@cache
def _hook() -> None:
    sys.addaudithook(_audit)


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    """Python calls this on every `open`; a hook cannot be removed."""
    if event != "open" or not _recording:
        return
    path, mode, flags = arguments
    writes = mode[0] in "wax" if mode else flags & os.O_ACCMODE == os.O_WRONLY
    active = [inputs for thread, inputs in _recording if thread == threading.get_ident()]
    if active and not writes and isinstance(path, (str, bytes, os.PathLike)):
        with suppress(OSError, ValueError):
            _note(os.fsdecode(path), active)


def _note(path: str, active: list[FilesRead]) -> None:
    if path.endswith(".pyc"):
        path = source_from_cache(path)
    file = Path(path).resolve()
    if installed(file) or not file.is_file() or file.is_relative_to("/proc"):
        return
    recording = _recording[:]
    _recording.clear()  # reading it here is no reading of the model
    try:
        digest = model_text.digest_of(path)
    finally:
        _recording[:] = recording
    for inputs in active:
        inputs.digests.setdefault(path, digest)
