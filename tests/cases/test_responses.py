"""The pictures of a sweep: what varies beside the key of an axis is told."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from softehl.cases.harness.responses import Response, draw_panel, draw_responses
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import Cell
from tests.cases.oring_cases import film_values

UNITS = {"sealed_pressure": "MPa", "shore_A": ""}
FRICTION = next(c for c in FilmRow.columns() if c.name == "rod_friction_N")


def rows(hardnesses: int) -> list[dict[str, Cell]]:
    """A grid of two keys, with two states each."""
    return [
        {
            **film_values(rod_speed_mm_s=speed, rod_friction_N=p * shore, h_star_um=1.0 / p),
            "sealed_pressure": p,
            "shore_A": shore,
        }
        for p in (3.0, 1.0, 2.0)
        for shore in range(60, 60 + hardnesses)
        for speed in (400.0, -400.0)
    ]


def drawn(found: list[dict[str, Cell]]) -> tuple[list[str], Figure]:
    """Words of the legend, and the panel of the friction over the sealed pressure."""
    figure = Figure()
    response = Response("sealed_pressure", UNITS, found, FilmRow)
    return draw_panel(figure.subplots(), response, FRICTION)[1], figure


def test_a_second_key_has_a_colour_and_its_values_a_line() -> None:
    words, figure = drawn(rows(3))
    assert words == [
        *("shore_A = 60", "shore_A = 61", "shore_A = 62"),
        *("U = +400 mm/s", "U = -400 mm/s"),
    ]
    lines = figure.axes[0].get_lines()
    assert len(lines) == 6
    assert len({line.get_color() for line in lines}) == 3
    assert len({line.get_marker() for line in lines}) == 2
    assert [list(line.get_xdata()) for line in lines] == 6 * [[1.0, 2.0, 3.0]]  # type: ignore[arg-type]
    assert list(lines[0].get_ydata()) == [60.0, 120.0, 180.0]  # type: ignore[arg-type]


def test_too_many_values_leave_the_states() -> None:
    words, _ = drawn(rows(9))
    assert words == ["U = +400 mm/s", "U = -400 mm/s"]


def test_every_key_that_varies_has_a_picture(tmp_path: Path) -> None:
    names = draw_responses(tmp_path, rows(1), UNITS, FilmRow)
    assert names == ["response_sealed_pressure.png"]
    assert {path.name for path in tmp_path.iterdir()} == set(names)
