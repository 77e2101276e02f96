"""The command line: what it refuses, what it writes, what survives, what is resumed.

The solver is replaced by one that answers h* = sqrt(U)/10 at once; see `solve`.
"""

import json
import multiprocessing
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softehl
from softehl.cases import oring
from softehl.cases.harness.observer import Observer, Outcome, StageRecord
from softehl.cases.harness.resume import kernel_signatures
from softehl.cases.harness.row import OK
from softehl.cases.harness.run_record import RunRecord
from softehl.cases.harness.runner import NOT_CONVERGED
from softehl.cases.oring import PICTURES, ORingCase
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report import pictures
from softehl.cases.seal.states.state import (
    COLLAPSED,
    ContactState,
    FilmState,
    Profile,
    Section,
    operating_point,
)
from softehl.cases.seal.states.state_files import report_contact, report_film
from softehl.runtime.kernels.kernel import MissingKernelsError
from softehl.runtime.kernels.shared_library import library_of
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.solution import Status
from tests.cases.oring_cases import film_values
from tests.cases.test_parameters import REFUSED

HEADER = (
    "sealed_pressure_MPa,rod_speed_mm_s,h_star_um,h_star_error_percent,h_min_um,p_max_MPa,"
    "pressure_jump_max_MPa,rod_friction_N,rod_friction_error_percent,leak_rate_mm3_s,"
    "contact_start_mm,contact_end_mm,newton_iterations,flux_variation,moment_N_mm,contact_p_max_MPa,oscillation_index,"
    "inlet_segments,inlet_ratio,mean_gap_um,lambda_ratio,regime,"
    "asperity_load_percent,boundary_friction_percent,groove_start_mm,groove_end_mm,"
    "groove_pressure_MPa,h_min_sealed_um,h_min_air_um,flux_mismatch_percent,"
    "entrance_pressure_MPa,h_star_theory_um,inlet_over_pocket,inlet_heating_K,film_heating_K,"
    "heat_to_rod_W,heat_to_seal_W,heat_in_oil_W,"
    "h_star_theory_sealed_um,h_star_theory_air_um,density,verdict"
)
FAST = ("--set", "speeds=[400, 100]")
PLOTS = {f"{name}.png" for name in PICTURES}
FILES = {
    *("run.json", "curve.csv", "leakage.csv"),
    *("contact_1MPa.csv", "contact_1MPa.vtu"),
    *(f"profile_1MPa_{u}mm_s.csv" for u in ("out_400", "out_100", "in_400", "in_100")),
    *(f"section_1MPa_{u}mm_s.vtu" for u in ("out_400", "out_100", "in_400", "in_100")),
    *("gland.vtu", "section_out.pvd", "section_in.pvd"),
}
USED = {"film": kernel_signatures()["film"]}


Solve = Callable[[Seal, Observer], Outcome[FilmState]]


class Fake(ORingCase):
    """The O-ring with another way to solve it."""

    def __init__(self, solver: Solve) -> None:
        self.solver = solver

    def solve(
        self, parameters: Seal, observer: Observer, shared: Path | None
    ) -> Outcome[FilmState]:
        return self.solver(parameters, observer)


# --- a case that answers at once ---------------------------------------------------------------


def section() -> Section:
    points = np.array([[0.0, 25.0], [1.0, 25.0], [1.0, 26.0], [0.0, 26.0]])
    stresses = {f"sigma_{at}": np.array([-1.0, -1.0, -2.0, -2.0]) for at in ("zz", "rr", "tt")}
    shear, contact = np.zeros(4), np.array([0.0, 0.0, 3.0, 3.0])
    data = {**stresses, "sigma_zr": shear, "contact_pressure": contact}
    return Section(points, np.array([[0, 1, 2, 3]]), data)


