"""Files of a run: whole or not at all, and the same numbers when read back."""

import json
import math
from pathlib import Path

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softehl.runtime import io


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    io.write_text(path, "old\n")

    def killed() -> None:
        with io.replacing(path) as temporary:
            temporary.write_text("half of")
            raise RuntimeError("killed")

    with pytest.raises(RuntimeError, match="killed"):
        killed()
    assert path.read_text() == "old\n"
    assert list(tmp_path.iterdir()) == [path]


def test_a_write_is_seen_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with io.replacing(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"


@settings(deadline=None, derandomize=True)
@given(st.floats(allow_nan=False))
def test_number_text_reads_back_to_the_same_number(value: float) -> None:
    text = io.number_text(value)
    assert float(text) == value
    assert not text.endswith(".0")


def test_columns_read_back(tmp_path: Path, rng: np.random.Generator) -> None:
    columns = {"x_mm": rng.standard_normal(7), "p_MPa": rng.standard_normal(7)}
    path = tmp_path / "profile.csv"
    io.write_columns(path, columns)
    assert path.read_text().splitlines()[0] == "x_mm,p_MPa"
    again = io.read_columns(path, ["x_mm", "p_MPa"])
    assert all(np.array_equal(again[name], columns[name]) for name in columns)


@pytest.mark.parametrize("text", ["", "a,c\n1,2\n", "a,b\n1\n"])
def test_another_table_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"t\.csv"):
        io.read_csv(path, ["a", "b"])


def test_json_has_no_nan(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    value = {"a": math.nan, "b": (1, math.inf), "c": np.float64(2.5), "d": np.arange(2)}
    io.write_json(path, value)
    assert io.read_json(path) == {"a": None, "b": [1, None], "c": 2.5, "d": [0, 1]}
    json.loads(path.read_text(), parse_constant=pytest.fail)


def test_json_must_be_an_object(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_text("[1]")
    with pytest.raises(ValueError, match="not a JSON object"):
        io.read_json(path)


def test_vtu_reads_back(tmp_path: Path, rng: np.random.Generator) -> None:
    points = rng.standard_normal((6, 2))
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    stress = rng.standard_normal(2)
    moved = rng.standard_normal((6, 3))
    path = tmp_path / "section.vtu"
    io.write_vtu(path, points, cells, {"displacement": moved}, {"sigma_zz": stress})
    mesh = meshio.read(path)
    assert np.array_equal(mesh.points, np.column_stack([points, np.zeros(6)]))
    assert np.array_equal(mesh.cells_dict["quad"], cells)
    assert np.array_equal(mesh.point_data["displacement"], moved)
    assert np.array_equal(mesh.cell_data["sigma_zz"][0], stress)
    assert list(tmp_path.iterdir()) == [path]


def test_a_damaged_section_is_named(tmp_path: Path) -> None:
    path = tmp_path / "s.vtu"
    with pytest.raises(FileNotFoundError):
        io.read_vtu(path)
    path.write_text("<VTKFile>")
    with pytest.raises(ValueError, match=r"s\.vtu: not a section"):
        io.read_vtu(path)
