"""Sweeps of runs, in processes side by side."""

import csv
import itertools
import json
import math
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm, uniform

import softehl
from softehl.cases.harness.case import Run, load_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.process_pool import completed, processes, solve_side_by_side
from softehl.cases.harness.study_file import StudyFile, read_study
from softehl.cases.harness.sweep import Curve, SweepTask, in_order
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.tolerances import band
from softehl.cases.shipped import SHIPPED, solve_cases
from softehl.cases.slider import case as slider
from softehl.runtime.kernels.kernel import ArgumentError, MissingKernelsError, StaleKernelsError
from softehl.runtime.solve.linear.direct import MissingBackend
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from tests.cases.elsewhere import double, fail, tell_and_end, wait_in_a_worker
from tests.cases.test_parameters import REFUSED

# --- `softehl sweep`: points, errors, resumed sweeps, equal tables on whatever runs them ----------


GRID = """
case = "slider"
speeds = [400, 200]
segments = 40

[grid]
h0 = {from = "1 um", to = "2 um", count = 3}
ratio = [2.2, 3]
"""


def study(path: Path, text: str) -> StudyFile:
    path.write_text(text)
    return read_study(str(path), SHIPPED)


def swept(path: Path, text: str, *options: str) -> int:
    path.write_text(text)
    return softehl.main(["sweep", str(path), "--quiet", "--out", str(path.parent / "s"), *options])


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


# --- points ---------------------------------------------------------------------------------------


def test_a_grid_is_every_combination(tmp_path: Path) -> None:
    read = study(tmp_path / "s.toml", GRID)
    expected = itertools.product((0.001, 0.0015, 0.002), (2.2, 3))
    assert [tuple(point.values()) for point in read.points] == [
        pytest.approx(pair) for pair in expected
    ]
    assert read.keys == ("h0", "ratio")
    assert [p.h0 for p in read.runs] == [p["h0"] for p in read.points]  # type: ignore[union-attr]


def test_a_grid_of_logarithms_words_and_whole_numbers(tmp_path: Path) -> None:
    grid = """
    case = "slider"
    grid.viscosity = {from = 1e-9, to = 1e-7, count = 3, spacing = "log"}
    grid.profile = ["wedge", "parabola"]
    grid.segments = {from = 10, to = 30, count = 3}
    """
    points = study(tmp_path / "s.toml", grid).points
    assert sorted({p["viscosity"] for p in points}) == pytest.approx([1e-9, 1e-8, 1e-7])
    assert {p["segments"] for p in points} == {10, 20, 30}
    assert len(points) == 18


def test_a_list_fills_up_from_what_is_fixed(tmp_path: Path) -> None:
    text = 'case = "slider"\n[[list]]\nh0 = 0.002\n[[list]]\nratio = 3.0\n'
    read = study(tmp_path / "s.toml", text)
    assert read.points == ({"h0": 0.002, "ratio": 2.2}, {"h0": 0.001, "ratio": 3.0})


def test_a_latin_hypercube_has_one_point_in_each_slice(tmp_path: Path) -> None:
    text = """
    case = "slider"
    [latin_hypercube]
    count = 50
    seed = {}
    between.h0 = ["1 um", "2 um"]
    between.ratio = [2, 4]
    """
    read = [study(tmp_path / "s.toml", text.format(seed)).points for seed in (1, 1, 2)]
    assert read[0] == read[1] != read[2]
    for key, low, high in (("h0", 0.001, 0.002), ("ratio", 2.0, 4.0)):
        shares = np.array([(p[key] - low) / (high - low) for p in read[0]])
        assert sorted(np.floor(50 * shares)) == list(range(50))


@pytest.mark.parametrize(
    ("shape", "law"), [("uniform", uniform(-1, 2).cdf), ("normal", norm(0, 0.5).cdf)]
)
def test_random_tolerances(shape: str, law: Callable[[float], float], tmp_path: Path) -> None:
    text = f"""
    case = "slider"
    h0 = 0.001
    [random]
    count = 2000
    distribution = "{shape}"
    tolerances.h0 = "0.1 um"
    tolerances.ratio = "5 %"
    """
    points = study(tmp_path / "s.toml", text).points
    off = np.array([((p["h0"] / 0.001 - 1) / 0.1, (p["ratio"] / 2.2 - 1) / 0.05) for p in points])
    for column in off.T:
        assert kstest(column, law).pvalue > 0.01
    assert abs(np.corrcoef(off.T)[0, 1]) < 0.06
    assert study(tmp_path / "s.toml", text.replace("2000", "10")).points == points[:10]