def film_state(parameters: Seal, speed: float, verdict: str = OK) -> FilmState:
    x = np.linspace(-1.0, 1.0, 5)
    h_star = abs(speed) ** 0.5 / 10
    values = film_values(
        sealed_pressure_MPa=parameters.sealed_pressure,
        rod_speed_mm_s=speed,
        h_star_um=h_star,
        h_star_error_percent=nan,
        h_min_um=0.8 * h_star,
        p_max_MPa=4.0,
        rod_friction_N=3.0,
        leak_rate_mm3_s=speed * h_star,
        contact_start_mm=-0.9,
        contact_end_mm=0.8,
        newton_iterations=5,
        contact_p_max_MPa=4.1,
        density=parameters.density,
        verdict=verdict,
    )
    return FilmState(
        **values,
        advice="" if verdict == OK else "Use a finer mesh.",
        profile=Profile(x, h_star + 50 * x**2, 4 - 4 * x**2, 0.01 * x, h_star * speed + 0 * x, x),
        section=section(),
    )


def solve(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """Every requested state, fast ones first."""
    p = parameters.sealed_pressure
    x = np.array([-1.0, 0.0, 1.0])
    observer.stage("contact", sealed_pressure=p, stroke=parameters.stroke, steps=1)
    observer.step(label="load", parameter=1.0, iterations=3, residuals=(1.0, 1e-12), fraction=1.0)
    report_contact(observer, ContactState(p, x, 4.1 - x**2, section()))
    strokes = {"out": [1.0], "in": [-1.0], "both": [1.0, -1.0]}[parameters.stroke]
    states = []
    for sign in strokes:
        observer.stage("speed", sealed_pressure=p, stroke="out" if sign > 0 else "in", steps=None)
        for speed in sorted(parameters.speeds, reverse=True):
            state = film_state(parameters, sign * speed)
            observer.step(label="U", parameter=speed, iterations=4, residuals=(), fraction=None)
            report_film(observer, state)
            states.append(state)
    return outcome(*states)


def outcome(
    *states: FilmState, status: Status = Status.CONVERGED, message: str = ""
) -> Outcome[FilmState]:
    stage = StageRecord(
        "contact", 0.5, 4, 3, ((1.0, 1e-2, 1e-5),), (1.0,), operating_point(1.0, "out")
    )
    unknowns = {"total": 1234, "pressure": 109}
    return Outcome(states, status, message, unknowns, USED, (stage,))


def solve_roughly(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """Every requested state, with an error that falls with the density and rises with 1 / U."""
    states = []
    for sign in {"out": [1.0], "in": [-1.0], "both": [1.0, -1.0]}[parameters.stroke]:
        for speed in parameters.speeds:
            error = -400.0 / speed / parameters.density**2
            state = replace(film_state(parameters, sign * speed), h_star_error_percent=error)
            report_film(observer, state)
            states.append(state)
    return outcome(*states)


def solve_and_stop(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """One state, then no convergence."""
    state = film_state(parameters, max(parameters.speeds))
    report_film(observer, state)
    return outcome(state, status=Status.STEP_TOO_SMALL, message="stopped at\nU = 250 mm/s")


def solve_and_collapse(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """A good state and a collapsed one."""
    fast, slow = max(parameters.speeds), min(parameters.speeds)
    states = [film_state(parameters, fast), film_state(parameters, slow, COLLAPSED)]
    for state in states:
        report_film(observer, state)
    return outcome(*states)


def solve_and_break(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """One state, then an error in the program."""
    observer.stage("speed", sealed_pressure=1.0, stroke="out", steps=None)
    observer.step(label="U", parameter=400.0, iterations=4, residuals=(1.0,), fraction=None)
    report_film(observer, film_state(parameters, max(parameters.speeds)))
    raise ArithmeticError("broken")


def solve_and_die(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    """One state, then the end of the process without any clean-up."""
    report_film(observer, film_state(parameters, max(parameters.speeds)))
    os._exit(9)


def solve_without_kernels(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
    raise MissingKernelsError("no compiled kernels;\nrun `python -m softehl.codegen.tools.build`")


# --- helpers -----------------------------------------------------------------------------------

Result = tuple[int, list[str], list[str]]
Invoke = Callable[..., Result]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def invoke(
    here: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Invoke:
    """Run the command line with a fake case; exit code, lines of stdout, lines of stderr.

    Plots are only drawn where they are asked for: they take longer than the rest together.
    """

    def run(*arguments: str, solver: Solve = solve, plots: bool = False) -> Result:
        monkeypatch.setattr(oring, "CASE", Fake(solver))
        if not plots:
            monkeypatch.setattr(pictures, "write_plots", lambda *_: None)
        code = softehl.main(arguments)
        captured = capfd.readouterr()
        return code, captured.out.splitlines(), captured.err.splitlines()

    return run


def rows(folder: Path) -> list[list[str]]:
    header, *lines = (folder / "curve.csv").read_text().splitlines()
    assert header == HEADER
    return [line.split(",") for line in lines]


def speeds(folder: Path) -> list[float]:
    return [float(row[1]) for row in rows(folder)]


def run_json(folder: Path) -> dict[str, Any]:
    content = json.loads((folder / "run.json").read_text())
    assert isinstance(content, dict)
    return content


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


# --- bad input ---------------------------------------------------------------------------------


CASE_FILES: Mapping[str, bytes] = {
    "broken.toml": b'case = "oring\ndensity = 4',
    "binary.toml": b"\xff\xfe\x00",
    "nameless.toml": b"density = 4",
    "other.toml": b'case = "piston"',
    "typo.toml": b'case = "oring"\nspeed = 3',
    "many.toml": b'case = "oring"\n[random]\nruns = 3',
    "code.toml": b'case = "oring"\n'
    b"sealed_pressure = \"__import__('os').system('touch ran') or 1.0\"",
    "nested.toml": b'case = "oring"\n[density]\nvalue = 4',
}


@pytest.mark.parametrize(("arguments", "words"), REFUSED["run"])
def test_bad_input(arguments: list[str], words: str, here: Path, invoke: Invoke) -> None:
    for name, content in CASE_FILES.items():
        (here / name).write_bytes(content)
    code, out, err = invoke("run", *arguments)
    assert (code, out, len(err)) == (2, [], 1)
    assert err[0].startswith("softehl: ")
    assert words in err[0].replace("\\", "")
    assert names(here) == set(CASE_FILES)
    assert [path for path in here.iterdir() if path.is_dir()] == []


COMMANDS = "app, design, elements, generate, kernels, keys, report, reproduce, run, sweep"


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((), f"Missing command; allowed: {COMMANDS}"),
        (("frobnicate",), f"No such command 'frobnicate'; allowed: {COMMANDS}"),
        (("keys",), "Missing argument 'CASE'; allowed: oring, slider, cycle or a TOML file"),
        (("keys", "oring", "pressure"), "argument (pressure); allowed: softehl keys CASE"),
    ],
)
def test_a_wrong_command_says_what_is_allowed(
    given: tuple[str, ...], says: str, invoke: Invoke
) -> None:
    code, _, err = invoke(*given)
    assert (code, len(err)) == (2, 1)
    assert err[0].endswith(says)


def test_no_kernels(here: Path, invoke: Invoke) -> None:
    code, out, err = invoke("run", "oring", solver=solve_without_kernels)
    assert (code, out) == (2, [])
    assert err == ["softehl: no compiled kernels; run `python -m softehl.codegen.tools.build`"]
    assert list(here.iterdir()) == []


# --- a run -------------------------------------------------------------------------------------


def test_a_run_writes_its_files(here: Path, invoke: Invoke) -> None:
    code, out, err = invoke("run", "oring", *FAST, plots=True)
    folder = here / "results" / "oring"
    assert code == 0
    assert names(folder) == FILES | PLOTS
    assert speeds(folder) == [400.0, 100.0, -400.0, -100.0]
    assert rows(folder)[0][2:5] == ["2", "nan", "1.6"]
    assert {row[-1] for row in rows(folder)} == {OK}
    profile = (folder / "profile_1MPa_in_100mm_s.csv").read_text().splitlines()
    assert profile[0] == "x_mm,h_um,p_MPa,tau_MPa,flux_mm2_s,tau_rod_MPa"
    assert len(profile) == 6
    assert any("h*" in line and "friction" in line for line in out)
    assert sum("ok" in line for line in out) == 4
    assert out[-1] == "written to results/oring"
    assert err[0].startswith("sealed pressure / shear modulus = 0.27: all films of a sample")
    assert err[1] == "contact, p_s = 1 MPa, stroke both"


def test_a_pressure_that_is_not_known_to_run_is_warned_of_first(here: Path, invoke: Invoke) -> None:
    keys = ("--set", "sealed_pressure=105 bar", "--set", "shore_A=70")
    _, _, err = invoke("run", "oring", *FAST, *keys)
    assert err[0].startswith("softehl: sealed pressure / shear modulus = 5.7: ")
    assert "above 5 h* of instrokes is estimated by theory" in err[0]
    assert "a harder rubber or a lower pressure helps" in err[0]
    assert run_json(here / "results" / "oring")["warnings"] == [err[0].removeprefix("softehl: ")]
    ring = ("--set", "section=x_ring", "--set", "groove_width=4.3")
    _, _, err = invoke("run", "oring", *FAST, *ring, "--set", "sealed_pressure=4")
    assert (
        "modulus = 1.1: all films of a sample were found at ratios to 2 (docs/limits.md)"
        in " ".join(err)
    )


def test_run_json(here: Path, invoke: Invoke) -> None:
    assert invoke("run", "oring", *FAST, "--set", "density=4", "--out", "a")[0] == 0
    content = run_json(here / "a")
    parameters = Seal(density=4, speeds=(400.0, 100.0)).model_dump(mode="json")
    assert parameters["speeds"] == [400.0, 100.0]
    assert content["parameters"] == parameters
    assert (content["case"], content["status"]) == ("oring", "converged")
    assert content["kernels"] == USED
    assert content["kernel_library"] == library_of().kind
    assert content["unknowns"] == {"total": 1234, "pressure": 109}
    assert {"python", "numpy", "scipy", "softehl"} <= set(content["versions"])
    assert content["stages"] == [
        {
            "name": "contact",
            "sealed_pressure_MPa": 1.0,
            "stroke": "out",
            "method": "newton",
            "seconds": 0.5,
            "factorisations": 4,
            "iterations": 3,
            "steps": [{"parameter": 1.0, "residuals": [1.0, 1e-2, 1e-5]}],
        }
    ]
    assert len(content["states"]) == 4
    listed = {file for state in content["states"] for file in state["files"]}
    assert listed <= names(here / "a")


def test_a_tolerance_refines_where_it_is_missed(here: Path, invoke: Invoke) -> None:
    code, out, err = invoke("run", "oring", *FAST, "--tolerance", "0.3%", solver=solve_roughly)
    folder = here / "results" / "oring"
    assert code == 0, err
    found = [(row[1], float(row[3]), row[-2]) for row in rows(folder)]
    assert found == [
        ("400", -0.25, "2"),
        ("100", -0.25, "4"),
        ("-400", -0.25, "2"),
        ("-100", -0.25, "4"),
    ]
    assert any("error" in line for line in out)
    assert run_json(folder)["parameters"]["tolerance"] == 0.3
    # what meets a sharper tolerance already is kept
    again = ("--set", "density=2", "--tolerance", "0.26", "--resume")
    assert invoke("run", "oring", *FAST, *again, solver=solve_and_die)[0] == 0


def test_a_tolerance_that_no_mesh_meets_is_named(here: Path, invoke: Invoke) -> None:
    tolerance = ("--tolerance", "0.01")
    code, _, err = invoke("run", "oring", *FAST, *tolerance, solver=solve_roughly)
    assert code == NOT_CONVERGED
    assert "h* not known to 0.01 %: U = +100, -100 mm/s" in err[-1]
    assert {row[-2] for row in rows(here / "results" / "oring")} == {"16"}


def test_not_converged(here: Path, invoke: Invoke) -> None:
    code, out, err = invoke("run", "oring", *FAST, solver=solve_and_stop)
    folder = here / "results" / "oring"
    assert code == 3
    assert speeds(folder) == [400.0]
    assert run_json(folder)["status"] == "not converged"
    assert err[-1].startswith("softehl: not converged: continuation step too small: stopped at U =")
    assert "not reached: U = +100, -400, -100 mm/s" in err[-1]
    assert "reached and saved in results/oring: U = +400 mm/s" in err[-1]
    assert any("+400" in line for line in out)


def test_a_shape_that_cannot_be_meshed_is_one_line(here: Path, invoke: Invoke) -> None:
    def solve_without_mesh(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
        report_film(observer, film_state(parameters, max(parameters.speeds)))
        raise MeshError("no sound mesh of sq at density 1; use rounder corners")

    code, _, err = invoke("run", "oring", *FAST, solver=solve_without_mesh)
    assert (code, err[-1:]) == (
        2,
        ["softehl: no sound mesh of sq at density 1; use rounder corners"],
    )
    folder = here / "results" / "oring"
    assert run_json(folder)["status"] == "interrupted"
    assert speeds(folder) == [400.0]


def test_a_collapsed_film_is_no_result(here: Path, invoke: Invoke) -> None:
    arguments = ("run", "oring", *FAST, "--set", "stroke=out")
    code, out, err = invoke(*arguments, solver=solve_and_collapse)
    folder = here / "results" / "oring"
    assert code == 3
    assert speeds(folder) == [400.0]
    assert speeds(folder / "rejected") == [100.0]
    assert not (folder / "profile_1MPa_out_100mm_s.csv").exists()
    flagged = [line for line in out if "COLLAPSED" in line]
    assert len(flagged) == 1
    assert flagged[0].split() == ["+100", *"--------", "COLLAPSED"]
    assert "collapsed film, not a result: U = +100 mm/s. Use a finer mesh." in err[-1]
    assert [state["verdict"] for state in run_json(folder)["rejected"]] == [COLLAPSED]
    assert invoke(*arguments, "--resume")[0] == 0
    assert names(folder / "rejected") == set()


# --- killed and resumed ------------------------------------------------------------------------


def test_an_error_leaves_what_was_reached(here: Path, invoke: Invoke) -> None:
    with pytest.raises(ArithmeticError, match="broken"):
        invoke("run", "oring", *FAST, solver=solve_and_break)
    folder = here / "results" / "oring"
    assert speeds(folder) == [400.0]
    content = run_json(folder)
    assert content["status"] == "interrupted"
    assert content["message"] == "ArithmeticError: broken"
    assert content["stages"][0]["steps"] == [{"parameter": 400.0, "residuals": [1.0]}]
    assert names(folder) == {
        "run.json",
        "curve.csv",
        "profile_1MPa_out_400mm_s.csv",
        "section_1MPa_out_400mm_s.vtu",
    }


def run_and_die(folder: str) -> None:
    """Body of a process that is ended in the middle of a run."""
    oring.CASE = Fake(solve_and_die)
    softehl.main(["run", "oring", *FAST, "--out", folder])


def test_a_killed_run_is_resumed(here: Path, invoke: Invoke) -> None:
    folder = here / "killed"
    process = multiprocessing.get_context("spawn").Process(target=run_and_die, args=(str(folder),))
    process.start()
    process.join()
    assert process.exitcode == 9
    assert speeds(folder) == [400.0]
    assert run_json(folder)["status"] == "running"
    asked: list[tuple[str, tuple[float, ...]]] = []

    def counting(parameters: Seal, observer: Observer) -> Outcome[FilmState]:
        asked.append((parameters.stroke, parameters.speeds))
        return solve(parameters, observer)

    arguments = ("run", "oring", *FAST, "--out", "killed", "--resume")
    assert invoke(*arguments, solver=counting)[0] == 0
    assert asked == [("out", (100.0,)), ("in", (400.0, 100.0))]
    assert speeds(folder) == [400.0, 100.0, -400.0, -100.0]
    assert run_json(folder)["status"] == "converged"
    assert names(folder) == FILES
    stages = run_json(folder)["stages"]

    code, out, _ = invoke(*arguments, solver=counting)
    assert code == 0
    assert len(asked) == 2
    assert sum("ok" in line for line in out) == 4
    assert run_json(folder)["stages"] == stages


def test_resume_takes_more_speeds(here: Path, invoke: Invoke) -> None:
    invoke("run", "oring", *FAST, "--set", "stroke=out", "--out", "a")
    code, _, _ = invoke("run", "oring", "--set", "speeds=[25]", "--out", "a", "--resume")
    assert code == 0
    assert speeds(here / "a") == [400.0, 100.0, 25.0, -25.0]


def test_resume_refuses_other_parameters(here: Path, invoke: Invoke) -> None:
    invoke("run", "oring", *FAST, "--out", "a")
    before = {name: (here / "a" / name).read_bytes() for name in names(here / "a")}
    code, _, err = invoke("run", "oring", *FAST, "--set", "density=4", "--out", "a", "--resume")
    assert (code, len(err)) == (2, 1)
    assert "density = 2, now 4" in err[0]
    assert before == {name: (here / "a" / name).read_bytes() for name in names(here / "a")}


@pytest.mark.parametrize("content", ["{", "[]", "{}", '{"states": 3}', '{"states": [1]}', "\udcff"])
def test_resume_refuses_a_record_it_cannot_read(content: str, here: Path, invoke: Invoke) -> None:
    invoke("run", "oring", *FAST, "--out", "a")
    (here / "a" / "run.json").write_bytes(content.encode(errors="surrogateescape"))
    code, _, err = invoke("run", "oring", *FAST, "--out", "a", "--resume")
    assert (code, len(err)) == (2, 1)
    assert "run.json is damaged" in err[0]
    assert "--overwrite begins anew" in err[0]


def test_a_new_run_replaces_the_earlier_one_only_where_it_may(here: Path, invoke: Invoke) -> None:
    invoke("run", "oring", "--set", "speeds=[25]", "--out", "a")
    (here / "a" / "notes.txt").write_text("mine")
    before = {name: (here / "a" / name).read_bytes() for name in names(here / "a")}
    code, _, err = invoke("run", "oring", *FAST, "--out", "a")
    assert (code, len(err)) == (2, 1)
    assert "a holds an earlier run; --resume keeps its rows, --overwrite begins anew" in err[0]
    assert before == {name: (here / "a" / name).read_bytes() for name in names(here / "a")}
    code, _, err = invoke("run", "oring", *FAST, "--out", "a", "--overwrite", "--resume")
    assert (code, len(err)) == (2, 1)
    assert invoke("run", "oring", *FAST, "--out", "a", "--overwrite")[0] == 0
    assert names(here / "a") == {*FILES, "notes.txt"}


@pytest.mark.parametrize("options", [(), ("--resume",)])
def test_a_foreign_folder_is_refused(options: tuple[str, ...], here: Path, invoke: Invoke) -> None:
    (here / "a").mkdir()
    (here / "a" / "curve.png").write_text("mine")
    for command in (("run", "oring", *FAST), ("sweep", _study(here))):
        code, _, err = invoke(*command, "--out", "a", *options)
        assert (code, len(err)) == (2, 1)
        assert "'a' holds 'curve.png' and no run; allowed: a new or empty folder" in err[0]
        assert names(here / "a") == {"curve.png"}


def _study(here: Path) -> str:
    """A sweep of two runs."""
    (here / "two.toml").write_text('case = "oring"\n[grid]\nsealed_pressure = [1, 2]\n')
    return "two.toml"


def test_a_full_disk_is_one_line(
    here: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(RunRecord, "state", full)
    code, _, err = invoke("run", "oring", *FAST, "--quiet")
    assert (code, len(err)) == (2, 1)
    assert "cannot write 'results/oring': No space left on device" in err[0]
    assert run_json(here / "results" / "oring")["status"] == "interrupted"
