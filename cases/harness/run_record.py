"""The folder of a run: what is in it, in which order it is written, and what a resumed run keeps.

For each state its files are written first, then `curve.csv`, then `run.json`: a row of the curve is
the promise that the files of its state are complete.  Rows that are not usable are never results:
they go to the folder `rejected`, in files of the same form.
"""

import importlib.metadata
import os
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from softehl.cases.harness.case import AnyCase, Run
from softehl.cases.harness.curve_folder import CurveFolder
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.file_content import Content, file_digest, write_content
from softehl.cases.harness.observer import Outcome, StageRecord, State
from softehl.cases.harness.resume import (
    Earlier,
    Existing,
    holds_a_run,
    kernel_signatures,
    read_earlier,
)
from softehl.cases.harness.row import Record, Row
from softehl.folder_lock import FolderLock
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_arrays, write_arrays, write_csv, write_json
from softehl.runtime.kernels.shared_library import library_of

_DRAFT = "unfinished.npz"
_OURS = ("run.json", "curve.csv", _DRAFT)
_KEY = "key"
_SIZE = ("kernels", "kernel_library", "unknowns", "solvers", "numbers")
_PACKAGES = (
    *("softehl", "numpy", "scipy", "cffi", "pypardiso"),
    *("pydantic", "click", "rich", "meshio", "matplotlib"),
)


@dataclass
class StageLog:
    """Data of a stage while it runs, for the record of a run that is cut short."""

    name: str
    where: Mapping[str, Any]
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
            where=self.where,
        )


