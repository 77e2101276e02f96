"""Films in time: squeeze against closed forms, and cycles of the O-ring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import softehl
from softehl.cases.cycle import CASE, Cycle, cycle_row
from softehl.cases.seal.cycle import cycle_driver
from softehl.cases.seal.cycle.cycle_driver import Films
from softehl.cases.seal.cycle.motion import RodFilm, RodMotion, TimeTable
from softehl.cases.seal.cycle.transient import Reading
from softehl.cases.seal.equations.definition import FILM, PRESSURE, SQUEEZE, VOID
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report.cycle import (
    loop_figure,
    write_animation,
)
from softehl.cases.slider.film import FilmOil, GapFilm
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation import quadrature
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.io import read_arrays, read_table
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.solve.newton import Newton
from tests.reference.calling import fitted_order

ETA = 6.59e-8
Gap = Callable[[float], float]


def strip(h: float, segments: int = 8, length: float = 1.0) -> GapFilm:
    """A film between parallel plates."""
    nodes = np.linspace(0.0, length, segments + 1)
    x = np.stack([nodes[:-1], nodes[1:]], axis=1)
    return GapFilm(x, np.full_like(x, h), 4, FilmOil(ETA))


def problem_of(one: GapFilm, speed: float) -> Problem:
    """The film of a strip, and what it holds as a block of its own, at rest."""
    study, content = one.study(speed), load_kernel("film_squeeze")
    along, rule = {PRESSURE: one.rows, VOID: one.rows}, quadrature.content_rule(one.order)
    resting = dict[str, Any](dict.fromkeys(content.parameters, 0.0))
    study.add(SQUEEZE, content, along=along, rule=rule, **resting)
    return one.build_problem(study, speed).with_parameters(**{SQUEEZE: None})


def march(gap: Gap, times: Array, order: int, ends: float) -> list[tuple[Array, Array, float]]:
    """Pressures, void fractions and the defect of mass at every time, of plates h(t) apart."""
    one, found = strip(gap(float(times[0]))), []
    x = np.zeros(problem_of(one, 0.0).layout.total)
    contents: list[Array] = []
    volumes = [0.0]
    for k, t in enumerate(times):
        now = strip(gap(float(t)))
        problem = now.between(problem_of(now, 1.0), np.array([ends, ends]), np.zeros(2))
        content = problem.with_parameters(**{SQUEEZE: {"rod_radius": 0.0, "rate": 0.0}})
        if k:
            steps = [times[k] - times[k - 1]]
            steps += [times[k - 1] - times[k - 2]] if order == 2 and k > 1 else []
            w = softehl.BDF2().weights(steps)
            before = sum(a * c for a, c in zip(w[1:], contents, strict=False))
            points = np.asarray(before)[:, :, None]
            squeezed = problem.assembler.with_data(SQUEEZE, point_data=points)
            rate = {SQUEEZE: {"rod_radius": 0.0, "rate": float(w[0])}}
            problem = replace(problem, assembler=squeezed).with_parameters(**rate)
            problem = problem.with_parameters(**{FILM: {"rod_speed": 0.0}})
            solution = Newton(tolerance=1e-13, stagnation=1e5, max_iterations=200).solve(problem, x)
            assert solution.converged
            x = solution.x
            rows = problem.assembler.residual(x, problem.parameters)[problem.layout.part(PRESSURE)]
            before = sum(a * v for a, v in zip(w[1:], volumes, strict=False))
            volumes = [(rows[-1] + rows[0] - before) / w[0], *volumes[:1]]
        contents = [content.fields(SQUEEZE, x)["content"], *contents[:1]]
        at = content.fields(SQUEEZE, x)
        held = float((at["dx"] * at["h_T"] * (1.0 - at["v"])).sum())
        found.append(
            (x[problem.layout.part(PRESSURE)], x[problem.layout.part(VOID)], held + volumes[0])
        )
    return found


@pytest.mark.parametrize("order", [1, 2])
def test_the_squeezed_strip_converges_with_the_order_of_its_differences(order: int) -> None:
    """A load w brings plates together by 1 / h^2 = 1 / h0^2 + 2 w t / (eta L^3)."""
    w, h0, L = 1.0, 2e-3, 1.0

    def gap(t: float) -> float:
        return 1.0 / math.sqrt(h0**-2 + 2.0 * w * t / (ETA * L**3))

    end, counts = 0.02, (16, 32, 64)
    errors: list[float] = []
    for n in counts:
        p, _, _ = march(gap, np.linspace(0.0, end, n + 1), order, 0.0)[-1]
        places = strip(h0).positions
        load = float(0.5 * (p[1:] + p[:-1]) @ np.diff(places))
        # linear pressures on subcells carry a little less of the parabola, whatever the steps
        share = np.trapezoid(places * (L - places), places) * 6.0 / L**3
        errors.append(float(abs(load / share / w - 1.0)))
    assert order - 0.25 < -fitted_order(counts, errors) < order + 0.4


def test_plates_that_swing_rupture_and_keep_their_oil() -> None:
    """h = 0.375 + 0.125 cos 4 pi t between 0.025 at both ends; void from t = 0.2500791572.

    In d/dx (h^3 p') = 2 d(theta h)/dt p is in 6 eta (lengths and times are one).
    """
    scale = 6.0 * ETA

    def gap(t: float) -> float:
        return 0.375 + 0.125 * math.cos(4.0 * math.pi * t)

    times = np.linspace(0.0, 0.35, 701)
    found = march(gap, times, 1, 0.025 * scale)
    masses = np.array([mass for _, _, mass in found])
    assert np.ptp(masses) < 1e-12 * masses[0]
    torn = np.array([v.max() > 1e-9 for _, v, _ in found])
    assert times[torn][0] == pytest.approx(0.2500791572, abs=1e-3)
    # the front stands within segments of 1/8: least half-width of the full film at either end
    k = int(np.argmin(abs(times - 0.3148258613)))
    _, v, _ = found[k]
    x = strip(1.0).positions
    first = int(np.flatnonzero(v > 1e-9)[0])
    assert 0.0 < x[first] < 0.125
    assert 0.005 < x[first] < 0.06  # 0.0230077051, on subcells of 0.02 to 0.04


def test_the_frame_does_not_matter() -> None:
    """A surface that moves with w over a rod of U + w is one at rest over a rod of U."""
    nodes = np.linspace(0.0, 1.0, 9)
    x = np.stack([nodes[:-1], nodes[1:]], axis=1)
    h = 2e-3 * (2.0 - x)
    one = GapFilm(x, h, 4, FilmOil(ETA))
    results = []
    for w in (0.0, 137.0):
        problem = one.between(problem_of(one, 400.0 + w), np.zeros(2), np.zeros(2))
        moving = problem.assembler.with_data(FILM, data=np.full((8, 2), w))
        results.append(
            Newton(tolerance=1e-12, stagnation=1e4, max_iterations=60)
            .solve(replace(problem, assembler=moving), np.zeros(problem.layout.total))
            .x
        )
    np.testing.assert_allclose(results[1], results[0], rtol=0, atol=1e-9 * abs(results[0]).max())


def test_motions_repeat_and_stop_at_their_corners() -> None:
    sine = RodMotion.sine(20.0, 2.0, 1.0)
    assert sine.speed.largest == pytest.approx(40.0 * math.pi)
    assert sine.position(0.125) == pytest.approx(10.0, rel=2e-4)
    assert sine.position(5.125) == pytest.approx(sine.position(0.125), abs=1e-9)
    trapezoid = RodMotion.trapezoid(20.0, 2.0, 0.1, 1.0)
    assert trapezoid.position(0.125) == pytest.approx(10.0)
    assert trapezoid.speed.next_corner(0.0) == pytest.approx(0.1)
    assert trapezoid.speed.next_corner(0.1) == pytest.approx(0.15)
    with pytest.raises(ValueError, match="rising"):
        TimeTable.of([(0.0, 1.0), (0.0, 2.0)])


def test_the_rod_brings_back_what_was_left_on_it() -> None:
    rod = RodFilm([], [])
    for place, film in ((0.0, 1.0), (1.0, 3.0), (2.0, 5.0)):
        rod.leave(place, film)
    assert rod.thickness_at(0.5) == 2.0
    assert rod.thickness_at(2.5) is None
    rod.leave(1.0, 7.0)
    assert rod.thickness_at(1.5) is None
    assert rod.thickness_at(1.0) == 7.0


def cycle(folder: Path, *settings: str) -> dict[str, Array]:
    """The table of a run at density 1."""
    keys = [f"--set={s}" for s in ("density=1", "roughness=0.3", *settings)]
    assert softehl.main(["run", "cycle", *keys, "--out", str(folder), "--quiet"]) == 0
    text = (folder / "curve.csv").read_text().splitlines()
    names = text[0].split(",")
    cells = [line.split(",") for line in text[1:]]
    return {n: np.array([float(c[k]) for c in cells]) for k, n in enumerate(names[:-1])}


@pytest.mark.slow
def test_a_cycle_balances_and_becomes_periodic(tmp_path: Path) -> None:
    table = cycle(tmp_path / "c", "cycles=3", "motion={stroke = 20, frequency = 2}")
    assert table["mass_error"].max() < 1e-9
    assert table["change_percent"][-1] < 1.0
    assert table["leak_mm3"][-1] == pytest.approx(table["leak_sealed_mm3"][-1], rel=2e-3)
    assert table["friction_in_N"][-1] < 0.0 < table["friction_out_N"][-1]
    loop = read_table(tmp_path / "c" / "loop_cycle_3.csv")
    film = read_table(tmp_path / "c" / "film_cycle_3.csv")
    assert len(film["t_s"]) % len(loop["t_s"]) == 0
    assert np.all(np.diff(loop["t_s"]) > 0.0)


@pytest.mark.slow
def test_keys_of_steady_films_are_named() -> None:
    words = CASE.warnings(Cycle(roughness=(0.0, 0.2), speeds=(100.0,), tolerance=0.2))
    assert words == [
        f"{k} has no effect on a cycle, only on steady films" for k in ("speeds", "tolerance")
    ]


def test_a_motion_that_does_not_go_to_and_fro_is_warned_of() -> None:
    def words(*motion: tuple[float, float], **keys: float) -> list[str]:
        return CASE.warnings(Cycle(roughness=(0.0, 0.2), motion=motion, **keys))  # type: ignore[arg-type]

    back = ((0.0, 100.0), (0.2, 100.0), (0.25, -100.0), (0.45, -100.0))
    assert words(*back, (0.5, 100.0)) == []
    assert words(*back) == [
        "motion: the speed jumps from -100 to 100 mm/s where it repeats; "
        "end it with the speed that it begins with"
    ]
    assert words((0.0, 100.0), (0.2, 100.0), travel=5.0) == [
        "travel has no effect beside a motion of its own",
        "motion: the rod does not come back: +20 mm farther in each cycle",
    ]


@pytest.mark.parametrize(
    ("highest", "says"),
    [(400.0, "sealed_pressure = 400 MPa is .* films are found up to"), (-1.0, "-1 MPa; a sealed")],
)
def test_pressures_without_films_are_refused(highest: float, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Cycle(roughness=(0.0, 0.2), pressures=((0.0, 1.0), (0.5, highest)))


def test_a_motion_by_words_contradicts_no_key() -> None:
    words: Any = {"stroke": 40.0, "frequency": 1.0}
    with pytest.raises(ValueError, match=r"travel = 30\.0 and motion contradict"):
        Cycle(roughness=(0.0, 0.2), motion=words, travel=30.0)
    assert Cycle(roughness=(0.0, 0.2), motion=words, travel=40.0).travel == 40.0


@pytest.mark.slow
def test_long_periods_give_the_steady_curve(tmp_path: Path) -> None:
    """The mean leak over the period tends to that of steady strokes as one over it."""
    leaks = []
    for n, frequency in enumerate((0.2, 0.02, 0.002)):
        shares = ((0.0, 100), (0.24, 100), (0.26, -100), (0.74, -100), (0.76, 100), (1.0, 100))
        motion = ",".join(f"[{share / frequency},{speed}]" for share, speed in shares)
        table = cycle(tmp_path / str(n), "cycles=2", f"motion=[{motion}]")
        leaks.append(table["leak_mm3"][-1] * frequency)
    assert abs(leaks[2] - leaks[1]) < 0.2 * abs(leaks[1] - leaks[0])


@pytest.mark.slow
def test_a_run_that_goes_on_does_the_same_to_the_last_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the end of a cycle, with what the rod carries then, and from the middle of the next."""
    given = ("supply=returned", "frequency=10", "time_tolerance=0.05")
    whole = cycle(tmp_path / "whole", *given, "cycles=2")
    assert whole["cycle"].tolist() == [1.0, 2.0]
    cycle(tmp_path / "parts", *given, "cycles=1")
    keys = [f"--set={s}" for s in ("density=1", "roughness=0.3", *given, "cycles=2")]
    parts = tmp_path / "parts"
    begun = (parts / "loop_cycle_1.csv").stat().st_mtime_ns
    resume = ["run", "cycle", *keys, "--out", str(parts), "--resume", "--quiet"]
    steps, drafts = [0], parts / "unfinished.npz"
    film_of = cycle_driver._film

    def ended(*given: Any) -> dict[str, Array]:
        steps[0] += 1
        if steps[0] > 23:
            raise KeyboardInterrupt
        return film_of(*given)

    with monkeypatch.context() as patched:
        patched.setattr(cycle_driver, "BETWEEN_DRAFTS", 0.0)
        patched.setattr(cycle_driver, "_film", ended)
        assert softehl.main(resume) == 130
    held = read_arrays(drafts)
    assert held is not None
    assert held["key"].tolist() == [2.0]
    assert len(held["loop/t_s"]) == 23
    assert softehl.main(resume) == 0
    assert not drafts.exists()
    assert (parts / "loop_cycle_1.csv").stat().st_mtime_ns == begun
    for name in ("curve.csv", "loop_cycle_2.csv", "film_cycle_2.csv", "state_cycle_2.csv"):
        assert (parts / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


MOTIONS = {
    "trapezoidal": (
        "motion={stroke=20, frequency=2, shape='trapezoidal'}",
        "supply=returned",
        "cycles=2",
    ),
    "from a file": ("motion=motion.csv", "supply=returned", "cycles=3"),
    "pressure": ("pressures=[[0, 1], [0.2, 1], [0.25, 2], [0.45, 2], [0.5, 1]]", "cycles=2"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_other_motions_balance_too(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "t_s,U_mm_s\n0,100\n0.1,100\n0.15,-100\n0.35,-100\n0.4,100\n0.5,100\n"
    Path("motion.csv").write_text(rows)
    table = cycle(tmp_path / "c", *MOTIONS[name])
    assert table["mass_error"].max() < 1e-9
    assert table["change_percent"][-1] < 1.0
    last = int(table["cycle"][-1])
    loop = read_table(tmp_path / "c" / f"loop_cycle_{last}.csv")
    assert loop["friction_N"].min() < 0.0 < loop["friction_N"].max()
    highest = 2.0 if name == "pressure" else 1.0
    assert loop["sealed_pressure_MPa"].max() == pytest.approx(highest)


def _reading(t: float, place: float, speed: float, friction: float) -> Reading:
    names = {field.name: 1.0 for field in fields(Reading)}
    known = {"t_s": t, "place_mm": place, "rod_speed_mm_s": speed, "friction_N": friction}
    return Reading(**{**names, **known, "iterations": 1})  # type: ignore[arg-type]


def test_the_loop_closes_and_costs_what_the_table_says() -> None:
    # two strokes of 2 mm at 1 mm/s against 2 N; the first step is half of the outstroke
    out = [_reading(t, t, 1.0, 2.0) for t in (0.0, 1.0, 2.0)]
    back = [_reading(t, 4.0 - t, -1.0, -2.0) for t in (2.0, 3.0, 4.0)]
    films = Films(readings=[*out[1:], *back])
    row = cycle_row(1, 1.0, films, out[0], None)
    assert row.energy_mJ == pytest.approx(8.0)
    loop = {name: np.array([getattr(r, name) for r in films.readings]) for name in asdict(out[0])}
    loops = {"cycle = 1": loop, "cycle = 2": loop}
    (axes,) = loop_figure(loops, [row.energy_mJ, row.energy_mJ]).axes
    _, second, _ = axes.lines
    place, friction = (np.asarray(values) for values in second.get_data())
    assert place[0] == place[-1] == 0.0
    assert len(friction) == len(loop["t_s"]) + 1
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [f"{k}: 8 mJ" for k in loops]


def film_and_loop(times: int = 4, nodes: int = 9) -> tuple[dict[str, Array], dict[str, Array]]:
    """Tables of a made-up cycle: h = 1 + x^2 + t um, friction 2 N against the rod."""
    t, x = np.linspace(0.1, 1.0, times), np.linspace(-1.0, 1.0, nodes)
    h = 1.0 + x**2 + t[:, None]
    film = {
        "t_s": np.repeat(t, nodes),
        "x_mm": np.tile(x, times),
        "h_um": h.ravel(),
        "p_MPa": np.tile(1.0 - x**2, times),
    }
    U = 10.0 * np.cos(2.0 * np.pi * t)
    loop = {"t_s": t, "rod_speed_mm_s": U, "place_mm": np.sin(t), "friction_N": 2.0 * np.sign(U)}
    return film, loop


def test_an_animation_moves(tmp_path: Path) -> None:
    film, loop = film_and_loop()
    p, angle = Seal(), np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    outline = {
        "t_s": np.repeat([0.1, 1.0], 40),
        "z_mm": np.tile(1.7 * np.cos(angle), 2),
        "r_mm": np.concatenate([26.6 + 1.5 * np.sin(angle), 26.6 + 1.4 * np.sin(angle)]),
    }
    write_animation(tmp_path / "cycle.gif", p, film, loop, outline)
    with Image.open(tmp_path / "cycle.gif") as image:
        assert getattr(image, "n_frames", 1) >= 4
    assert [path.name for path in tmp_path.iterdir()] == ["cycle.gif"]
