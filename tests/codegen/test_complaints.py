"""What is wrong with disks, names and installations is one line, and nothing is half done."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import softehl
from softehl.codegen.tools import build, cache_store, cli
from softehl.runtime.kernels.kernel import StaleKernelsError

MODEL = build.GENERATED.parent / "tests" / "codegen" / "pages" / "penalty_spring.py"
NO_SYMPY = """
import sys
for name in ("sympy", "mpmath"):
    sys.modules[name] = None
import softehl
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    shutil.copy(MODEL, "mine.py")
    return tmp_path / "here"


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What `softehl generate` says, in one line, when it refuses."""
    capsys.readouterr()
    assert softehl.main(["generate", *words]) == 2
    printed = capsys.readouterr()
    assert len(printed.err.splitlines()) == 1
    assert printed.err.startswith("softehl: ")
    return printed.err


# --------------------------------------------------------------------------------------- SymPy


@pytest.mark.parametrize(
    "code",
    [
        "softehl.Model",
        "from softehl import Definition",
        "softehl.load_kernel('mine.py')",
    ],
)
def test_without_sympy_python_says_what_to_install(code: str) -> None:
    command = [sys.executable, "-c", NO_SYMPY + code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    last = done.stderr.splitlines()[-1]
    assert last == (
        "softehl.SymPyNeededError: deriving kernels needs SymPy: pip install 'softehl[generate]'"
    )


@pytest.mark.parametrize("words", [["mine.py"], ["--check"], ["--target", "ufcx", "--out", "a"]])
def test_without_sympy_generate_says_what_to_install(words: list[str]) -> None:
    command = [sys.executable, "-c", f"{NO_SYMPY}sys.exit(softehl.main(['generate', *{words}]))"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "softehl: deriving kernels needs SymPy: pip install 'softehl[generate]'\n"
    )


def test_without_sympy_kernels_are_shown_and_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOFTEHL_CACHE")  # the user's own has them compiled
    code = "softehl.load_kernel('film'); sys.exit(softehl.main(['kernels']))"
    command = [sys.executable, "-c", NO_SYMPY + code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    library, compiler = done.stdout.splitlines()[-2:]
    assert library.startswith("tuned library: ")
    assert compiler.startswith("compiler ")


# --------------------------------------------------------------------------------- installations


def test_an_installed_package_is_not_written_to(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "CHECKOUT", False)
    assert "generate needs a MODEL.py" in refused(capsys)


# ----------------------------------------------------------------------------- disks and folders


def full(handle: int) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("words", [["mine.py"], ["mine.py", "--target", "scalar", "--out", "a"]])
def test_a_full_disk_is_named_with_the_file(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    said = refused(capsys, *words)
    assert "softehl: cannot write /" in said or "softehl: cannot write a/" in said
    assert said.endswith("No space left on device\n")
    assert not list(Path("..").rglob("*.part-*"))


def test_a_write_that_fails_keeps_the_old_file(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("a.c").write_text("old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=r"No space left on device: 'a\.c'"):
        cache_store.write(Path("a.c"), b"new")
    assert Path("a.c").read_text() == "old"
    assert sorted(p.name for p in Path().iterdir()) == ["a.c", "mine.py"]


@pytest.mark.parametrize("target", [[], ["--target", "scalar"], ["--target", "ufcx"]])
def test_a_folder_that_cannot_be_made(
    target: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").write_text("")
    said = refused(capsys, "mine.py", "--out", "file/inside", *target)
    assert said == "softehl: cannot write file/inside: Not a directory\n"


def test_a_name_that_is_not_utf8(capsys: pytest.CaptureFixture[str]) -> None:
    name = os.fsdecode(b"mine-\xff.py")
    assert "is not UTF-8: rename it" in refused(capsys, name)


def test_a_model_without_a_rule(capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("mine.py").read_text()
    assert ", rule=quadrature.point_rule()" in text
    Path("mine.py").write_text(text.replace(", rule=quadrature.point_rule()", ""))
    assert "has no rule: give rule=quadrature.gauss(2, 2), say, or" in refused(capsys, "mine.py")


@pytest.mark.parametrize("words", ["kernels >&-", "keys oring >&-", "--help >&- 2>&-"])
def test_streams_that_are_closed_are_no_matter(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOFTEHL_CACHE")  # where the kernels that ship are compiled already
    command = f"'{sys.executable}' -m softehl {words}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert done.stderr == ""


# ----------------------------------------------------------------------- damage of a user's folder


def test_an_edited_manifest_is_named() -> None:
    assert softehl.main(["generate", "mine.py", "--out", "out"]) == 0
    path = Path("out/manifest.json")
    content = json.loads(path.read_text())
    for entry in content["kernels"].values():
        del entry["unknowns"]
    path.write_text(json.dumps(content))
    with pytest.raises(StaleKernelsError, match=r"manifest.json is damaged: run `softehl gen"):
        softehl.load_kernel("out")


@pytest.mark.parametrize("data", [b"", pytest.param(b"no library", marks=pytest.mark.slow)])
def test_a_damaged_library_is_refused_by_load_and_check_and_made_anew(
    data: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    assert softehl.main(["generate", "mine.py", "--out", "out"]) == 0
    library = Path("out") / build.LIBRARY
    whole = library.read_bytes()
    library.write_bytes(data)
    with pytest.raises(StaleKernelsError, match="the digest beside it is damaged: run `softehl"):
        softehl.load_kernel("out")
    capsys.readouterr()
    assert softehl.main(["generate", "mine.py", "--out", "out", "--check"]) == 1
    assert f"stale: {library}" in capsys.readouterr().err
    assert softehl.main(["generate", "mine.py", "--out", "out"]) == 0
    assert library.read_bytes() == whole
    assert softehl.load_kernel("out").library.kind == "tuned"
