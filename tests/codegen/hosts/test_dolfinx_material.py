"""Target `ufcx` of a material: the test of its folder, with DOLFINx where it is installed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from softehl.codegen.language.weak_form import CellOptions
from softehl.codegen.tools import cli
from tests.codegen.hosts.materials import j2, neo
from tests.codegen.hosts.workshop import errors, folder, made

PYTHON = os.environ.get("SOFTEHL_DOLFINX", sys.executable)
"""A Python that has DOLFINx."""
LAW = "from tests.codegen.hosts.materials import hooke\n"


def has_dolfinx() -> bool:
    found = subprocess.run([PYTHON, "-c", "import dolfinx_solver, dolfinx"], capture_output=True)
    return found.returncode == 0


needs_dolfinx = pytest.mark.skipif(not has_dolfinx(), reason="no DOLFINx; see SOFTEHL_DOLFINX")


@needs_dolfinx
def test_a_law_with_history_in_a_form(tmp_path: Path) -> None:
    done = made(folder(j2, "ufcx", tmp_path), PYTHON=PYTHON)
    assert done.returncode == 0, done.stdout + done.stderr
    stress, state, differences, force, committed = errors(done.stdout)
    assert max(stress, state) < 1e-13
    assert differences < 1e-8
    assert force < 1e-11
    assert committed == 0
    assert "5 iterations" in done.stdout


@needs_dolfinx
def test_the_test_of_a_folder_sees_a_fault(tmp_path: Path) -> None:
    text = (folder(neo, "ufcx", tmp_path) / "neo_dolfinx.py").read_text()
    assert "else 3 * i + j" in text
    (tmp_path / "neo_dolfinx.py").write_text(text.replace("else 3 * i + j", "else 3 * j + i"))
    done = made(tmp_path, PYTHON=PYTHON)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


def test_a_file_of_materials_has_another_writer_than_elements(tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text(LAW)
    assert cli.generate([path], target="ufcx", out=tmp_path / "law") == 0
    module = (tmp_path / "law" / "hooke_dolfinx.py").read_text()
    compile(module, "hooke_dolfinx.py", "exec")
    on = CellOptions(("tet4",))
    assert cli.generate([path], target="ufcx", out=tmp_path / "cell", on=on) == 0
    assert [p.suffix for p in (tmp_path / "cell").iterdir()] == [".c"]
