"""The kernels that ship, at their first use: tuned, plain, shared by processes, healed, refused.

An installed package is imitated by a copy of ours whose `generated/` has one small kernel, with a
plain library beside it; every use is a process of its own.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from softehl.codegen import c_compiler
from softehl.codegen.tools import build

SOURCE = build.GENERATED.parent / "src"
KEPT = ("contact.c", "signature.c", "softehl_kernels.h", "__init__.py")
USE = """
import numpy, softehl
from softehl.runtime.kernels.shared_library import library_of
kernel = softehl.load_kernel("contact")
given = {"data": numpy.ones((1, 5)), "parameters": numpy.ones(len(kernel.parameters))}
values = kernel.residual(numpy.zeros((1, 2)), numpy.zeros((1, 3)), **given)
library = library_of()
print(values.shape, library.kind, library.path, sep="|")
"""
UTF8 = {"PYTHONIOENCODING": "utf-8:surrogateescape"}
SLOW_COMPILER = """#!/bin/sh
case "$*" in *-dM*) ;; *) echo $$ >> "{log}"; sleep 0.5;; esac
exec {cc} "$@"
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a wheel would install, with one kernel: the folder to import it from."""
    place = tmp_path_factory.mktemp("wheel")
    skipped = shutil.ignore_patterns("__pycache__", "*.egg-info", f"{build.LIBRARY}*")
    shutil.copytree(SOURCE, place, ignore=skipped, dirs_exist_ok=True)
    generated = place / "softehl" / "generated"
    for path in generated.iterdir():
        if path.name == "manifest.json":
            kernels = json.loads(path.read_text())["kernels"]
            path.write_text(json.dumps({"kernels": {"contact": kernels["contact"]}}))
        elif path.name not in KEPT:
            path.unlink()
    build.build_plain(generated)
    return place


@pytest.fixture(scope="module")
def checkout(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without the plain library."""
    place = tmp_path_factory.mktemp("checkout")
    shutil.copytree(wheel, place, dirs_exist_ok=True)
    for name in (build.LIBRARY, build.DIGEST):
        (place / "softehl" / "generated" / name).unlink()
    return place


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("SOFTEHL_KERNELS", raising=False)
    return tmp_path / "cache"


