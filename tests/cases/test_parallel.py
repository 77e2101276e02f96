"""Work in other processes: results, errors, the end of either side; curves through any executor."""

import json
import multiprocessing
import os
import pickle
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import pytest

from softehl.cases.harness.case import Run
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.harness.process_pool import completed, processes, solve_side_by_side
from softehl.cases.harness.sweep import Curve, Task, in_order
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmState
from softehl.cases.shipped import solve_cases
from softehl.runtime.kernels.kernel import ArgumentError, MissingKernelsError, StaleKernelsError
from softehl.runtime.solve.linear.direct import MissingBackend
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from tests.cases.elsewhere import double, fail, wait_in_a_worker
from tests.cases.test_cli import outcome

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


def tell_and_end(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    for number in range(500):
        observer.stage(str(number), title="", where={})
    return outcome()


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
    outcomes = solve_side_by_side(tell_and_end, [case(), case()], counters)
    assert [o.unknowns["total"] for o in outcomes] == [1234, 1234]
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
    tasks = [Task(Run(CASE, c), Path(str(n)), "refuse") for n, c in enumerate(cases)]
    assert [task.folder.name for task in in_order(tasks)] == ["4", "5", "0", "2", "1", "3"]
