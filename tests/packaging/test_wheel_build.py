"""Building a wheel: what it leaves, and how its kernels are compiled."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from softehl.codegen.tools import build

ROOT = Path(__file__).parents[2]
BUILD = """
import os, runpy, setuptools, signal
def setup(distclass, **given):
    distribution = distclass()
    distribution.commands = ["bdist_wheel"]
    print(distribution.has_ext_modules(), flush=True)
    {end}
setuptools.setup = setup
runpy.run_path("setup.py")
"""


@pytest.mark.parametrize(
    ("end", "code"),
    [("pass", 0), ("1 / 0", 1), ("os.kill(os.getpid(), signal.SIGTERM)", 143)],
)
def test_a_build_leaves_no_temporary_folder(tmp_path: Path, end: str, code: int) -> None:
    """A build without a compiler, which says so; one that fails, and one that is ended."""
    done = subprocess.run(
        [sys.executable, "-c", BUILD.format(end=end)],
        cwd=ROOT,
        env={**os.environ, "CC": "no-such-compiler", "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip()) == (code, "False")
    assert "THE WHEEL IS BUILT WITHOUT A LIBRARY" in done.stderr
    assert not list(tmp_path.glob("softehl-build-*"))


@pytest.mark.skipif("-march=x86-64" not in build.PLAIN, reason="measured on x86-64")
def test_the_plain_library_computes_several_elements_at_once_where_that_pays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all((build.GENERATED / f"{name}.c").is_file() for name in build.WIDE)
    for name in ("solid_q4", "film"):
        (tmp_path / f"{name}.c").write_text("int nothing_" + name + ";\n")
    wide = {}
    run = build._run

    def spied(command: list[str], makes: Path) -> None:
        wide[makes.stem] = "-DSOFTEHL_LANES=1" not in command
        run(command, makes)

    monkeypatch.setattr(build, "_run", spied)
    build.build_plain(tmp_path)
    assert wide["solid_q4"]
    assert not wide["film"]
