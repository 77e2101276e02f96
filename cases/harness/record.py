"""The folder of a run: what is in it, in which order it is written, and what a resumed run keeps.

For each state its profile and its section are written first, then `curve.csv`, then `run.json`: a
row of the curve is the promise that the files of its state are complete.  States on the collapsed
branch are never results: they go to the folder `rejected`, in files of the same form.
"""

import importlib.metadata
import os
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path
from typing import Any

from softehl.cases.harness.case_file import BadInput, Case
from softehl.cases.harness.curve import CurveFolder, CurveRow, write_section
from softehl.cases.harness.observer import COLLAPSED, ContactState, FilmState, Outcome, StageRecord
from softehl.cases.seal.leakage import LEAKAGE_COLUMNS, net_leakage
from softehl.cases.seal.parameters import ORing
from softehl.runtime.io import number_text, read_json, write_columns, write_csv, write_json

SELECTION = ("speeds", "stroke", "solver", "linear", "tolerance")
"""Parameters that do not change a row of a curve: a resumed run may change them."""
SIGNS = {"out": 1.0, "in": -1.0}
"""Stroke -> sign of its rod speed U."""
KINDS = ("csv", "png", "svg")
_OURS = (
    *("run.json", "leakage.csv"),
    *(f"{name}.{kind}" for name in ("curve", "profiles", "section") for kind in KINDS),
    *("profile_*.csv", "section_*.vtu", "contact_*.csv", "contact_*.vtu"),
)
_PACKAGES = (
    *("softehl", "numpy", "scipy", "cffi", "pypardiso"),
    *("pydantic", "click", "rich", "meshio", "matplotlib"),
)


@dataclass
class StageLog:
    """What is known of a stage while it runs, for the record of a run that is cut short."""

    name: str
    sealed_pressure: float
    stroke: str
    iterations: int = 0
    histories: list[tuple[float, ...]] = field(default_factory=list)
    parameters: list[float] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)
    seconds: float = 0.0

    def step(self, parameter: float, iterations: int, residuals: Sequence[float]) -> None:
        """Add a converged step."""
        self.iterations += iterations
        self.histories.append(tuple(residuals))
        self.parameters.append(parameter)
        self.seconds = time.perf_counter() - self.began

    def record(self) -> StageRecord:
        """The stage so far; its factorisations are not known."""
        return StageRecord(
            name=self.name,
            seconds=self.seconds,
            factorisations=None,
            iterations=self.iterations,
            residual_histories=tuple(self.histories),
            parameters=tuple(self.parameters),
            sealed_pressure=self.sealed_pressure,
            stroke=self.stroke,
        )


class RunRecord:
    """Everything a run writes, kept up to date while it runs.

    Nothing is created before the first call of :meth:`begin`; bad input leaves no trace.
    """

    def __init__(self, folder: Path, case: Case, *, resume: bool) -> None:
        """Look at what is in `folder`.  Raises BadInput if it cannot hold or resume this run."""
        self.folder = folder
        self.case = case
        self.curve = CurveFolder(folder)
        self.rejected = CurveFolder(folder / "rejected")
        self._began: float | None = None
        self._earlier: dict[str, Any] = {}
        self._size: dict[str, Any] = {"kernels": None, "unknowns": None, "solvers": None}
        self._logs: list[StageLog] = []
        self._stages: list[StageRecord] | None = None
        self.advice: set[str] = set()
        _require_folder(folder)
        if resume:
            self._take_over()

    @property
    def began(self) -> bool:
        """Whether anything was written."""
        return self._began is not None

    def requested(self) -> list[float]:
        """The signed rod speeds U that the parameters ask for."""
        parameters = self.case.parameters
        signs = [SIGNS[stroke] for stroke in strokes_of(parameters)]
        return [sign * speed for sign in signs for speed in parameters.speeds]

    def missing(self, stroke: str, density: int) -> tuple[float, ...]:
        """The requested speeds |U| of a stroke to be solved at a density.

        Those that the curve does not have, or has from a coarser mesh outside the tolerance.
        """
        rows = {row.rod_speed_mm_s: row for row in self.curve.rows}
        sign = SIGNS[stroke]
        return tuple(
            u
            for u in self.case.parameters.speeds
            if sign * u not in rows or self._is_too_coarse(rows[sign * u], density)
        )

    def outside(self) -> list[CurveRow]:
        """The rows that do not meet the tolerance, if there is one."""
        return [row for row in self.curve.rows if self._is_outside(row)]

    def _is_outside(self, row: CurveRow) -> bool:
        tolerance = self.case.parameters.tolerance
        return tolerance is not None and not row.within(tolerance)

    def _is_too_coarse(self, row: CurveRow, density: int) -> bool:
        return row.density < density and self._is_outside(row)

    def begin(self) -> None:
        """Create the folder, or empty it of an earlier run that is not resumed; once."""
        if self.began:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        self._began = time.perf_counter()
        if not self._earlier:
            _remove_earlier(self.folder)
        # what is rejected is tried again, also by a resumed run
        _remove_earlier(self.rejected.path)
        self.curve.save()
        self.save("running", "")

    def stage(self, name: str, sealed_pressure: float, stroke: str) -> "StageLog":
        """Open the log of a new stage."""
        self.begin()
        self._logs.append(StageLog(name, sealed_pressure, stroke))
        return self._logs[-1]

    def contact(self, state: ContactState) -> None:
        """Write the frictionless contact solution."""
        self.begin()
        name = number_text(state.sealed_pressure)
        columns = {"x_mm": state.x_mm, "p_MPa": state.p_MPa}
        write_columns(self.folder / f"contact_{name}.csv", columns)
        write_section(self.folder / f"contact_{name}.vtu", state.section)

    def film(self, state: FilmState) -> CurveRow:
        """Write a film state where it belongs and the run record after it."""
        self.begin()
        folder = self.rejected if state.verdict == COLLAPSED else self.curve
        row = folder.add(state)
        if row.usable:
            self.rejected.drop(row.rod_speed_mm_s)
        else:
            self.advice.add(state.advice)
        self.save("running", "")
        return row

    def set_outcomes(self, outcomes: Sequence[Outcome]) -> None:
        """What is known only at the end: the size, the kernels and the cost of each stage."""
        for outcome in outcomes:
            unknowns = {"total": outcome.unknowns_total, "pressure": outcome.unknowns_pressure}
            kernels, solvers = dict(outcome.kernel_signatures), dict(outcome.solvers)
            self._size = {"kernels": kernels, "unknowns": unknowns, "solvers": solvers}
        self._stages = [stage for outcome in outcomes for stage in outcome.stages]

    def save(self, status: str, message: str) -> None:
        """Write leakage.csv if a speed has both strokes, then run.json."""
        leakage = net_leakage(self.curve.rows)
        if leakage:
            write_csv(self.folder / "leakage.csv", LEAKAGE_COLUMNS, map(astuple, leakage))
        seconds = 0.0 if self._began is None else time.perf_counter() - self._began
        stages = self._stages if self._stages is not None else [log.record() for log in self._logs]
        content = {
            "case": self.case.name,
            "status": status,
            "message": message,
            "parameters": self.case.parameters.model_dump(),
            "versions": _versions(),
            **self._size,
            "seconds": seconds + self._earlier.get("seconds", 0.0),
            "stages": [*self._earlier.get("stages", ()), *map(_stage_json, stages)],
            "leakage": [asdict(row) for row in leakage],
            "states": [_state_json(row, ".") for row in self.curve.rows],
            "rejected": [_state_json(row, "rejected") for row in self.rejected.rows],
        }
        write_json(self.folder / "run.json", content)

    def _take_over(self) -> None:
        """Read an earlier run of the same parameters."""
        path = self.folder / "run.json"
        try:
            if not path.exists():
                return
            self._earlier = read_json(path)
            self._size = {key: self._earlier.get(key) for key in self._size}
            self.curve.load()
        except (OSError, ValueError, TypeError) as error:
            raise BadInput(f"--resume: cannot read the earlier run: {error}") from None
        difference = _difference(self._earlier, self.case)
        if difference:
            raise BadInput(
                f"--resume: {self.folder} holds a run with other parameters: {difference}; "
                f"allowed to differ: {', '.join(SELECTION)}"
            )


