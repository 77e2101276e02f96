"""Windows and macOS by construction: calls, encodings, names, and kernels by cross compilation.

Nothing here runs on these systems. What they lack is taken away from Python, and the compiler of
the package `ziglang` compiles for them.
"""

from __future__ import annotations

import ast
import json
import shlex
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from softehl.codegen import c_compiler, models
from softehl.codegen.tools import build, kernel_cache
from softehl.codegen.tools.model_text import ModelFileError
from softehl.system import name_fault

ROOT = Path(__file__).parents[2]
SYSTEM = ROOT / "src" / "softehl" / "system.py"
FILES = [
    *(ROOT / "src" / "softehl").glob("*.py"),
    *(p for room in ("cases", "codegen", "runtime") for p in (ROOT / room).rglob("*.py")),
]
MODULES = {"fcntl", "termios", "resource", "pwd", "grp", "pty", "tty", "syslog"}
CALLS = {
    "os": {
        *("fork", "forkpty", "killpg", "setsid", "getpgid", "setpgid", "symlink", "link", "mkfifo"),
        *("getuid", "geteuid", "getgid", "getegid", "chown", "fchmod", "nice", "getloadavg"),
        *("sched_getaffinity", "sched_setaffinity", "wait", "statvfs", "O_NOFOLLOW", "uname"),
    },
    "signal": {"SIGHUP", "SIGKILL", "SIGALRM", "SIGUSR1", "SIGPIPE", "alarm", "setitimer", "pause"},
}
"""What Windows or macOS lacks, of modules that all have."""


def unportable(source: str) -> Iterator[str]:
    """Imports, calls and texts without an encoding that do not work on every system."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield node.module
        elif isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if node.attr in CALLS.get(owner, ()) or node.attr == "symlink_to":
                yield f"{owner}.{node.attr}"
        elif isinstance(node, ast.Call) and _has_no_encoding(node):
            yield f"{ast.unparse(node)}: no encoding"


def _has_no_encoding(call: ast.Call) -> bool:
    given = {k.arg: ast.unparse(k.value) for k in call.keywords}
    if "encoding" in given:
        return False
    owner, _, name = ast.unparse(call.func).rpartition(".")
    words = [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    if name == "open" and owner != "os":
        return given.get("mode", words[-1] if words else "") in {"r", "w", "a", "x", "r+", "w+"}
    if name == "read_text":
        return not words
    if name == "write_text":
        return isinstance(call.func, ast.Attribute) and len(call.args) < 2
    return "True" in (given.get("text"), given.get("universal_newlines"))


def test_no_module_but_one_calls_what_a_system_lacks() -> None:
    found = {path: [*unportable(path.read_text(encoding="utf-8"))] for path in FILES}
    assert {p: names for p, names in found.items() if names} == {SYSTEM: ["fcntl", "termios"]}


@pytest.mark.parametrize(
    "source",
    [
        *("import fcntl", "from resource import getrusage", "os.fork()", "os.geteuid()"),
        *("signal.SIGHUP", "Path('a').symlink_to('b')", "open('a', 'w')", "path.open('r')"),
        *("path.read_text()", "path.write_text('a')", "subprocess.run(['a'], text=True)"),
    ],
)
def test_what_a_system_lacks_is_seen(source: str) -> None:
    assert list(unportable(source))


WITHOUT = """
import asyncio, click, filelock, importlib, matplotlib, multiprocessing, os, pathlib, pkgutil, sys
import subprocess, tempfile, scipy.sparse.linalg, sympy, mpmath, meshio, rich.console, pydantic
import signal, threading, concurrent.futures, cffi, ctypes, numpy, hashlib, platform
for module, names in CALLS.items():
    for name in names:
        if hasattr(sys.modules[module], name):
            delattr(sys.modules[module], name)
for name in MODULES:
    sys.modules[name] = None
signal.SIGBREAK = signal.SIGUSR2
import softehl, softehl.runtime, softehl.cases, softehl.codegen
for package in (softehl.runtime, softehl.cases, softehl.codegen):
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not any(part in found.name for part in OPTIONAL):
            importlib.import_module(found.name)
from softehl.runtime.discretisation.matrix_free_products import threads
from softehl.cases.harness.signals import signals
from softehl.system import END_SIGNALS
import softehl.runtime.mpi as mpi
assert threads() >= 1
mpi._await_reader(sys.stderr)
with signals():
    assert signal.getsignal(signal.SIGBREAK) is signal.getsignal(signal.SIGTERM)
