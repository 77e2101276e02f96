"""The cache: by content; processes at once, one that is killed, what is damaged."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.weak_form import Page
from softehl.codegen.tools import build, cache_dir, cache_store, kernel_cache
from softehl.codegen.tools.build import LIBRARY

ROOT = Path(__file__).parents[2]
MODEL = """
from softehl import Definition, Model, quadrature

def spring() -> Definition:
    m = Model("spring", nodes=1, rule=quadrature.point_rule(), unroll=True, doc="A spring.")
    m.coordinates("X")
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential(k * u**2 / 2)
    return m.finish()
"""
LOAD = """
import softehl, numpy, os, sys
from softehl.folder_lock import FolderLock
if os.environ.get("NO_LOCKS"):
    def refuse(lock, patience):
        raise OSError("no locks")
    FolderLock.take = refuse
kernel = softehl.load_kernel("spring.py")
print(kernel.residual(numpy.zeros((1, 1)), numpy.ones((1, 1)), parameters=[7.0])[0, 0])
print(*sorted({"sympy", "mpmath"} & set(sys.modules)))
"""
FIRST, AGAIN = "7.0\nmpmath sympy\n", "7.0\n\n"
"""What a process prints that derives, and one that finds the kernel: it loads no SymPy."""
COMPILER = """#!/bin/sh
case "$*" in *-dM*) ;; *) echo $PPID >> "{log}"; {wait};; esac
exec cc "$@"
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a model in it, and a cache of its own."""
    (tmp_path / "spring.py").write_text(MODEL)
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def slow_compiler(place: Path, delay: float) -> Path:
    """A compiler that takes its time."""
    return compiler(place, f"sleep {delay}")


def compiler(place: Path, wait: str) -> Path:
    """A compiler that notes in `compiled` who calls it, and waits."""
    script = place / "slow-cc"
    script.write_text(COMPILER.format(log=place / "compiled", wait=wait))
    script.chmod(0o755)
    return script


def loading(place: Path, **environment: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-c", LOAD],
        cwd=place,
        env={**os.environ, "PYTHONPATH": paths, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finished(process: subprocess.Popen[str]) -> str:
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (0, "")
    return out


def left(place: Path) -> list[Path]:
    """Temporary files anywhere in the cache."""
    return sorted((place / "cache").rglob(".part-*"))


def compilations(place: Path) -> int:
    return len((place / "compiled").read_text().splitlines())


def wait_for(path: Path) -> None:
    end = time.monotonic() + 60
    while not path.exists():
        assert time.monotonic() < end, f"{path} never came"
        time.sleep(0.02)


@pytest.mark.parametrize("locks", [True, False], ids=["locks", "no locks"])
def test_processes_that_build_at_once_all_succeed(place: Path, locks: bool) -> None:
    second = f'until [ "$(sort -u {place / "compiled"} | wc -l)" -gt 1 ]; do sleep 0.02; done'
    cc = str(slow_compiler(place, 0.5) if locks else compiler(place, second))
    processes = [loading(place, CC=cc, NO_LOCKS="" if locks else "1") for _ in range(2)]
    assert {finished(p) for p in processes} <= {FIRST, AGAIN}
    # one alone calls the compiler three times: the other waited, or did overlap
    assert compilations(place) == (3 if locks else 6)
    (folder,) = (place / "cache" / "built").iterdir()
    assert (folder / LIBRARY).is_file()
    assert left(place) == []
    before = compilations(place)
    assert finished(loading(place, CC=cc)) == AGAIN
    assert compilations(place) == before


def test_a_killed_process_leaves_no_lock_and_no_half_file(place: Path) -> None:
    slow = str(slow_compiler(place, 60.0))
    victim = loading(place, CC=slow)
    wait_for(place / "compiled")
    os.killpg(victim.pid, signal.SIGKILL)
    victim.communicate()
    assert list((place / "cache" / "built").glob("[!.]*")) == []
    (rest,) = left(place)[:1]
    slow_compiler(place, 0.0)  # the same command, hence the same key
    assert finished(loading(place, CC=slow)) == FIRST  # derived before, compiled and checked now
    assert finished(loading(place, CC=slow)) == AGAIN
    assert rest.exists()  # it might belong to a process that is alive
    os.utime(rest, (0, 0))
    with cache_store._scratch(rest.parent):
        assert not rest.exists()
    assert left(place) == []


def test_the_key_of_a_library_holds_all_that_it_is_built_from(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [kernel_cache.folder_of(Path("spring.py"))]
    assert kernel_cache.folder_of(Path("spring.py")) == folders[0]
    (place / "spring.py").write_text(MODEL.replace("u**2", "u**4"))
    folders.append(kernel_cache.folder_of(Path("spring.py")))
    monkeypatch.setattr("softehl.codegen.abi.VERSION", 999)
    folders.append(kernel_cache.folder_of(Path("spring.py")))
    monkeypatch.setattr(build, "FLAGS", (*build.FLAGS, "-DNOTHING"))
    folders.append(kernel_cache.folder_of(Path("spring.py")))
    monkeypatch.setenv("CC", str(slow_compiler(place, 0.0)))
    folders.append(kernel_cache.folder_of(Path("spring.py")))
    assert len(set(folders)) == len(folders)


@pytest.mark.parametrize("damage", ["edited", "library gone", "source gone", "emptied"])
def test_what_is_damaged_is_built_anew(damage: str) -> None:
    folder = kernel_cache.folder_of(Path("spring.py"))
    original = {p.name: p.read_bytes() for p in folder.iterdir() if p.name != LIBRARY}
    if damage == "edited":
        (folder / "spring.c").write_text("int edited;\n")
    elif damage == "library gone":
        (folder / LIBRARY).unlink()
    elif damage == "source gone":
        (folder / "spring.c").unlink()
    else:
        for path in folder.iterdir():
            path.unlink()  # this process has the library mapped
            path.write_bytes(b"")
    assert kernel_cache.folder_of(Path("spring.py")) == folder
    assert {p.name: p.read_bytes() for p in folder.iterdir() if p.name != LIBRARY} == original
    assert (folder / LIBRARY).stat().st_size > 1000


@pytest.fixture
def no_fallback() -> Iterator[None]:
    cache_dir._fallback.cache_clear()
    yield
    cache_dir._fallback.cache_clear()


@pytest.mark.usefixtures("no_fallback")
def test_a_cache_that_cannot_be_written_is_replaced_with_one_warning(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "file").write_text("not a folder")
    monkeypatch.setenv("SOFTEHL_CACHE", str(place / "file" / "cache"))
    with pytest.warns(RuntimeWarning, match=r"file/cache cannot be written .*set SOFTEHL_CACHE"):
        first = kernel_cache.folder_of(Path("spring.py"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert kernel_cache.folder_of(Path("spring.py")) == first
    assert (first / LIBRARY).is_file()
    assert not first.is_relative_to(place)


@pytest.mark.usefixtures("no_fallback")
@pytest.mark.parametrize("inside", ["", "derived"])
def test_a_cache_that_others_may_write_to_is_not_used(place: Path, inside: str) -> None:
    usual = kernel_cache.folder_of(Path("spring.py"))
    (place / "cache" / inside).chmod(0o777)
    if inside:  # its records are not believed, and nothing is added
        assert cache_store.recall(next((place / "cache" / inside).iterdir()).stem) is None
        with pytest.raises(cache_dir.CacheError, match=r"cache/derived is not used: others may"):
            kernel_cache.folder_of(Path("spring.py"))
    else:
        with pytest.warns(RuntimeWarning, match=r"cache is not used: others may .*chmod -R go-w"):
            found = kernel_cache.folder_of(Path("spring.py"))
        assert not found.is_relative_to(place)
    (place / "cache" / inside).chmod(0o755)
    assert kernel_cache.folder_of(Path("spring.py")) == usual


def test_what_pages_of_fields_share_is_compiled_once_and_again_where_it_is_damaged(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled: list[str] = []
    run = build._run

    def noted(command: Sequence[str], makes: Path) -> None:
        compiled.extend(Path(word).name for word in command if Path(word).name.startswith("pairs_"))
        run(command, makes)

    def page(name: str) -> Definition:
        def write(m: Fields) -> None:
            (k,) = m.parameters(k=name)
            g = m.grad(m.scalar(name))
            m.minimise(k * g.dot(g) / 2)

        return Page(name, write, form="point").definition("quad4")

    monkeypatch.setattr(build, "_run", noted)
    kernel_cache.library([page("T")])
    kernel_cache.library([page("c")])
    once = [name for name in compiled if name.endswith(".c")]
    assert len(once) == 1
    (stored,) = (place / "cache" / "built").glob(f"*/{build._OBJECT}")
    stored.write_bytes(b"nothing")
    kernel_cache.library([page("p")])
    assert [name for name in compiled if name.endswith(".c")] == 2 * once


# --- What is reported of a build ------------------------------------------------------------------


def test_a_build_that_takes_long_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    page = tmp_path / "spring.py"
    page.write_text(MODEL)
    with caplog.at_level("INFO", logger="softehl"):
        monkeypatch.setattr(kernel_cache, "PATIENCE", 1000.0)
        kernel_cache.folder_of(page)
        assert caplog.messages == []
        monkeypatch.setattr(kernel_cache, "PATIENCE", 0.0)
        page.write_text(MODEL.replace("/ 2", "/ 3"))
        kernel_cache.folder_of(page)
    assert "deriving spring: 1 unknowns, 1 points" in caplog.messages
    assert "compiling spring" in caplog.messages