class RunRecord:
    """Everything a run writes, kept up to date while it runs; a context that locks the folder.

    Nothing is created before the first call of :meth:`begin`; bad input leaves no trace.
    """

    def __init__(self, folder: Path, run: Run, existing: Existing) -> None:
        """Look at what is in `folder`.

        existing: what to do with an earlier run there. Raises BadInput if the folder cannot hold
        or resume this run, or another one is under way there.
        """
        self.folder = folder
        self.run = run
        self.curve = CurveFolder(folder, run.case.row)
        self.rejected = CurveFolder(folder / "rejected", run.case.row)
        self.advice: dict[float, str] = {}
        self._began: float | None = None
        self._earlier = Earlier()
        self._existing = existing
        self._lock = FolderLock(folder, error=BadInput)
        self._size: dict[str, Any] = dict.fromkeys(_SIZE)
        self._logs: list[StageLog] = []
        self._stages: list[StageRecord] | None = None
        require_folder(folder)
        if holds_a_run(folder):
            self._take(existing)
        elif existing != "overwrite":
            require_empty(folder)

    def __enter__(self) -> Self:
        """The folder is locked as soon as it is there."""
        return self

    def __exit__(self, *_: object) -> None:
        """Release the folder."""
        self._lock.release()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Rows of an earlier run that are not intact and are computed again."""
        return self._earlier.warnings

    @property
    def began(self) -> bool:
        """True if anything was written."""
        return self._began is not None

    def begin(self) -> None:
        """Create the folder, or empty it of an earlier run that is not resumed; once."""
        if self.began:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock.take()
        if self._existing == "refuse" and holds_a_run(self.folder):
            raise refusal(self.folder, "rows")  # somebody else was faster
        self._began = time.perf_counter()
        if not self._earlier.content:
            _remove_earlier(self.folder, self.run.case)
        self._size["kernels"] = kernel_signatures()  # which of them are used is known in the end
        # what is rejected is tried again, also by a resumed run
        _remove_earlier(self.rejected.path, self.run.case)
        self.curve.save()
        self.save("running", "")

    def open_stage(self, name: str, where: Mapping[str, Any]) -> StageLog:
        """Open the log of a new stage."""
        self.begin()
        self._logs.append(StageLog(name, where))
        return self._logs[-1]

    def files(self, contents: Mapping[str, Content]) -> None:
        """Write files that belong to no row."""
        self.begin()
        for name, content in contents.items():
            write_content(self.folder / name, content)

    def state(self, state: State) -> Row:
        """Write a state where it belongs and the run record after it."""
        self.begin()
        result = state.row.usable
        row: Row = (self.curve if result else self.rejected).add(state)
        if result:
            self.rejected.drop(row.key)
            (self.folder / _DRAFT).unlink(missing_ok=True)
        self.advice[row.key] = state.advice
        self.save("running", "")
        return row

    def draft(self, key: float, arrays: Mapping[str, Array]) -> None:
        """Keep what there is of a row that is not complete; only the last one is kept."""
        self.begin()
        write_arrays(self.folder / _DRAFT, {**arrays, _KEY: np.array([key])}, shared=False)

    def drafted(self, key: float) -> dict[str, Array] | None:
        """Unfinished part of a row of the run that is resumed, None if none can be read."""
        arrays = read_arrays(self.folder / _DRAFT) if self._earlier.content else None
        if arrays is None or arrays.pop(_KEY, np.empty(0)).tolist() != [key]:
            return None
        return arrays

    def set_outcomes(self, outcomes: Sequence[Outcome[Any]]) -> None:
        """Record what only the end of a run shows: size, kernels and cost of each stage."""
        for outcome in outcomes:
            if not outcome.kernel_signatures:
                continue
            self._size = {
                "kernels": dict(outcome.kernel_signatures),
                "kernel_library": library_of().kind,
                "unknowns": dict(outcome.unknowns),
                "solvers": dict(outcome.solvers),
                "numbers": dict(outcome.numbers),
            }
        self._stages = [record for outcome in outcomes for record in outcome.stages] or None

    def save(self, status: str, message: str) -> None:
        """Write the further tables of the case that have rows, then run.json."""
        tables = self.run.case.tables(self.curve.rows)
        for name, records in tables.items():
            self._save_table(name, records)
        seconds = 0.0 if self._began is None else time.perf_counter() - self._began
        stages = self._stages if self._stages is not None else [log.record() for log in self._logs]
        content = {
            "case": self.run.case.reference,
            "status": status,
            "message": message,
            "warnings": self.run.case.warnings(self.run.parameters),
            "assumed": self.run.case.assumed(self.run.parameters, self.run.set_keys),
            "parameters": self.run.parameters.model_dump(),
            "versions": package_versions(),
            **self._size,
            "seconds": seconds + self._earlier.seconds,
            "stages": [*self._earlier.stages, *map(_stage_json, stages)],
            **{name: [record.as_dict() for record in some] for name, some in tables.items()},
            "states": [self._row_json(row, self.curve, ".") for row in self.curve.rows],
            "rejected": [self._row_json(r, self.rejected, "rejected") for r in self.rejected.rows],
            "tables": table_digests(self.folder, self.run.case),
        }
        write_json(self.folder / "run.json", content)

    def _save_table(self, name: str, records: Sequence[Record]) -> None:
        if records:
            cells = [record.cells() for record in records]
            write_csv(self.folder / f"{name}.csv", records[0].header(), cells)

    def _take(self, existing: Existing) -> None:
        """Resume an earlier run, leave it to be overwritten, or refuse."""
        if existing == "refuse":
            raise refusal(self.folder, "rows")
        try:
            self._lock.take()
        except OSError as error:
            raise BadInput(f"cannot write to {self.folder}: {error.strerror}") from None
        if existing == "resume":
            try:
                version = package_versions()["softehl"]
                self._earlier = read_earlier(self.folder, self.run, version)
            except BaseException:
                self._lock.release()
                raise
            content = self._earlier.content
            self._size = {key: content.get(key) for key in self._size}
            self.curve.keep(self._earlier.rows)
            self.advice.update(self._earlier.advice)

    def _row_json(self, row: Row, curve: CurveFolder[Any], folder: str) -> dict[str, Any]:
        names = row.file_names()
        digests = {name: curve.digests.get(name) for name in names}
        files = [str(Path(folder, name)) for name in names]
        advice = {"advice": self.advice.get(row.key, "")}
        return row.as_dict() | advice | {"files": files, "digests": digests}


def table_digests(folder: Path, case: AnyCase) -> dict[str, str]:
    """Digests of the tables of a case that are in a folder, beside the curve and its files."""
    paths = {path for name in case.files if name.endswith(".csv") for path in folder.glob(name)}
    return {path.name: file_digest(path) for path in sorted(paths)}


def refusal(folder: Path, contents: str) -> BadInput:
    """For a folder that holds an earlier run; contents: what --resume keeps of it."""
    return BadInput(
        f"{folder} holds an earlier run; --resume keeps its {contents}, --overwrite begins anew, "
        "--out names another folder"
    )


def require_folder(folder: Path) -> None:
    """Raise BadInput if a part of the path is there and is no folder that can be written to."""
    try:
        nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    except (OSError, StopIteration) as error:
        raise BadInput(f"--out {str(folder)!r}: {error}; allowed: a folder") from None
    if not nearest.is_dir():
        raise BadInput(f"--out {str(folder)!r}: {nearest} is not a folder; allowed: a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise BadInput(f"--out {str(folder)!r}: no permission to write to {nearest}")


def require_empty(folder: Path) -> None:
    """Raise BadInput if there is anything in a folder but hidden files: it is somebody else's."""
    try:
        names = sorted(path.name for path in folder.iterdir() if path.name[0] != ".")
    except FileNotFoundError:
        return
    except OSError as error:
        raise BadInput(f"--out {str(folder)!r}: {error.strerror}; allowed: a folder") from None
    if names:
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        raise BadInput(
            f"--out {str(folder)!r} holds {names[0]!r}{more} and no run; allowed: a new or empty "
            "folder; --overwrite writes into it and replaces files of the same names"
        )


def _remove_earlier(folder: Path, case: AnyCase) -> None:
    """Remove the files of an earlier run by their names, and nothing else."""
    if not (folder / "curve.csv").exists() and not (folder / "run.json").exists():
        return  # not a folder of ours: a name in it that looks like ours is somebody else's
    for pattern in (*_OURS, *case.row.file_patterns(), *case.files):
        for path in folder.glob(pattern):
            path.unlink()


def _stage_json(record: StageRecord) -> dict[str, Any]:
    parameters = record.parameters or (None,) * len(record.residual_histories)
    steps = zip(parameters, record.residual_histories, strict=False)
    return {
        "name": record.name,
        **record.where,
        "method": record.method,
        "seconds": record.seconds,
        "factorisations": record.factorisations,
        "iterations": record.iterations,
        "steps": [{"parameter": p, "residuals": history} for p, history in steps],
    }


@cache
def package_versions() -> dict[str, str | None]:
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