assert softehl.main(["keys", "oring"]) == 0
"""


def test_everything_works_without_the_calls_of_posix() -> None:
    """Except for what other packages of Python do themselves."""
    optional = ("app", "petsc", "slepc", "pardiso", "report", "plotting", "dask", "cad", "__main__")
    names = f"CALLS, MODULES, OPTIONAL = {CALLS!r}, {MODULES!r}, {optional!r}\n"
    done = subprocess.run(
        [sys.executable, "-X", "warn_default_encoding", "-c", names + WITHOUT],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "sealed_pressure" in done.stdout
    ours = [line for line in done.stderr.splitlines() if "EncodingWarning" in line]
    assert not [line for line in ours if "softehl" in line and "site-packages" not in line]


@pytest.mark.parametrize(
    "name", ["aux", "NUL.c", "com1.txt", "a:b", "what?", "a/b", "end.", "end ", "tab\t"]
)
def test_a_name_that_windows_refuses(name: str) -> None:
    assert name_fault(name)


@pytest.mark.parametrize("name", ["auxiliary", "ring=AS568-210", "a b", "consol.c", ".hidden"])
def test_a_name_that_every_system_takes(name: str) -> None:
    assert name_fault(name) == ""


def test_a_model_is_not_called_like_a_device() -> None:
    d = models.ALL["contact"]()
    with pytest.raises(ModelFileError, match=r"aux cannot name a model, .*for a device"):
        kernel_cache.derive([replace(d, name="aux")])


def test_files_of_the_repository_have_names_of_every_system() -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode:
        pytest.skip("no checkout")
    names = listed.stdout.decode("utf-8").split("\0")
    assert not [n for n in names if any(map(name_fault, n.split("/")))]
    assert len({n.lower() for n in names}) == len(names)


# ----------------------------------------------------------------------------- cross compilation

ZIG = c_compiler.ziglang()
needs_zig = pytest.mark.skipif(ZIG is None, reason="the package ziglang is not installed")
TARGETS = ("x86_64-windows-gnu", "aarch64-macos", "x86_64-macos", "aarch64-linux-gnu")


def kernels() -> set[str]:
    """Names of all functions of the kernels that ship."""
    found = json.loads((build.GENERATED / "manifest.json").read_text(encoding="utf-8"))["kernels"]
    return {f"softehl_{n}_{task}" for n, entry in found.items() for task in entry["tasks"]}


def exported(data: bytes) -> set[str]:
    """Names that a library exports: of PE, Mach-O and ELF, each by its own table."""
    readers = {b"MZ": _of_pe, b"\xcf\xfa": _of_mach_o, b"\x7fE": _of_elf}
    return set(readers[data[:2]](data))


def _name(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode("ascii")


def _of_pe(data: bytes) -> Iterator[str]:
    """Names of the export directory, the first of the data directories of PE32+."""
    header = struct.unpack_from("<I", data, 0x3C)[0]
    sections, size = struct.unpack_from("<2xH12xH", data, header + 4)
    assert struct.unpack_from("<H", data, header + 4)[0] == 0x8664
    (directory,) = struct.unpack_from("<I", data, header + 24 + 112)
    table = [
        struct.unpack_from("<IIII", data, header + 24 + size + 40 * k + 8) for k in range(sections)
    ]

    def place(address: int) -> int:
        start, raw = next((v, r) for n, v, _, r in table if v <= address < v + n)
        return int(address - start + raw)

    count, _, names = struct.unpack_from("<III", data, place(directory) + 24)
    for k in range(count):
        yield _name(data, place(struct.unpack_from("<I", data, place(names) + 4 * k)[0]))


def _of_mach_o(data: bytes) -> Iterator[str]:
    """Defined external symbols of LC_SYMTAB, without the underscore of C."""
    at, commands = 32, struct.unpack_from("<I", data, 16)[0]
    for _ in range(commands):
        kind, size = struct.unpack_from("<II", data, at)
        if kind == 2:
            symbols, count, strings, _ = struct.unpack_from("<IIII", data, at + 8)
            for k in range(count):
                name, flags = struct.unpack_from("<IB", data, symbols + 16 * k)
                if flags & 1 and flags & 0x0E:
                    yield _name(data, strings + name).removeprefix("_")
        at += size


def _of_elf(data: bytes) -> Iterator[str]:
    """Defined symbols of .dynsym."""
    (start,) = struct.unpack_from("<Q", data, 0x28)
    size, count = struct.unpack_from("<HH", data, 0x3A)
    heads = [struct.unpack_from("<IIQQQQII", data, start + size * k) for k in range(count)]
    (table,) = (h for h in heads if h[1] == 11)
    for at in range(table[4], table[4] + table[5], 24):
        name, info, section = struct.unpack_from("<IBxH", data, at)
        if section and info >> 4 == 1:
            yield _name(data, heads[table[6]][4] + name)


def test_names_of_a_library_are_read(tmp_path: Path) -> None:
    (tmp_path / "signature.c").write_text(
        "const char *softehl_signature(void) { return SOFTEHL_SIGNATURE; }\n"
        "static int hidden(void) { return 1; }\nint other(void) { return hidden(); }\n"
    )
    build.build(tmp_path, flags=build.COMMON)
    names = exported((tmp_path / build.LIBRARY).read_bytes())
    assert {"softehl_signature", "other"} <= names
    assert "hidden" not in names


@needs_zig
@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_all_kernels_compile_for_another_system(
    target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also with warnings as errors, of several elements at once and of one."""
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, tmp_path)
    monkeypatch.setenv("CC", shlex.join([str(ZIG), "cc"]))
    extra = ("-target", target, *build.STRICT, "-O1")
    build.build(tmp_path, flags=build.COMMON, extra=extra)
    missing = kernels() - exported((tmp_path / build.LIBRARY).read_bytes())
    assert not missing
