"""Compile a candidate with one compiler and load it."""

from __future__ import annotations

import ctypes
import resource
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.candidate import Candidate
from benchmarks.deriving import run_limited
from softehl.codegen.c_compiler import compiler

COMMON_FLAGS = ("-O3", "-march=native", "-ffast-math")
"""What everybody is compiled with first."""

OBJECT_FLAGS = ("-c", "-fPIC", "-w")


class CompileError(RuntimeError):
    """The C compiler refused; the message holds its command line and its words."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: `name` for the table, `version` as it says, its command."""

    name: str
    version: str
    command: tuple[str, ...]

    def library(
        self,
        sources: Sequence[Path],
        target: Path,
        flags: Sequence[str],
        include: Sequence[str] = (),
        limit: float = 120.0,
    ) -> float:
        """One shared library; returns the CPU seconds of compiling and linking.

        It is linked without the flags: with -ffast-math gcc links start-up code that turns
        subnormal numbers off in the whole process.
        Raises CompileError, or TimeLimitError after `limit` seconds.
        """
        includes = [f"-I{folder}" for folder in include]
        objects = [target.with_name(f"{target.stem}_{k}.o") for k in range(len(sources))]
        before = _children_seconds()
        for source, made in zip(sources, objects, strict=True):
            run(
                [*self.command, *flags, *OBJECT_FLAGS, *includes, str(source), "-o", str(made)],
                limit,
            )
        run([*self.command, "-shared", *map(str, objects), "-o", str(target), "-lm"], limit)
        return _children_seconds() - before


def compilers(*, all_found: bool) -> list[Compiler]:
    """$CC or cc; with `all_found` also gcc and clang where they are another compiler."""
    commands = [tuple(compiler())]
    if all_found:
        commands += [(name,) for name in ("gcc", "clang") if shutil.which(name)]
    found: dict[str, Compiler] = {}
    for command in commands:
        version = run([*command, "--version"], 20.0).splitlines()[0]
        kind = "clang" if "clang" in version else "gcc"
        name = f"{kind} {version.split()[-1] if kind == 'gcc' else _after(version, 'version')}"
        found.setdefault(name, Compiler(name, version, command))
    return list(found.values())


def _after(text: str, word: str) -> str:
    rest = text.partition(word)[2].split()
    return rest[0] if rest else text


def write(candidate: Candidate, folder: Path) -> list[Path]:
    """The candidate's files; returns the C sources."""
    folder.mkdir(parents=True)
    for name, text in candidate.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return sorted(folder.glob("*.c"))


def load(library: Path) -> Any:
    """The entry function of a compiled candidate."""
    return ctypes.CDLL(str(library)).bench_entry


def run(command: Sequence[str], limit: float) -> str:
    """Standard output of a command that must succeed within `limit` seconds."""
    done = run_limited(command, limit)
    if done.returncode != 0:
        raise CompileError(f"{shlex.join(command)}\n{done.stderr[:4000]}")
    return done.stdout


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
