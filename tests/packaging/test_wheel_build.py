"""Building a wheel: what it leaves, and how its kernels are compiled."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from softehl.codegen.tools import build

ROOT = Path(__file__).parents[2]
FOLDER = """
import runpy, setuptools
setuptools.setup = lambda **given: None
print(runpy.run_path("setup.py")["plain_library"]())
"""


def test_a_build_leaves_no_temporary_folder(tmp_path: Path) -> None:
    """Also one without a compiler, which says so."""
    done = subprocess.run(
        [sys.executable, "-c", FOLDER],
        cwd=ROOT,
        env={**os.environ, "CC": "no-such-compiler", "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "None"
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
