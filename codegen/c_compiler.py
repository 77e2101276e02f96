"""The compiler of C, or of C++, as a command, the flags that it understands, and its calls.

It is $CC or $CXX, else the first of its language on the PATH, else the one that the package
`ziglang` brings (`pip install 'softehl[compiler]'`): a clang with headers and libraries, for
machines that have no compiler.
"""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from softehl.codegen.abi import BuildError, NoCompilerError
from softehl.log import LOG


@dataclass(frozen=True)
class Language:
    """A language: the variable of its compiler, and names of compilers of the system.

    On Windows no compiler of the system is taken: gcc may store vectors of 32 bytes at places that
    the system aligns to 16 (GCC bug 54412), and clang needs the libraries of Visual Studio.
    """

    name: str
    variable: str
    names: tuple[str, ...]

    @property
    def system(self) -> tuple[str, ...]:
        """Names that are looked for."""
        return () if os.name == "nt" else self.names

    @property
    def remedy(self) -> str:
        """Advice without a compiler."""
        return f"install one, set {self.variable} to one, or pip install 'softehl[compiler]'"


C = Language("C", "CC", ("cc", "gcc", "clang"))
CXX = Language("C++", "CXX", ("c++", "g++", "clang++"))
GCC_ALONE = ("-fno-tree-pre", "-fschedule-insns2", "-fgcse", "-fpeephole2")
"""Flags that the command `zig cc` refuses; other clangs ignore them."""


def compiler(language: Language = C) -> list[str]:
    """The compiler as a command; `cc` or `c++` where there is none.  Raises BuildError."""
    variable = language.variable
    command = os.environ.get(variable, "")
    try:
        arguments = shlex.split(command, posix=os.name != "nt")
    except ValueError as error:
        reason = str(error)[:1].lower() + str(error)[1:]
        raise BuildError(
            f"{variable}={command!r} is no command ({reason}): set {variable} to a "
            f"{language.name} compiler"
        ) from None
    if arguments:
        return [word.strip('"') for word in arguments]
    installed = next(filter(_is_installed, language.system), None)
    if installed is not None:
        return [installed]
    zig = ziglang()
    if zig is None:
        return [language.names[0]]
    _log_ziglang(zig, language)
    return [str(zig), "cc"]  # also of C++: kernels need no library, which `zig c++` would build


def ziglang() -> Path | None:
    """The program `zig` of the package `ziglang`; None where it is not installed."""
    spec = find_spec("ziglang")
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    programs = [Path(folder) / ("zig.exe" if os.name == "nt" else "zig") for folder in folders]
    return next((program for program in programs if program.is_file()), None)


def supported(command: Sequence[str], flags: Sequence[str]) -> list[str]:
    """Flags of gcc and clang as a compiler understands them."""
    if os.name == "nt":  # all code is position independent there
        flags = [f for f in flags if f != "-fPIC"]
    if not is_zig(command):
        return list(flags)
    common = [f.replace("x86-64", "x86_64") for f in flags if f not in GCC_ALONE]
    return [*common, "-fno-sanitize=undefined"]  # which it would add to -O0 and -O1


def is_zig(command: Sequence[str]) -> bool:
    """True for `zig cc`, by whatever path."""
    return any(Path(word).stem in ("zig", "ziglang") for word in command[:3])


def note() -> str:
    """Note on the compiler in the report of a build; empty for a compiler of the system."""
    return " with the compiler of the package ziglang" if is_zig(compiler()) else ""


def called(command: Sequence[str], language: Language = C) -> subprocess.CompletedProcess[str]:
    """Call a command of the compiler; raises BuildError where it cannot be run."""
    name, variable = language.name, language.variable
    if shutil.which(command[0]) is None:
        missing = f"no {name} compiler: {command[0]!r} is not on the PATH; "
        if os.environ.get(variable, "").strip():
            raise BuildError(f"{missing}set {variable} to one that is")
        raise NoCompilerError(f"{missing}{language.remedy}")
    try:
        return subprocess.run(
            command,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
            input="",
        )
    except OSError as error:
        raise BuildError(
            f"{command[0]} cannot be run ({error.strerror}): set {variable} to a {name} compiler"
        ) from None


@cache
def _log_ziglang(program: Path, language: Language) -> None:
    """One line in the log of a process."""
    try:
        release = version("ziglang")
    except PackageNotFoundError:
        release = str(program)
    names = ", ".join(language.system)
    reason = f"none of {names} is on the PATH" if names else f"{language.variable} is not set"
    line = "the %s compiler is that of the package ziglang %s: %s"
    LOG.info(line, language.name, release, reason)


def _is_installed(name: str) -> bool:
    """True for a compiler that can be run: on macOS those of /usr/bin may wait for their tools."""
    path = shutil.which(name)
    if path is None or platform.system() != "Darwin" or not path.startswith("/usr/bin/"):
        return path is not None
    return _has_command_line_tools()


@cache
def _has_command_line_tools() -> bool:
    try:
        done = subprocess.run(["xcode-select", "-p"], capture_output=True, check=False)
    except OSError:
        return False
    return done.returncode == 0
