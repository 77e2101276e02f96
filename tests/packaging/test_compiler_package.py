"""The compiler of the package `ziglang`: taken where there is no other, and said so."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from softehl.codegen import c_compiler
from softehl.codegen.tools import build

ROOT = Path(__file__).parents[2]
ZIG = c_compiler.ziglang()
needs_zig = pytest.mark.skipif(ZIG is None, reason="the package ziglang is not installed")
LOGGED = """
import logging, sys
logging.basicConfig(level=logging.INFO, stream=sys.stderr)
"""


@pytest.fixture
def imitated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package `ziglang` whose program is a script, and no other compiler."""
    package, empty = tmp_path / "ziglang", tmp_path / "empty"
    package.mkdir()
    empty.mkdir()
    (package / "__init__.py").write_text("")
    (package / "zig").write_text("#!/bin/sh\n")
    (package / "zig").chmod(0o755)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PATH", str(empty))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("CXX", raising=False)
    return package / "zig"


def test_it_is_taken_where_there_is_no_other(
    imitated: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level("INFO", "softehl"):
        assert c_compiler.compiler() == [str(imitated), "cc"]
        assert c_compiler.compiler() == [str(imitated), "cc"]
    (line,) = caplog.messages
    assert line.startswith("the C compiler is that of the package ziglang ")
    assert line.endswith(": none of cc, gcc, clang is on the PATH")
    monkeypatch.setenv("CC", "icx -m64")
    assert c_compiler.compiler() == ["icx", "-m64"]
    assert c_compiler.compiler(c_compiler.CXX) == [str(imitated), "cc"]
    monkeypatch.setenv("CXX", "icpx")
    assert c_compiler.compiler(c_compiler.CXX) == ["icpx"]


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_one_of_the_system_is_taken_first(
    imitated: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    other = Path(os.environ["PATH"]) / name
    shutil.copy(imitated, other)
    assert c_compiler.compiler() == [name]


def test_flags_are_those_that_it_knows() -> None:
    flags = c_compiler.supported(["/a/zig", "cc"], build.PLAIN)
    assert not set(flags) & set(c_compiler.GCC_ALONE)
    assert all("x86-64" not in flag for flag in flags)
    assert c_compiler.supported(["cc"], build.PLAIN) == list(build.PLAIN)


def test_the_gcc_of_windows_gets_no_wide_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    macros = {"gcc": "#define __MINGW32__ 1\n", "zig": "#define __MINGW32__ 1\n#define __clang__ 1"}
    for name, flags in (("gcc", build.PLAIN), ("zig", build.FLAGS)):
        monkeypatch.setattr(build, "identification", lambda _, text=macros[name]: f"cc\n{text}")
        assert build.tuned_flags()[0] == flags


# ---------------------------------------------------------------------------- the package itself

Program = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def alone(tmp_path: Path) -> Program:
    """A Python with an empty cache and nothing on the PATH."""
    (tmp_path / "empty").mkdir()
    variables = {
        "PATH": str(tmp_path / "empty"),
        "SOFTEHL_CACHE": str(tmp_path / "cache"),
        "XDG_CACHE_HOME": str(tmp_path / "zig"),
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
    }
    environment = {k: v for k, v in os.environ.items() if k not in ("CC", "SOFTEHL_KERNELS")}

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *words],
            cwd=tmp_path,
            env={**environment, **variables},
            capture_output=True,
            encoding="utf-8",
            check=True,
        )

    return run


@needs_zig
@pytest.mark.slow
def test_an_emulated_device_runs_without_a_compiler(alone: Program) -> None:
    text = """
from softehl import Mesh, Study
from tests.device.test_device_kernels import page
study = Study(Mesh.rectangle(1, 1, cells=(2, 2)))
study.add("sheet", page("springs"), E=1.0, bed=1.0)
study.fix("bottom", u_x=0, u_y=0)
study.load("top", u_x=0.01)
for device in (None, "emulated"):
    print(f'{study.solve(linear="matrix-free", device=device).at((1, 1))["u_x"]:.12e}')
"""
    done = alone("-c", LOGGED + text)
    here, there = done.stdout.split()
    assert here == there
    assert "the C++ compiler is that of the package ziglang" in done.stderr


@needs_zig
@pytest.mark.slow
def test_the_twenty_lines_of_the_readme_run_without_a_compiler(alone: Program) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", readme, re.DOTALL)
    assert blocks is not None
    done = alone("-c", LOGGED + blocks[1])
    assert done.stdout == blocks[2]
    said = [line for line in done.stderr.splitlines() if "the C compiler is that" in line]
    assert len(said) == 1


@needs_zig
@pytest.mark.slow
def test_the_kernels_that_ship_are_tuned_by_it(alone: Program) -> None:
    out = alone("-m", "softehl", "kernels").stdout
    assert "\ntuned library: " in out
    assert re.search(r"\ncompiler Clang .*, package ziglang: .*zig(\.exe)? cc\n", out)


FUNCTION = """
from pathlib import Path
import softehl

source = Path(__file__).with_name("square.c")

@softehl.page
def bar(m):
    u = m.scalar("u")
    y = m.external("square", [u], source=source, derivatives=2)
    m.minimise(y + sum(g**2 for g in m.grad(u)))

kernel = softehl.load_kernel(bar, cell="quad4")
print(kernel.name)
"""


@needs_zig
@pytest.mark.slow
def test_a_c_function_of_the_user_is_compiled_by_it(alone: Program, tmp_path: Path) -> None:
    (tmp_path / "square.c").write_text(
        "#include <stddef.h>\n"
        "int square(const double *x, double *y, double *dy, double *ddy) {\n"
        "    y[0] = x[0] * x[0];\n    if (dy) dy[0] = 2 * x[0];\n    if (ddy) ddy[0] = 2;\n"
        "    return 0;\n}\n"
    )
    (tmp_path / "bar.py").write_text(FUNCTION)
    assert "bar" in alone("bar.py").stdout


@needs_zig
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_the_files_for_a_c_program_are_built_by_it(tmp_path: Path) -> None:
    page = ROOT / "docs" / "models" / "neo_hooke.py"
    command = ["-m", "softehl", "generate", str(page), "--target", "cpp", "--out", str(tmp_path)]
    subprocess.run([sys.executable, *command], check=True, capture_output=True)
    zig = shlex.quote(str(ZIG))
    tools = [f"CC={zig} cc", f"CXX={zig} c++", f"AR={zig} ar"]
    done = subprocess.run(
        ["make", "-C", str(tmp_path), *tools, "test"],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
