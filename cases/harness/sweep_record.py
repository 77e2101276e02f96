"""The folder of a sweep: a run in a folder each, one table of all, and what a resumed sweep keeps.

`sweep.csv` follows from the folders of the runs; `run.json` says what the study is and how far it
came.  A sweep that was killed is resumed from the runs themselves.
"""

import json
import shutil
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from softehl.cases.harness.case import Run
from softehl.cases.harness.earlier import Existing, holds_a_run, read_earlier
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.lock import FolderLock
from softehl.cases.harness.record import (
    package_versions,
    refusal,
    require_empty,
    require_folder,
)
from softehl.cases.harness.study_file import Study
from softehl.cases.harness.sweep import Curve, Task, shared_folder
from softehl.runtime.io import Cell, read_json, write_csv, write_json

TABLE, RUNS = "sweep.csv", "runs"
_INTERVAL = 2.0  # seconds between versions of the table while runs come in
_ENDED = {"converged": True, "not converged": False}


class SweepRecord:
    """Everything of a sweep but its runs, kept up to date; a context that locks the folder."""

    def __init__(self, folder: Path, study: Study, existing: Existing) -> None:
        """Look at what is in `folder`.  Raises BadInput if it cannot hold or resume this study."""
        self.folder, self.study, self._existing = folder, study, existing
        self.curves: dict[int, Curve] = {}
        self.missing: list[Task] = []
        self._lock = FolderLock(folder)
        self._before, self._began, self._saved = 0.0, time.monotonic(), 0.0
        require_folder(folder)
        self._earlier: Mapping[str, Any] = {}
        if self._holds():
            self._earlier = self._read()
        elif existing != "overwrite":
            require_empty(folder)

    def __enter__(self) -> Self:
        """Take the folder, and look what is there; a sweep that is not resumed is removed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock.take()
        if not self._earlier:
            self._remove_earlier()
        self._look()
        return self

    def __exit__(self, *_: object) -> None:
        """Release the folder."""
        self._lock.release()

    def _look(self) -> None:
        """Runs that are there become curves, the others are missing."""
        base, case = self.folder.absolute(), self.study.case
        shared = shared_folder(case, base)
        for number, parameters in enumerate(self.study.runs):
            if isinstance(parameters, str):
                continue
            folder = base / RUNS / f"{number + 1:05d}"
            found = self._kept(Task(Run(case, parameters, shared), folder, "resume"))
            if isinstance(found, Curve):
                self.curves[number] = found
            else:
                self.missing.append(found)

    def add(self, curve: Curve) -> None:
        """Keep a curve that has come in."""
        self.curves[int(curve.folder.name) - 1] = curve
        if time.monotonic() - self._saved > _INTERVAL:
            self.save("running")

    def save(self, status: str, message: str = "") -> None:
        """Write the table, then run.json."""
        rows = self.rows()
        write_csv(self.folder / TABLE, self.header, [[row[n] for n in self.header] for row in rows])
        content = {
            **self._described(),
            "status": status,
            "message": message,
            "counts": self.counts(),
            "versions": package_versions(),
            "seconds": self._before + time.monotonic() - self._began,
        }
        write_json(self.folder / "run.json", content)
        self._saved = time.monotonic()

    @property
    def header(self) -> list[str]:
        """Columns of the table: number, varied keys, how the run ended, those of curve.csv."""
        columns = [name for name in self.study.case.row.header() if name not in self.study.keys]
        return ["run", *self.study.keys, "status", *columns, "words"]

    def rows(self) -> list[dict[str, Cell]]:
        """The table: a row for each state, one without numbers for a run that has none."""
        empty: dict[str, Cell] = dict.fromkeys(self.header, "")
        rows = []
        for number, point in enumerate(self.study.points):
            curve = self.curves.get(number)
            common = empty | {
                "run": number + 1,
                **{key: _cell(value) for key, value in point.items()},
                "status": self.status(number),
                "words": self._words(number),
            }
            states = [row.as_dict() for row in curve.rows] if curve else []
            rows += [common | _without(state, self.study.keys) for state in states or [{}]]
        return rows

    def counts(self) -> dict[str, int]:
        """Status at the end of a run -> number of such runs."""
        return dict(Counter(map(self.status, range(len(self.study.runs)))))

    def complaint(self) -> str:
        """Number of runs that are not as asked for, and the message of the first of them."""
        wrong = [n for n in range(len(self.study.runs)) if self.status(n) != "converged"]
        if not wrong:
            return ""
        first = f"run {wrong[0] + 1} {self.status(wrong[0])}: {self._words(wrong[0])}"
        return f"{len(wrong)} of {len(self.study.runs)} runs did not converge; {first}"

    def status(self, number: int) -> str:
        """Status of a run: converged, not converged, failed, not possible, or not run."""
        curve = self.curves.get(number)
        if curve is None:
            return "not possible" if isinstance(self.study.runs[number], str) else "not run"
        return "failed" if curve.failed else "converged" if curve.converged else "not converged"

    def _words(self, number: int) -> str:
        curve, parameters = self.curves.get(number), self.study.runs[number]
        if curve is None:
            return parameters if isinstance(parameters, str) else ""
        return "; ".join(curve.complaints)

    def _kept(self, task: Task) -> Curve | Task:
        """The curve of a run that came to its end and can be believed, or what is to be done."""
        try:
            earlier = read_earlier(task.folder, task.run, package_versions()["softehl"])
        except BadInput:  # damaged, or begun by another version
            return replace(task, existing="overwrite")
        status = str(earlier.content.get("status"))
        if status not in _ENDED or earlier.doubts:
            return task
        complaints = () if _ENDED[status] else (str(earlier.content.get("message")),)
        return Curve(task.run.parameters, task.folder, earlier.rows, complaints)

    def _remove_earlier(self) -> None:
        """Remove the runs of an earlier sweep, by their names."""
        if (self.folder / TABLE).exists():
            for path in (self.folder / RUNS).glob("[0-9]" * 5):
                shutil.rmtree(path)

    def _holds(self) -> bool:
        return holds_a_run(self.folder) or (self.folder / TABLE).exists()

    def _read(self) -> Mapping[str, Any]:
        """Record of an earlier sweep, empty if it is overwritten.  Raises BadInput."""
        if self._existing == "overwrite":
            return {}
        if self._existing == "refuse":
            raise refusal(self.folder, "runs")
        try:
            content = read_json(self.folder / "run.json")
            points, now = content["points"], self._described()
            others = [key for key in ("case", "fixed", "keys") if content[key] != now[key]]
        except (OSError, ValueError, KeyError) as error:
            raise BadInput(
                f"--resume: {self.folder} holds no sweep that can be read ({error}); --overwrite "
                "begins anew"
            ) from None
        if now["points"][: len(points)] != points:
            others.append("points")
        if others:
            raise BadInput(
                f"--resume: {self.folder} holds a sweep with other {' and '.join(others)}; "
                "allowed: the same, or more points behind them; --overwrite begins anew"
            )
        seconds = content.get("seconds", 0.0)
        self._before = float(seconds) if isinstance(seconds, int | float) else 0.0
        return content

    def _described(self) -> dict[str, Any]:
        """The study as run.json has it."""
        study = self.study
        described = {
            "case": study.case.name,
            "way": study.way,
            "fixed": dict(study.fixed),
            "keys": list(study.keys),
            "points": [list(point.values()) for point in study.points],
        }
        text: dict[str, Any] = json.loads(json.dumps(described, default=str))
        return text


def _without(state: Mapping[str, Cell], keys: tuple[str, ...]) -> dict[str, Cell]:
    return {name: cell for name, cell in state.items() if name not in keys}


def _cell(value: object) -> Cell:
    """A value of a key in the table."""
    if value is None:
        return ""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return value
    return json.dumps(value, default=str)