def test_the_law_of_tolerances_is_seen() -> None:
    """The other distribution fails the test above."""
    rng = np.random.default_rng(1)
    assert kstest(rng.uniform(-1, 1, 2000), norm(0, 0.5).cdf).pvalue < 1e-6


RING = """
case = "oring"
ring = "AS568-226"
rod = 50
squeeze = 12
shore_A = 70
material = "neo-hooke"
[random]
count = 5
"""


def test_a_tolerance_leaves_what_followed_from_a_name(tmp_path: Path) -> None:
    """The housing was cut for the nominal section; a harder rubber has another modulus."""
    path = tmp_path / "s.toml"
    runs: Any = study(path, RING + 'tolerances.section_diameter = "0.1 mm"').runs
    assert len({p.section_diameter for p in runs}) == 5
    assert len({p.housing_diameter for p in runs}) == 1
    read = study(path, RING + "tolerances.shore_A = 5")
    softest = sorted(zip((p["shore_A"] for p in read.points), read.runs, strict=True))
    moduli = [p.mu for _, p in softest]  # type: ignore[union-attr]
    assert moduli == sorted(set(moduli))


def test_keys_that_move_together(tmp_path: Path) -> None:
    text = 'case = "oring"\n[random]\ncount = 5\ntolerances."mu_1, mu_2" = "15 %"\n'
    read = study(tmp_path / "s.toml", text)
    default: Any = load_case(SHIPPED["oring"]).parameters()
    for p in read.points:
        assert p["mu_1"] / default.mu_1 == pytest.approx(p["mu_2"] / default.mu_2, rel=1e-14)


# --- bad input ------------------------------------------------------------------------------------

HEAD = 'case = "slider"\n'


