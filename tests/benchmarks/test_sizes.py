"""Sizes of files and functions are counted as the script says."""

from pathlib import Path

import pytest

from benchmarks import sizes

SOURCE = '''"""A file of ten lines that are not blank."""


def short(a, b, *, c):
    """Three lines, three parameters."""
    return a


class Thing:
    def method(self, a, b, c, d, e, f, g):

        def inner(x):
            return x

        return inner
'''


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "runtime").mkdir()
    (tmp_path / "runtime" / "a.py").write_text(SOURCE)
    return tmp_path


def test_lines_and_parameters_are_counted(root: Path) -> None:
    (file,) = sizes.files_of(root / "runtime")
    assert file.lines == 9
    counted = {f.place.split()[-1]: (f.lines, f.parameters) for f in sizes.functions_of(root)}
    assert counted == {"short": (3, 3), "method": (4, 7), "inner": (2, 1)}


def test_the_table_has_a_line_for_each_room(root: Path) -> None:
    header, line = sizes.table(root)
    shown = dict(zip(header, line, strict=True))
    assert shown["room"] == "runtime"
    assert (shown["files"], shown["lines"], shown["functions"]) == ("1", "9", "3")
    assert (shown["median"], shown["longest"], shown["parameters > 6"]) == ("3", "4", "1")
    assert [line.split()[1] for line in sizes.over_budget(root)] == ["method:"]
