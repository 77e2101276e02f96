"""Targets `c` and `cpp`: the folder's own test, its header, and the Python kernel."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given

from softehl.codegen import pipeline
from softehl.codegen.hosts.element_interface import (
    ElementInterface,
    PreviousValue,
    TimeStepValue,
    UserInput,
)
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import cli
from tests.codegen import field_pages
from tests.codegen.hosts.random_pages import FEW, A, K, page, pages
from tests.codegen.hosts.workshop import errors, folder, made, off_python

ROOT = Path(__file__).parents[3]
NEO_HOOKE = ROOT / "docs" / "models" / "neo_hooke.py"
HEAT = ROOT / "docs" / "models" / "heat.py"


def simple() -> Definition:
    return page("quad4", A**2 * K, A**3, conservative=False)


@pytest.mark.parametrize("host", ["c", "cpp"])
def test_a_folder_tests_itself(host: str, tmp_path: Path) -> None:
    if host == "cpp" and shutil.which("g++") is None:
        pytest.skip("no C++ compiler")
    assert cli.generate([NEO_HOOKE], target=host, out=tmp_path) == 0
    strict = f"-O1 -Wall -Wextra -Werror -Wpedantic -Wno-psabi{' -std=c++17' * (host == 'cpp')}"
    done = made(tmp_path, "all", **{"CXXFLAGS" if host == "cpp" else "CFLAGS": strict})
    assert done.returncode == 0, done.stderr
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    *values, first, second = errors(done.stdout)
    assert len(values) == 5
    assert max(values) < 1e-13
    assert 0 < max(first, second) < 1e-6
    shown = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=True)
    assert shown.stdout.startswith("residual[0] = ")


def test_a_page_of_fields_on_a_large_cell_tests_itself(tmp_path: Path) -> None:
    d = field_pages.rubber.definition("quad9")
    assert pipeline.form(d).at_points
    done = made(folder(d, "c", tmp_path), CFLAGS="-O1 -Wall -Wextra -Werror -Wno-psabi")
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:5]) < 1e-12


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("samples.h", "sample_residual[] = {\n    ", "sample_residual[] = {\n    1.0 + "),
        ("random_quad4.c", "X, u, data, p, NULL", "X, X, data, p, NULL"),
    ],
)
def test_the_test_of_a_folder_sees_a_fault(name: str, old: str, new: str, tmp_path: Path) -> None:
    folder(simple(), "c", tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@pytest.mark.slow
@FEW
@given(d=pages())
def test_random_pages_give_what_their_python_kernels_give(
    d: Definition, tmp_path_factory: pytest.TempPathFactory
) -> None:
    place = folder(d, "c", tmp_path_factory.mktemp("c"))
    assert made(place, "lib").returncode == 0
    assert off_python(d, place) < 1e-13


# -------------------------------------------------------------------------------- the description


def test_who_fills_the_arguments_of_a_page() -> None:
    seen = ElementInterface.of(simple(), "c")
    assert seen.parameters == [UserInput(0)]
    assert seen.data == [UserInput(1), *(PreviousValue(k, rate=False) for k in range(4))]
    assert [a.name for a in seen.inputs] == ["k", "c"]
    assert seen.by_node() == [0, 4, 1, 5, 2, 6, 3]
    assert seen.renewed == [1]
    assert not seen.symmetric
    assert seen.cell is not None
    assert seen.cell.name == "quad4"


def test_rates_come_from_the_step_in_time() -> None:
    from softehl.codegen.tools import model_loader

    (heat,) = model_loader.definitions(HEAT)
    seen = ElementInterface.of(heat, "c")
    assert seen.parameters == [UserInput(0), UserInput(1), TimeStepValue("rate")]
    assert seen.data == [PreviousValue(0, rate=True), PreviousValue(1, rate=True)]


def test_a_folder_of_somebody_else_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "Makefile").write_text("all:\n")
    assert cli.generate([NEO_HOOKE], target="c", out=tmp_path) == 2
    assert "holds Makefile, which softehl did not write" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["Makefile"]


def test_a_folder_of_ours_is_written_anew(tmp_path: Path) -> None:
    assert cli.generate([HEAT], target="c", out=tmp_path) == 0
    (tmp_path / "heat.h").write_text("")
    assert cli.generate([HEAT], target="c", out=tmp_path) == 0
    assert (tmp_path / "heat.h").stat().st_size > 1000
