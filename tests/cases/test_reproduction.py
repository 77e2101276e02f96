"""The reproduction of the paper and what it finds."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from math import inf, isnan, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import softehl
from softehl.cases.harness import sweep
from softehl.cases.harness.errors import BadInput
from softehl.cases.paper import claims, docs_tables
from softehl.cases.paper import reproduce as computing
from softehl.cases.paper.checks import observed_order
from softehl.cases.paper.claims import FINDINGS
from softehl.cases.paper.figure_spec import Scope
from softehl.cases.paper.inverse_theory import film_of, largest_inlet_gradient
from softehl.cases.paper.lookup import Query, angle, ripple
from softehl.cases.paper.reproduce import ITEMS, reproduce_items
from softehl.cases.paper.states import NOT_REACHED, RequestedState, Store, ask, merged, setup
from softehl.cases.paper.tables import TABLE_2, unknowns
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import write_csv, write_json
from tests.cases.oring_cases import film_values

# --- `softehl reproduce`: a small version of every table and figure, what is kept, what is --------


SMALL = Scope(density=1, speeds=(1600.0,), pressures=(1.0,))
"""Every item from density 1, p_s = 1 MPa, |U| = 1600 mm/s: 28 runs."""


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.slow
def test_a_small_version_of_everything_and_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert reproduce_items([], SMALL, tmp_path, resume=False, jobs=1) == 0
    first = files(tmp_path)
    for name in ITEMS:
        assert first[f"{name}.txt"].startswith(ITEMS[name].title.encode())
        assert len(first[f"{name}.csv"].splitlines()) > 1, name
        assert (f"{name}.png" in first) == (
            name.startswith("fig") or name in ("leakage", "stabilisation")
        )
    assert b"Mesh density 1 (paper: 16)." in first["fig7.txt"]
    assert b"oscillating: U -1600" in first["fig7.txt"]
    assert b"under-resolved: U +1600 fe m_p 1" in first["fig16.txt"]
    assert b"not ok" not in first["fig17.txt"]
    monkeypatch.setattr(sweep, "solve_task", pytest.fail)
    names = ["fig7", "fig17", "statements"]
    for path in tmp_path.glob("*.*"):
        path.unlink()
    assert reproduce_items(names, SMALL, tmp_path, resume=True, jobs=1) == 0
    again = files(tmp_path)
    assert {"fig7.png", "fig7_states.csv", "fig17.csv", "statements.csv"} <= set(again)
    assert all(first[name] == content for name, content in again.items())


@pytest.mark.slow
def test_runs_side_by_side_are_the_same_as_one_by_one(tmp_path: Path) -> None:
    requests = [ask(setup(1, p_s), [1600.0]) for p_s in (0.0, 0.5)]
    stores = [Store(tmp_path / name) for name in ("one", "two")]
    for store, jobs in zip(stores, (1, 2), strict=True):
        computing.compute(requests, store, resume=False, jobs=jobs)
    for request in requests:
        one, two = (store.state(request.setup, 1600.0) for store in stores)
        assert one.row is not None
        assert repr(one.row) == repr(two.row)  # nan is not equal to itself
    assert {path.name for path in stores[1].folder.iterdir()} == {
        *("contacts", "d1-ps0", "d1-ps0.5"),
    }


def test_an_unknown_item_is_named_with_the_list(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "out"
    assert softehl.main(["reproduce", "fig99", "--out", str(target)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "'fig99' (did you mean 'fig9'?); allowed: table1, table2, fig3" in line
    assert not target.exists()


def test_a_table_by_name_and_a_folder_that_is_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert softehl.main(["reproduce", "table1", "--out", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "table1.csv").read_text()
    rows = list(csv.reader(text.splitlines()))
    assert all(ours == paper for _, _, ours, paper, _ in rows[1:11])
    (tmp_path / "file").write_text("")
    assert softehl.main(["reproduce", "table1", "--out", str(tmp_path / "file")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


# --- which runs -----------------------------------------------------------------------------------


def test_items_share_runs_and_their_folders_differ() -> None:
    requests = [r for item in ITEMS.values() for r in item.requests(Scope())]
    runs = merged(requests)
    assert len({r.name for r in runs}) == len(runs) == len({str(r.setup) for r in runs})
    found = {r.name: r for r in runs}
    assert all(r.speeds <= found[r.name].speeds for r in requests)
    assert max(r.setup.density for r in runs) == 8
    assert [r.setup.density for r in runs] == sorted((r.setup.density for r in runs), reverse=True)
    assert setup(4, 1.0) == found["d4-ps1"].setup
    assert "d2-ps1-pressure_order=1-reynolds=dg" in found


@pytest.mark.parametrize(("density", "finest"), [(1, 1), (2, 2), (16, 16)])
def test_a_density_is_a_limit_and_never_above_the_papers(density: int, finest: int) -> None:
    scope = Scope(density=density)
    densities = {
        name: {r.setup.density for r in item.requests(scope)} for name, item in ITEMS.items()
    }
    assert max(max(some, default=1) for some in densities.values()) == finest
    assert densities["fig12"] == {min(density, 2)}
    assert max(densities["fig13"]) == min(density, 8)


@pytest.mark.parametrize(
    ("status", "stroke", "speeds", "complete"),
    [
        ("converged", "both", [400.0, 100.0], True),
        ("not converged", "out", [100.0], True),
        ("running", "both", [400.0, 100.0], False),
        ("interrupted", "both", [100.0], False),
        ("converged", "in", [100.0], False),
        ("converged", "both", [400.0], False),
    ],
)
def test_a_run_is_kept_if_it_ended_with_all_that_is_asked_for(
    status: str, stroke: str, speeds: list[float], complete: bool, tmp_path: Path
) -> None:
    store, request = Store(tmp_path), ask(setup(2, 1.0), [100.0])
    parameters = setup(2, 1.0).model_dump() | {"stroke": stroke, "speeds": speeds}
    write_run(store.run_folder(request.setup), status, parameters)
    assert computing.is_complete(request, store) == complete


def write_run(folder: Path, status: str, parameters: dict[str, Any]) -> None:
    folder.mkdir(parents=True)
    write_json(folder / "run.json", {"status": status, "parameters": parameters})


# --- marks ----------------------------------------------------------------------------------------


def write_state(
    store: Store, parameters: Seal, speed: float, verdict: str, h: Sequence[float] = (2.0, 2.0)
) -> None:
    """A made-up state with h* = 2 um."""
    folder = store.run_folder(parameters)
    folder = folder / "rejected" if verdict == "collapsed" else folder
    folder.mkdir(parents=True, exist_ok=True)
    values = dict.fromkeys(FilmRow.header(), 1.0) | {
        "sealed_pressure_MPa": parameters.sealed_pressure,
        "rod_speed_mm_s": speed,
        "h_star_um": 2.0,
        "contact_start_mm": -1.0,
        "newton_iterations": 3,
    }
    write_csv(folder / "curve.csv", FilmRow.header(), [[*list(values.values())[:-1], verdict]])
    header = ("x_mm", "h_um", "p_MPa", "tau_MPa", "flux_mm2_s", "tau_rod_MPa")
    stroke = "out" if speed > 0 else "in"
    name = f"profile_{parameters.sealed_pressure:g}MPa_{stroke}_{abs(speed):g}mm_s.csv"
    places = np.linspace(-1.0, 1.0, len(h)).tolist()
    write_csv(
        folder / name, header, [[x, t, x, 0.0, 1.0, 0.0] for x, t in zip(places, h, strict=True)]
    )
    (folder / name.replace("profile", "section")).with_suffix(".vtu").touch()  # a row needs it too


VERDICTS = {1: "ok", 2: "oscillating", 4: "collapsed"}


@pytest.fixture
def marked(tmp_path: Path) -> Store:
    """The state of Fig. 10 at densities 1, 2 and 4, each with another verdict; none at 8."""
    store = Store(tmp_path)
    for density, verdict in VERDICTS.items():
        write_state(store, setup(density, 1.0), 400.0, verdict)
    return store


def test_statements_without_their_runs_are_not_decided(tmp_path: Path) -> None:
    rows = ITEMS["statements"].make(Store(tmp_path), SMALL).tables["statements"].rows
    decided = [row[2] for row in rows if row[-1] != "-"]
    assert decided == [
        "unknowns 1076, 3587, 12929, 48893, 189941",
        "pressure unknowns 109, 217, 433, 865, 1729",
        "viscosity 1.8 times at 30 MPa",
    ]


# --- what is measured -----------------------------------------------------------------------------


def test_observed_order_of_a_known_series() -> None:
    values = [3.0 + 0.7 * 4.0**-k for k in range(4)]
    assert observed_order(values) == pytest.approx((2.0, 3.0))
    assert observed_order([v + 0.01 for v in values])[1] != pytest.approx(3.0)
    for wrong in ([1.0, 2.0, 1.5], [1.0, 1.1, 1.3], [1.0, 2.0, 2.0], [1.0, inf, 2.0]):
        assert all(isnan(x) for x in observed_order(wrong))


@pytest.mark.parametrize("alpha", [0.0, 0.02])
@pytest.mark.parametrize("outstroke", [True, False])
def test_inverse_theory_finds_the_film_of_a_pressure_made_from_it(
    alpha: float, outstroke: bool
) -> None:
    """dp/dx exp(-alpha p) = 6 eta_0 U (h - h*) / h^3 integrated over a wedge; h* = 0.8 um."""
    film, speed, eta = 0.8e-3, 300.0, 6.59e-8
    x = np.linspace(0.0, 1.0, 40001)
    h = film * (4.0 - 3.0 * x)
    slope = 6.0 * eta * speed * (h - film) / h**3
    reduced = np.concatenate(([0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(x))))
    p = -np.log(1.0 - alpha * reduced) / alpha if alpha else reduced
    ring = Seal(pressure_viscosity=alpha, viscosity=eta)
    place = (x, p) if outstroke else (-x[::-1], p[::-1])
    w = largest_inlet_gradient(*place, ring, outstroke)
    assert film_of(w, speed) == pytest.approx(1e3 * film, rel=1e-3)
    assert film_of(2.0 * w, speed) == pytest.approx(1e3 * film / sqrt(2.0), rel=1e-3)
    thicker = largest_inlet_gradient(
        *place, Seal(pressure_viscosity=alpha, viscosity=2 * eta), outstroke
    )
    assert film_of(thicker, speed) != pytest.approx(1e3 * film, rel=0.1)


def test_the_angle_of_a_straight_wedge() -> None:
    x = np.linspace(0.0, 0.2, 7)
    assert angle(x, 1e3 * x * np.tan(np.radians(12.0)), 5.0, 20.0) == pytest.approx(12.0)
    assert isnan(angle(x, np.ones(7), 5.0, 20.0))


@pytest.mark.parametrize(("sign", "rise"), [(1.0, 0.0), (1.0, 0.3), (-1.0, 0.3)])
def test_a_ripple_is_what_rises_before_the_dip(sign: float, rise: float, tmp_path: Path) -> None:
    h = [9.0, 2.0, 1.9, 1.5, 1.5 + 2.0 * rise, 1.4, 1.2, 1.8, 6.0][:: int(sign)]
    store, ring = Store(tmp_path), setup(2, 1.0)
    write_state(store, ring, sign * 400.0, "ok", h)
    assert ripple(store.state(ring, sign * 400.0)) == pytest.approx(rise)
    assert isnan(ripple(store.state(ring, -sign * 400.0)))


# --- the page -------------------------------------------------------------------------------------


def test_bad_input_is_one_line() -> None:
    with pytest.raises(BadInput, match="allowed: table1"):
        reproduce_items(["figure 7"], Scope(), Path("nowhere"), resume=False, jobs=1)


def test_what_holds_no_tension_back_lets_the_pressure_fall(tmp_path: Path) -> None:
    scope = Scope(density=2, speeds=(1600.0,), pressures=(1.0,))
    assert reproduce_items(["cavitation"], scope, tmp_path, resume=False, jobs=1) == 0
    with (tmp_path / "cavitation.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert -0.05 < float(row["least_p_MPa"]) < 0.0
    assert float(row["least_p_without_MPa"]) < -0.3
    assert abs(float(row["h_star_change_percent"])) < 0.1
    assert float(row["friction_change_percent"]) > 1.0


TEMPLATE = (
    "before\n<!-- table t: b, verdicts -->\nold\n<!-- end -->\n<!-- caption c -->\n<!-- end -->\n"
)


def test_a_profile_that_is_no_plain_result_is_dotted_or_absent(marked: Store) -> None:
    product = ITEMS["fig10"].make(marked, Scope())
    figure = Figure()
    assert product.draw is not None
    product.draw(figure)
    lines = {str(line.get_label()): line.get_linestyle() for line in figure.axes[1].lines}
    assert lines == {
        "density 1": "-",
        "density 2 (oscillating)": ":",
        "density 4 (collapsed)": "None",
        f"density 8 ({NOT_REACHED})": "None",
    }
    assert (
        "oscillating: U +400 d 2; collapsed: U +400 d 4; not reached: U +400 d 8" in product.caption
    )
    verdicts = [row[-1] for row in product.tables["fig10_states"].rows]
    assert verdicts == [*VERDICTS.values(), NOT_REACHED]
    assert {row[0] for row in product.tables["fig10"].rows} == {"density 1", "density 2"}


def test_a_point_that_is_no_plain_result_is_hollow_or_absent(marked: Store) -> None:
    product = ITEMS["fig17"].make(marked, Scope())
    figure = Figure()
    assert product.draw is not None
    product.draw(figure)
    points = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    faces = {float(np.asarray(p.get_xdata())[0]): p.get_markerfacecolor() for p in points}
    assert set(faces) == {1.0, 2.0}
    assert faces[2.0] == "white" != faces[1.0]
    assert [text.get_text() for text in figure.axes[0].texts] == ["o"]


def test_the_page_takes_its_tables_from_files(tmp_path: Path) -> None:
    write_csv(tmp_path / "t.csv", ("a", "b", "verdicts"), [[1.0, 0.123456, ".o"], [2.0, 3.0, "-"]])
    (tmp_path / "c.txt").write_text("A caption.\n")
    text = docs_tables.renewed(TEMPLATE, tmp_path)
    assert "old" not in text
    assert "| b | verdicts |\n|---|---|\n| 0.1235 | `.o` |\n| 3 | `-` |\n" in text
    assert "\nA caption.\n" in text
    assert docs_tables.renewed(text, tmp_path) == text
    with pytest.raises(ValueError, match="no column 'z'; allowed: a, b, verdicts"):
        docs_tables.renewed(TEMPLATE.replace("b,", "z,"), tmp_path)


# --- Statements on the paper are decided by numbers, and fail for wrong ones ----------------------


Told = Callable[..., dict[str, Any]]


class Made(Query):
    """A query whose states are made up: columns of a row by density, p_s, U and other keys."""

    told: Told

    def state(self, density: int, p_s: float, speed: float, **others: Any) -> RequestedState:
        columns = {"h_star_um": 1.0, "verdict": "ok", **self.told(density, p_s, speed, **others)}
        row = FilmRow(**film_values(**columns))
        return RequestedState(setup(density, p_s, **others), speed, row)


def decided(number: int, told: Told) -> bool | None:
    query = Made(Store(Path()), Scope())
    object.__setattr__(query, "told", told)
    return FINDINGS[number - 1][2](query).holds


@pytest.mark.parametrize(("effect", "holds"), [(1.02, True), (1.004, False)])
def test_shear_counts_only_above_the_error_of_the_mesh(effect: float, holds: bool) -> None:
    def told(density: int, *_: float, shear_traction: bool = True, **__: Any) -> dict[str, Any]:
        error = 1.0 + 0.05 / density**2
        return {"h_star_um": error * (effect if shear_traction else 1.0)}

    assert decided(18, told) is holds


@pytest.mark.parametrize(
    ("index", "change", "holds"), [(0.3, 1.005, True), (0.3, 1.02, False), (0.7, 1.005, None)]
)
def test_only_mild_oscillations_leave_the_film(
    index: float, change: float, holds: bool | None
) -> None:
    def told(density: int, *_: float, **__: Any) -> dict[str, Any]:
        coarse = {"h_star_um": change, "verdict": "oscillating", "oscillation_index": index}
        return coarse if density == 4 else {}

    assert decided(32, told) is holds


@pytest.mark.parametrize(
    ("slow", "holds"),
    [((0.03, 0.05, 0.2), True), ((0.03, 0.2, 0.1), False), ((0.0, 1e-3, 0.0), None)],
)
def test_only_ripples_that_can_be_seen_are_compared(
    slow: tuple[float, ...], holds: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    ripples = dict(
        zip((800.0, 400.0, 200.0, 100.0, 50.0, 25.0), (2e-7, 1e-7, 0.0, *slow), strict=True)
    )
    monkeypatch.setattr(claims, "ripple", lambda state: ripples[state.rod_speed])
    assert decided(30, lambda *_, **__: {}) is holds


@pytest.mark.parametrize(
    ("coarse", "fine", "holds"), [(1.002, 1.0, True), (1.0, 1.0, False), (1.002, 1.002, False)]
)
def test_quadrature_has_to_matter_where_it_is_said_to(
    coarse: float, fine: float, holds: bool
) -> None:
    def told(
        density: int, *_: float, pressure_order: int = 4, quadrature: str = "gauss", **__: Any
    ) -> dict[str, Any]:
        low = density < 4 and pressure_order <= 2
        return {"h_star_um": (coarse if low else fine) if quadrature == "lobatto" else 1.0}

    assert decided(39, told) is holds


@pytest.mark.parametrize("density", TABLE_2)
def test_the_papers_unknowns_are_those_of_a_boundary_twice_the_arc(density: int) -> None:
    def counted(density: int, sides: int) -> int:
        """Displacements, pressures, rod, three obstacles on the whole boundary, one moment."""
        d = density
        nodes = 360 * d**2 + sides * d // 2 + 1
        return 2 * nodes + (108 * d + 1) + (27 * d + 1) + 3 * sides * d + 1

    assert counted(density, 54) == TABLE_2[density][0]
    assert counted(density, 66) != TABLE_2[density][0]


def test_our_unknowns_are_counted_as_the_page_says() -> None:
    for d in (1, 2, 4):
        assert unknowns(d) == (720 * d**2 + 318 * d + 9, 108 * d + 1)