def strokes_of(parameters: ORing) -> tuple[str, ...]:
    """The strokes that are asked for, one by one."""
    return tuple(SIGNS) if parameters.stroke == "both" else (parameters.stroke,)


def _difference(earlier: Mapping[str, Any], case: Case) -> str:
    """What an earlier run has otherwise than this case, in words; empty if nothing."""
    if earlier.get("case") != case.name:
        return f"case = {earlier.get('case')!r}, now {case.name!r}"
    before = earlier.get("parameters")
    if not isinstance(before, dict):
        return "it names none"
    now = case.parameters.model_dump()
    for key in [*now, *before]:
        if key not in SELECTION and before.get(key) != now.get(key):
            return f"{key} = {before.get(key)!r}, now {now.get(key)!r}"
    return ""


def _require_folder(folder: Path) -> None:
    """Raise BadInput if a part of the path is there and is no folder that can be written to."""
    try:
        nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    except (OSError, StopIteration) as error:
        raise BadInput(f"--out {str(folder)!r}: {error}; allowed: a folder") from None
    if not nearest.is_dir():
        raise BadInput(f"--out {str(folder)!r}: {nearest} is not a folder; allowed: a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise BadInput(f"--out {str(folder)!r}: no permission to write to {nearest}")


def _remove_earlier(folder: Path) -> None:
    """Remove the files of an earlier run by their names, and nothing else."""
    if not (folder / "curve.csv").exists() and not (folder / "run.json").exists():
        return  # not a folder of ours: a name in it that looks like ours is somebody else's
    for pattern in _OURS:
        for path in folder.glob(pattern):
            path.unlink()


def _state_json(row: CurveRow, folder: str) -> dict[str, Any]:
    files = [f"profile_{row.name}.csv", f"section_{row.name}.vtu"]
    return asdict(row) | {"files": [str(Path(folder, file)) for file in files]}


def _stage_json(stage: StageRecord) -> dict[str, Any]:
    parameters = stage.parameters or (None,) * len(stage.residual_histories)
    steps = zip(parameters, stage.residual_histories, strict=False)
    return {
        "name": stage.name,
        "sealed_pressure_MPa": stage.sealed_pressure,
        "stroke": stage.stroke,
        "method": stage.method,
        "seconds": stage.seconds,
        "factorisations": stage.factorisations,
        "iterations": stage.iterations,
        "steps": [{"parameter": p, "residuals": history} for p, history in steps],
    }


def _versions() -> dict[str, str | None]:
    """Of Python, the platform and every package that takes part in a run."""
    versions: dict[str, str | None] = {
        "python": platform.python_version(),
        "platform": platform.platform(),
    }
    for package in _PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = None
    return versions