@pytest.mark.parametrize(("text", "words"), REFUSED["sweep"])
def test_bad_input_is_one_line(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert swept(tmp_path / "s.toml", text) == 2
    error = capsys.readouterr().err
    assert words in error
    assert len(error.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


# --- runs -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The grid, run by one process without an interruption."""
    folder = tmp_path_factory.mktemp("reference")
    assert swept(folder / "s.toml", GRID) == 0
    return folder / "s"


def test_a_sweep_is_its_runs(reference: Path) -> None:
    rows = table(reference)
    assert [row["run"] for row in rows] == [str(n) for n in range(1, 7) for _ in range(2)]
    assert {row["status"] for row in rows} == {"converged"}
    for row in rows:
        folder = reference / "runs" / f"{int(row['run']):05d}"
        with (folder / "curve.csv").open(newline="") as file:
            curve = {r["rod_speed_mm_s"]: r for r in csv.DictReader(file)}
        assert curve[row["rod_speed_mm_s"]].items() <= row.items()
        given = json.loads((folder / "run.json").read_text())["parameters"]
        assert [given["h0"], given["ratio"]] == [float(row["h0"]), float(row["ratio"])]
    assert {path.name for path in reference.iterdir()} == {
        *("sweep.csv", "run.json", "runs", "response_h0.png", "response_ratio.png")
    }
    content = json.loads((reference / "run.json").read_text())
    assert (content["status"], content["counts"]) == ("done", {"converged": 6})
    assert content["fixed"] == {"speeds": [400, 200], "segments": 40}


def test_a_folder_with_a_sweep(
    reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, few = tmp_path / "s.toml", GRID.replace("count = 3", "count = 2").replace(", 3]", "]")
    assert swept(path, few) == 0
    assert swept(path, GRID) == 2
    assert "--resume keeps its runs, --overwrite begins anew" in capsys.readouterr().err
    assert swept(path, GRID, "--resume") == 2
    assert "a sweep with other points" in capsys.readouterr().err
    assert swept(path, GRID.replace("segments = 40", "segments = 20"), "--resume") == 2
    assert "a sweep with other fixed" in capsys.readouterr().err
    assert swept(path, GRID, "--overwrite") == 0
    same_tables(tmp_path / "s", reference)
    assert swept(path, few, "--overwrite") == 0
    assert len(list((tmp_path / "s" / "runs").iterdir())) == 2


def same_tables(folder: Path, expected: Path) -> None:
    assert (folder / "sweep.csv").read_text() == (expected / "sweep.csv").read_text()


def test_more_points_behind(tmp_path: Path) -> None:
    """A study may be extended; what is there is kept, what is damaged is run again."""
    text = 'case = "slider"\nsegments = 40\n[random]\ncount = 4\ntolerances.h0 = "5 %"\n'
    path, runs = tmp_path / "s.toml", tmp_path / "s" / "runs"
    assert swept(path, text.replace("4\n", "3\n")) == 0
    before = {folder.name: (folder / "run.json").stat().st_mtime_ns for folder in runs.iterdir()}
    (runs / "00002" / "curve.csv").write_text("")
    assert swept(path, text, "--resume") == 0
    after = {folder.name: (folder / "run.json").stat().st_mtime_ns for folder in runs.iterdir()}
    assert {name for name in after if before.get(name) != after[name]} == {"00002", "00004"}
    assert len(table(tmp_path / "s")) == 4 * 3


def test_runs_that_cannot_be_and_runs_that_fail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solve = slider.SliderCase.solution

    def broken(case: Any, parameters: Any, key: float) -> Any:
        if parameters.h0 > 0.0015:
            raise FloatingPointError("no such gap")
        return solve(case, parameters, key)

    monkeypatch.setattr(slider.SliderCase, "solution", broken)
    text = HEAD + "speeds = [400]\nsegments = 40\n[grid]\nend = [-2, 0.75]\nh0 = [0.001, 0.002]"
    assert swept(tmp_path / "s.toml", text) == 3
    rows = table(tmp_path / "s")
    assert [row["status"] for row in rows] == [
        *("not possible", "not possible", "converged", "failed")
    ]
    assert "start = -1.5 must be less than end = -2" in rows[0]["words"]
    assert rows[3]["words"] == "FloatingPointError: no such gap"
    assert rows[3]["flux_mm2_s"] == "" != rows[2]["flux_mm2_s"]
    assert "3 of 4 runs did not converge; run 1 not possible" in capsys.readouterr().err
    monkeypatch.undo()
    assert swept(tmp_path / "s.toml", text, "--resume") == 3
    assert [row["status"] for row in table(tmp_path / "s")][2:] == ["converged"] * 2


def test_dask_gives_the_same_table(
    reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        assert swept(tmp_path / "s.toml", GRID, "--dask", cluster.scheduler_address) == 0
    same_tables(tmp_path / "s", reference)
    assert swept(tmp_path / "s.toml", GRID, "--overwrite", "--dask", "tcp:/127.0.0.1:1") == 2
    assert "no scheduler there" in capsys.readouterr().err


def test_a_sweep_killed_and_resumed(reference: Path, tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(GRID)
    command = [sys.executable, "-m", "softehl", "sweep", str(path), "--quiet"]
    command += ["--out", str(tmp_path / "s"), "--resume", "--jobs", "2"]
    process = subprocess.Popen(command, start_new_session=True)
    end = time.monotonic() + 120.0
    while len(list(tmp_path.glob("s/runs/*/curve.csv"))) < 2 and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert swept(path, GRID, "--resume") == 0
    same_tables(tmp_path / "s", reference)


@pytest.mark.slow
def test_seals_share_contacts_and_agree(tmp_path: Path) -> None:
    """Runs of one section start from each other's contact: equal but for places of mesh nodes."""
    text = """
    case = "oring"
    density = 1
    stroke = "out"
    speeds = [1600]
    error_estimate = false
    [grid]
    viscosity = ["30 mPa s", "60 mPa s"]
    """
    tables = []
    for jobs in ("1", "2"):
        assert swept(tmp_path / "s.toml", text, "--overwrite", "--jobs", jobs) == 0
        tables.append([float(row["h_star_um"]) for row in table(tmp_path / "s")])
    assert tables[0] == pytest.approx(tables[1], rel=1e-4)
    assert tables[0][1] > 1.3 * tables[0][0]


TOLERANCES = """
case = "oring"
stroke = "out"
speeds = [400]
error_estimate = false
[random]
count = 4
distribution = "normal"
tolerances."mu_1, mu_2" = "15 %"
tolerances.viscosity = "20 %"
tolerances.rod_diameter = "0.025 mm"
tolerances.section_diameter = "0.1 mm"
"""


@pytest.mark.slow
def test_runs_follow_the_sensitivities(tmp_path: Path) -> None:
    """Each as the product of powers says, to 2.5 %; with one of them turned round they do not."""
    assert swept(tmp_path / "s.toml", TOLERANCES) == 0
    keys = ("mu_1", "mu_2", "viscosity", "rod_diameter", "section_diameter")
    given: Any = load_case(SHIPPED["oring"]).parameters(
        stroke="out", speeds=(400.0,), error_estimate=False, sensitivity=True
    )
    state = softehl.run_oring(given, softehl.Silent()).states[0]
    assert state.sensitivity is not None
    for quantity, column in (("h_star", "h_star_um"), ("friction", "rod_friction_N")):
        powers = np.array([state.sensitivity[quantity][key] for key in keys])
        rows = table(tmp_path / "s")
        off = np.array([[float(r[k]) / getattr(given, k) for k in keys] for r in rows])
        found = np.array([float(r[column]) for r in rows]) / getattr(state, column)
        assert np.exp(np.log(off) @ powers) == pytest.approx(found, rel=0.025)
        turned = powers * np.where(np.array(keys) == "viscosity", -1.0, 1.0)
        assert np.exp(np.log(off) @ turned) != pytest.approx(found, rel=0.025)


SHARES = {
    "modulus": {"mu_1": 0.15, "mu_2": 0.15},
    "viscosity": {"viscosity": 0.2},
    "rod_diameter": {"rod_diameter": 5e-4},
    "section_diameter": {"section_diameter": 0.0288},
    "inner_diameter": {"inner_diameter": 0.009},
}


@pytest.mark.slow
def test_a_tolerance_band_is_that_of_the_runs(tmp_path: Path) -> None:
    """Each tolerance half of it up or down, in balance: twice the deviation of the eight runs has
    no chance in it, and is the linear band but for what is not linear; without one tolerance the
    band is another.
    """
    given: Any = load_case(SHIPPED["oring"]).parameters(
        stroke="out", speeds=(400.0,), error_estimate=False, sensitivity=True
    )
    text = 'case = "oring"\nstroke = "out"\nspeeds = [400]\nerror_estimate = false\n'
    for a, b, c in itertools.product((-1, 1), repeat=3):
        text += "[[list]]\n"
        for sign, moved in zip((a, b, c, a * b, a * c), SHARES.values(), strict=True):
            for key, share in moved.items():
                text += f"{key} = {math.exp(0.5 * sign * share) * getattr(given, key)!r}\n"
    assert swept(tmp_path / "s.toml", text) == 0
    rows = table(tmp_path / "s")
    assert [row["verdict"] for row in rows] == ["ok"] * 8
    state = softehl.run_oring(given, softehl.Silent()).states[0]
    assert state.sensitivity is not None
    columns = {"h_star": "h_star_um", "friction": "rod_friction_N", "leakage": "leak_rate_mm3_s"}
    for quantity, column in columns.items():
        logs = np.log([abs(float(row[column])) for row in rows])
        of_runs = 200.0 * float(logs.std())
        slopes = state.sensitivity[quantity]
        likely = band((1.0, 400.0), quantity, slopes, SHARES).likely_percent
        assert of_runs == pytest.approx(likely, rel=0.04), quantity
        fewer = {name: share for name, share in SHARES.items() if name != "viscosity"}
        assert band((1.0, 400.0), quantity, slopes, fewer).likely_percent < 0.95 * of_runs


# --- Work in other processes: results, errors, the end of either side; curves through any ---------


ERRORS = (
    BadInput("one line"),
    MissingKernelsError("none"),
    StaleKernelsError("old"),
    ArgumentError("wrong"),
    MissingBackend("none"),
    SingularMatrix("zero"),
    KeyError("name"),
)


def case(**changes: Any) -> Seal:
    given = {"density": 1, "sealed_pressure": 0.5, "stroke": "out", "speeds": (1600.0,)}
    paper = {"mesh": "uniform", "arc_start": -34.0, "arc_end": 43.0}
    return Seal(**{**paper, **given, **changes})


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    with processes(2) as executor:
        yield executor


# --- tasks ----------------------------------------------------------------------------------------


def test_results_with_and_without_an_executor(pool: Executor) -> None:
    for executor in (None, pool):
        assert dict(completed(double, [3, 1, 2], executor)) == {0: 6, 1: 2, 2: 4}


@pytest.mark.parametrize("number", range(len(ERRORS)))
def test_an_error_comes_back_as_what_it_is(number: int, pool: Executor) -> None:
    copy = pickle.loads(pickle.dumps(ERRORS[number]))
    assert (type(copy), copy.args) == (type(ERRORS[number]), ERRORS[number].args)
    with pytest.raises(type(ERRORS[number])) as raised:
        list(completed(fail, [ERRORS[number]], pool))
    assert raised.value.args == ERRORS[number].args


def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    target = tmp_path / "pid"
    parent = multiprocessing.get_context("spawn").Process(target=wait_in_a_worker, args=(target,))
    parent.start()
    worker = int(eventually(lambda: target.read_text() if target.exists() else ""))
    os.kill(worker, 0)  # it is there
    assert parent.pid is not None
    os.kill(parent.pid, signal.SIGKILL)
    parent.join()
    assert eventually(lambda: not alive(worker))


def eventually(look: Any, seconds: float = 120.0) -> Any:
    """What `look` sees as soon as that is something."""
    end = time.monotonic() + seconds
    while not (seen := look()) and time.monotonic() < end:
        time.sleep(0.02)
    return seen


def alive(pid: int) -> bool:
    """Whether a process runs (an orphan that nobody collects is none that runs)."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


# --- strokes side by side -------------------------------------------------------------------------


class Counter(Observer):
    """Keeps what it is told; may have no room for more."""

    def __init__(self, room: int) -> None:
        self.room, self.stages = room, list[str]()

    def stage(self, name: str, **details: Any) -> None:
        self.stages.append(name)

    def step(self, **details: Any) -> None:
        self.room -= 1
        if self.room == 0:
            raise OSError("no room")


def test_every_call_arrives_in_order() -> None:
    counters = [Counter(1), Counter(1)]
    outcomes = solve_side_by_side(tell_and_end, [1, 2], counters)
    assert [o.states for o in outcomes] == [(1,), (2,)]
    assert [c.stages for c in counters] == [[str(n) for n in range(500)]] * 2


# --- curves ---------------------------------------------------------------------------------------


def rows(curve: Curve) -> dict[float, float]:
    return {row.rod_speed_mm_s: row.h_star_um for row in curve.rows}


SWEEP = [case(stroke=stroke, sealed_pressure=p) for p in (0.0, 0.5) for stroke in ("out", "in")]


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> list[Curve]:
    """The sweep without an executor."""
    return solve_cases(SWEEP, tmp_path_factory.mktemp("serial"))


def test_a_sweep_here(serial: list[Curve]) -> None:
    assert [curve.parameters for curve in serial] == SWEEP
    assert all(curve.converged for curve in serial)
    folder = serial[0].folder.parent
    name = "density=1-mesh=uniform-sealed_pressure=0.5-stroke=out-speeds=1600"
    assert serial[2].folder.name == f"{name}-arc_start=-34-arc_end=43"
    assert len(list((folder / "contacts").iterdir())) == 2
    assert len(list(folder.iterdir())) == 5
    assert [contact_cost(curve) == 0 for curve in serial] == [False, True] * 2


def contact_cost(curve: Curve) -> int:
    """Factorisations until contact: none where another curve of the sweep left it."""
    stages = json.loads((curve.folder / "run.json").read_text())["stages"]
    return sum(stage["factorisations"] or 0 for stage in stages if stage["stroke"] == "both")


@pytest.mark.slow
def test_a_sweep_on_dask(serial: list[Curve], tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        cluster.get_client() as client,
    ):
        executor = client.get_executor()
        curves = solve_cases(SWEEP, tmp_path / "sweep", executor)
        again = solve_cases(SWEEP, tmp_path / "sweep", executor, resume=True)
        (tmp_path / "file").write_text("")
        with pytest.raises(BadInput, match="is not a folder"):
            solve_cases(SWEEP[:1], tmp_path / "file", executor)
    for curve, resumed, expected in zip(curves, again, serial, strict=True):
        assert curve.converged
        assert curve.parameters == expected.parameters
        assert rows(curve) == rows(resumed) == pytest.approx(rows(expected), rel=1e-10)
        assert {p.name for p in curve.folder.iterdir()} == {
            p.name for p in expected.folder.iterdir()
        }
    shared = [curve for curve in curves if contact_cost(curve) == 0]
    assert shared  # a worker that is free early does not wait for the contact of another


def test_one_curve_of_each_section_comes_first() -> None:
    cases = [*SWEEP, case(density=2, stroke="in"), case(density=2, mu_1=3.0)]
    tasks = [SweepTask(Run(CASE, c), Path(str(n)), "refuse") for n, c in enumerate(cases)]
    assert [task.folder.name for task in in_order(tasks)] == ["4", "5", "0", "2", "1", "3"]