def using(place: Path, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-c", USE],
        cwd="/",
        env={**os.environ, "PYTHONPATH": str(place), **UTF8, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="surrogateescape",
    )


def used(process: subprocess.Popen[str]) -> tuple[str, Path, str]:
    """Kind and path of the library, and what was said on stderr."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    shape, kind, path = out.strip().split("|")
    assert shape == "(1, 3)"
    return kind, Path(path), err


def contents(place: Path) -> dict[str, bytes]:
    """Every file of the package but the byte code that Python keeps of it."""
    files = [p for p in place.rglob("*") if p.is_file() and p.suffix != ".pyc"]
    return {str(p): p.read_bytes() for p in files}


def without_compiler(place: Path, tmp_path: Path) -> dict[str, str]:
    """Nothing on the PATH, and a package `ziglang` without a program."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "hiding" / "ziglang").mkdir(parents=True)
    (tmp_path / "hiding" / "ziglang" / "__init__.py").write_text("")
    paths = f"{tmp_path / 'hiding'}{os.pathsep}{place}"
    return {"PATH": str(tmp_path / "empty"), "PYTHONPATH": paths}


# ------------------------------------------------------------------------------ tuned and plain


def test_the_first_use_tunes_the_kernels_and_later_ones_find_them(wheel: Path, cache: Path) -> None:
    before = contents(wheel)
    kind, path, said = used(using(wheel))
    assert (kind, said) == ("tuned", "")
    assert path.is_relative_to(cache)
    written = path.stat().st_mtime_ns
    assert used(using(wheel)) == ("tuned", path, "")
    assert path.stat().st_mtime_ns == written
    assert contents(wheel) == before


def test_without_a_compiler_the_plain_library_serves_silently(wheel: Path, tmp_path: Path) -> None:
    before = contents(wheel)
    kind, path, said = used(using(wheel, **without_compiler(wheel, tmp_path)))
    assert (kind, said) == ("plain", "")
    assert path == wheel / "softehl" / "generated" / build.LIBRARY
    assert contents(wheel) == before


def missing(process: subprocess.Popen[str]) -> str:
    """What the error says where no kernels can be had."""
    _, err = process.communicate(timeout=300)
    assert process.returncode == 1
    kind, _, message = err.splitlines()[-1].partition(": ")
    assert kind == "softehl.runtime.kernels.shared_library.MissingKernelsError"
    assert message.startswith("the kernels are not built, nor are there plain ones: ")
    return message


def test_a_checkout_without_a_compiler_says_what_to_do(checkout: Path, tmp_path: Path) -> None:
    last = missing(using(checkout, **without_compiler(checkout, tmp_path)))
    assert last.endswith(f"no C compiler: 'cc' is not on the PATH; {c_compiler.C.remedy}")


def test_the_plain_library_can_be_asked_for(wheel: Path, checkout: Path, cache: Path) -> None:
    kind, _, said = used(using(wheel, SOFTEHL_KERNELS="plain"))
    assert (kind, said) == ("plain", "")
    assert not cache.exists()
    assert missing(using(checkout, SOFTEHL_KERNELS="plain")).endswith("asks for the plain ones")
    kind, _, said = used(using(wheel, SOFTEHL_KERNELS="quick"))
    assert kind == "plain"
    assert "SOFTEHL_KERNELS is 'quick', must be 'tuned' or 'plain'" in said


def test_a_file_of_the_users_folder_is_not_taken_for_one_of_python(
    wheel: Path, tmp_path: Path
) -> None:
    (tmp_path / "tempfile.py").write_text("raise SystemExit('the wrong file')\n")
    done = subprocess.run(
        [sys.executable, "-P", "-c", USE],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(wheel)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "|tuned|" in done.stdout


# --------------------------------------------------------------------- what is wrong is one line


COMPILERS = {
    "no-such-compiler": "no C compiler: 'no-such-compiler' is not on the PATH",
    "{here}/broken": "the C compiler failed (7)",
    'cc "x': r"""CC='cc "x' is no command (no closing quotation)""",
    "true": "true does not answer as a C compiler does (exit code 0: nothing)",
    "ls": "ls does not answer as a C compiler does (exit code 2: ",
    "{here}/text": "text cannot be run (Exec format error): set CC to a C compiler",
    "{here}/idle": "idle is no C compiler (it wrote nothing): set CC to one",
}


def first(values: Iterable[str], count: int) -> list[Any]:
    """Values of a parameter, of which all but the first ones are slow: each is a new process."""
    return [pytest.param(v, marks=[pytest.mark.slow] * (k >= count)) for k, v in enumerate(values)]


@pytest.mark.parametrize("command", first(COMPILERS, 2))
def test_a_compiler_that_cannot_be_used(wheel: Path, tmp_path: Path, command: str) -> None:
    asked = f'case "$*" in *-dM*) exec {shutil.which("cc")} "$@";; esac'
    scripts = {
        "text": "neither a script nor a program\n",
        "broken": f"#!/bin/sh\n{asked}\nexit 7\n",
        "idle": f"#!/bin/sh\n{asked}\nexit 0\n",
    }
    for name, text in scripts.items():
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    kind, _, said = used(using(wheel, CC=command.format(here=tmp_path)))
    assert kind == "plain"
    assert said.startswith("softehl: the plain kernels are used: ")
    assert COMPILERS[command] in said
    assert len(said.splitlines()) == 1


def test_a_cache_that_cannot_be_written(wheel: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    kind, _, said = used(using(wheel, SOFTEHL_CACHE=str(tmp_path / "file" / "cache")))
    assert kind == "plain"
    assert "cache cannot be written (Not a directory): set SOFTEHL_CACHE to a folder" in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("inside", first(("built", ""), 1))
def test_a_cache_that_others_may_write_to_is_not_loaded_from(
    wheel: Path, cache: Path, inside: str
) -> None:
    _, path, _ = used(using(wheel))
    folder = cache / inside
    folder.chmod(0o777)
    kind, _, said = used(using(wheel))
    assert kind == "plain"
    assert f"{folder} is not used: others may write to it; delete it, or if" in said
    assert len(said.splitlines()) == 1
    folder.chmod(0o755)
    assert used(using(wheel)) == ("tuned", path, "")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="chown needs root")
def test_a_cache_of_somebody_else_is_not_loaded_from(wheel: Path, cache: Path) -> None:
    used(using(wheel))
    os.chown(cache, 12345, 12345)
    kind, _, said = used(using(wheel))
    assert kind == "plain"
    assert f"the cache {cache} is not used: it belongs to another user, number 12345" in said


# ------------------------------------------------------------------------- processes and damage


def test_two_first_uses_at_once_compile_once(wheel: Path, tmp_path: Path) -> None:
    script = tmp_path / "slow-cc"
    script.write_text(SLOW_COMPILER.format(log=tmp_path / "log", cc=shutil.which("cc")))
    script.chmod(0o755)
    found = [used(p) for p in [using(wheel, CC=str(script)) for _ in range(2)]]
    assert found[0] == found[1]
    assert found[0][0] == "tuned"
    assert len((tmp_path / "log").read_text().splitlines()) == 3  # two files, and the linking
    assert [p.name for p in found[0][1].parents[1].iterdir()] == [found[0][1].parent.name]


def damage(folder: Path, kind: str, other: Path) -> None:
    library, digest = folder / build.LIBRARY, folder / build.DIGEST
    data = library.read_bytes()
    if kind == "a flipped bit":
        middle = len(data) // 2
        library.write_bytes(data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :])
    elif kind == "truncated":
        library.write_bytes(data[: len(data) // 3])
    elif kind == "empty":
        library.write_bytes(b"")
    elif kind == "text":
        library.write_text("no library\n")
    elif kind == "gone":
        library.unlink()
    elif kind == "digest gone":
        digest.unlink()
    elif kind == "digest no text":
        digest.write_bytes(b"\xff\xfe")
    elif kind == "of other sources":
        shutil.copy(other / build.LIBRARY, library)
        digest.write_text(hashlib.sha256(library.read_bytes()).hexdigest())
    elif kind == "a folder":
        library.unlink()
        library.mkdir()
    elif kind == "others may write to it":
        folder.chmod(0o777)
    elif kind == "unreadable":
        library.chmod(0)
        folder.chmod(0)
    else:
        assert kind == "entry is a file"
        shutil.rmtree(folder)
        folder.write_text("")


DAMAGES = (
    *("a flipped bit", "digest gone", "truncated", "empty", "text", "gone", "a folder"),
    *("of other sources", "digest no text", "unreadable", "entry is a file"),
    "others may write to it",
)


@pytest.mark.parametrize("kind", first(DAMAGES, 2))
def test_a_damaged_entry_is_built_anew(wheel: Path, tmp_path: Path, kind: str) -> None:
    _, path, _ = used(using(wheel))
    whole = path.read_bytes()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "signature.c").write_text(
        "const char *softehl_signature(void) { return SOFTEHL_SIGNATURE; }\n"
    )
    build.build(tmp_path / "other")
    damage(path.parent, kind, tmp_path / "other")
    assert used(using(wheel)) == ("tuned", path, "")
    assert len(path.read_bytes()) == len(whole)
    assert build.is_intact(path.parent)
    assert stat.S_IMODE(path.parent.stat().st_mode) & 0o022 == 0


def test_a_damaged_plain_library_is_refused_and_not_loaded(
    wheel: Path, tmp_path: Path, checkout: Path
) -> None:
    place = tmp_path / "site"
    shutil.copytree(wheel, place)
    library = place / "softehl" / "generated" / build.LIBRARY
    library.write_bytes(library.read_bytes()[:5000])
    process = using(place, SOFTEHL_KERNELS="plain")
    _, err = process.communicate(timeout=300)
    assert process.returncode == 1
    assert "the digest beside it is damaged: install softehl anew" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("name", "expected"), [(b"m\xc3\xbcller's cache", "tuned"), (b"no utf-8 \xff", "plain")]
)
def test_the_cache_may_have_any_name(
    wheel: Path, tmp_path: Path, name: bytes, expected: str
) -> None:
    """In an old locale too; cffi loads nothing from a folder whose name is not UTF-8."""
    place = tmp_path / os.fsdecode(name)
    kind, path, said = used(using(wheel, SOFTEHL_CACHE=str(place), LC_ALL="C"))
    assert kind == expected
    assert path.is_relative_to(place) == (kind == "tuned")
    assert len(said.splitlines()) == (kind == "plain")


@pytest.mark.parametrize("umask", [0o022, 0o002])
def test_others_may_read_the_library_and_nobody_else_write_it(
    wheel: Path, cache: Path, umask: int
) -> None:
    earlier = os.umask(umask)
    try:
        process = using(wheel)
    finally:
        os.umask(earlier)
    _, path, _ = used(process)
    for place in (path, path.with_name(build.DIGEST), path.parent, path.parents[1], cache):
        mode = stat.S_IMODE(place.stat().st_mode)
        assert mode & 0o444 == 0o444
        assert mode & 0o022 == 0


@pytest.mark.slow
def test_a_users_build_is_not_stopped_by_warnings(wheel: Path, tmp_path: Path) -> None:
    """On a processor without AVX, gcc warns of how vectors are passed (-Wpsabi)."""
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, tmp_path)
    build.build(tmp_path, flags=build.PLAIN, extra=("-O0",))
    assert build.is_intact(tmp_path)
    mode = stat.S_IMODE((tmp_path / build.LIBRARY).stat().st_mode)
    assert mode & 0o444 == 0o444
