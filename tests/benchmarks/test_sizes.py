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


def test_lines_are_counted(root: Path) -> None:
    counted = {f.place.split()[-1]: f.lines for f in sizes.functions_of(root)}
    assert counted == {"short": 3, "method": 4, "inner": 2}
    header, line = sizes.table(root)
    shown = dict(zip(header, line, strict=True))
    assert shown["room"] == "runtime"
    assert (shown["files"], shown["lines"], shown["functions"]) == ("1", "9", "3")
    assert (shown["median"], shown["longest"]) == ("3", "4")
