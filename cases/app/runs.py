"""Runs of the desk, each in a process of its own: `softehl run CASE.toml`, and what is there."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from signal import SIGTERM
from typing import Any

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.report.page import read_finished
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.shipped import SHIPPED
from softehl.runtime.io import write_text

CASE = "oring"
"""The case of the desk."""

PATIENCE = 20.0
"""Seconds that a run has to save what it reached; after them it is killed."""

_FILE, _LOG = ".desk.toml", ".desk.log"  # hidden: a run wants a folder without other files
_STOPPED = (-SIGTERM, 128 + SIGTERM)  # before and after Python listens to the signal
_ENDED = {"converged": "done", "not converged": "not all reached", "interrupted": "stopped"}


@dataclass(frozen=True)
class RunState:
    """A run as it is shown. requested, done: numbers of states. line: what it told last."""

    name: str
    status: str
    requested: int = 0
    done: int = 0
    line: str = ""
    run: FinishedRun | None = None

    @property
    def running(self) -> bool:
        """True while its process runs."""
        return self.status == "running"


@dataclass
class Desk:
    """The runs in a folder, and the processes of those that were started here."""

    folder: Path
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _read: dict[str, tuple[object, FinishedRun | None]] = field(default_factory=dict)

    def start(self, values: Mapping[str, Any]) -> str:
        """Begin a run of a case with these keys; its name.  Raises OSError."""
        name = self._free(values)
        (self.folder / name).mkdir(parents=True)
        write_text(self.folder / name / _FILE, case_text(values))
        self._begin(name)
        return name

    def resume(self, name: str) -> None:
        """Compute what a run of the desk lacks.  Raises BadInput where it is not of the desk."""
        if not (self.folder / name / _FILE).exists():
            raise BadInput(f"{name} was not begun here; go on with softehl run --resume")
        if not self._running(name):
            self._begin(name, "--resume")

    def stop(self, name: str) -> None:
        """Ask a run to save what it reached and end; one that does not is killed by `close`."""
        if self._running(name):
            self.processes[name].terminate()

    def close(self) -> None:
        """End all runs that were started here."""
        for name in self.processes:
            self.stop(name)
        for process in self.processes.values():
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()

    def names(self) -> list[str]:
        """The runs in the folder, the latest first."""
        if not self.folder.is_dir():
            return []
        folders = [p for p in self.folder.iterdir() if p.is_dir() and _is_run(p)]
        return [p.name for p in sorted(folders, key=_start_time, reverse=True)]

    def states(self) -> list[RunState]:
        """Every run of the case of the desk that can be read, the latest first."""
        states = [self.state(name) for name in self.names()]
        return [s for s in states if s.run is not None or s.name in self.processes]

    def state(self, name: str) -> RunState:
        """The state of a run by its name."""
        run, line = self._finished(name), _last_line(self.folder / name / _LOG)
        running = self._running(name)
        if run is None:
            ended = self.processes[name].poll() if name in self.processes else None
            status = "running" if running else "stopped" if ended in _STOPPED else "failed"
            return RunState(name, status, line=line)
        recorded_status = str(run.content.get("status"))
        status = "running" if running else _ENDED.get(recorded_status, "stopped")
        requested = len(run.case.requested(run.parameters))
        return RunState(name, status, requested, len(run.rows), line, run)

    def case_file(self, name: str) -> str:
        """The case file of a run: as it was given here, else the keys that are not at defaults."""
        path = self.folder / name / _FILE
        if path.exists():
            return path.read_text(encoding="utf-8")
        run = self._finished(name)
        if run is None:
            raise BadInput(f"{name} is no run that can be read")
        values, default = (p.model_dump() for p in (run.parameters, run.case.parameters()))
        return case_text({k: v for k, v in values.items() if v != default[k] and v is not None})

    def _begin(self, name: str, *options: str) -> None:
        folder = self.folder / name
        command = [
            sys.executable,
            "-m",
            "softehl",
            "run",
            str(folder / _FILE),
            "--out",
            str(folder),
        ]
        with (folder / _LOG).open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [*command, *options], stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def _running(self, name: str) -> bool:
        return name in self.processes and self.processes[name].poll() is None

    def _finished(self, name: str) -> FinishedRun | None:
        """The run in a folder, read again when it has changed; None where none can be read."""
        folder = self.folder / name
        stamp = [_stamp(folder / file) for file in ("run.json", "curve.csv")]
        if self._read.get(name, (None,))[0] != stamp:
            try:
                run: FinishedRun | None = read_finished(folder, SHIPPED)
            except BadInput:  # none yet, a sweep
                run = None
            self._read[name] = stamp, run if run and run.case.name == CASE else None
        return self._read[name][1]

    def _free(self, values: Mapping[str, Any]) -> str:
        """A new name for a run with these keys."""
        parts = [str(values[key]) for key in ("ring", "rod", "bore", "compound") if values.get(key)]
        first = re.sub(r"[^A-Za-z0-9.]+", "-", " ".join(parts)).strip("-.") or CASE
        number, name = 1, first
        while (self.folder / name).exists():
            number += 1
            name = f"{first}-{number}"
        return name


def case_text(values: Mapping[str, Any]) -> str:
    """A case file, TOML: texts, numbers, truths and lists are written in it as in JSON."""
    pairs = {"case": CASE, **values}.items()
    return "".join(f"{key} = {_toml(value)}\n" for key, value in pairs)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{k} = {_toml(v)}' for k, v in value.items() if v is not None)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)


def _is_run(folder: Path) -> bool:
    return any((folder / name).exists() for name in ("run.json", _FILE))


def _start_time(folder: Path) -> float:
    file = folder / _FILE
    return (file if file.exists() else folder / "run.json").stat().st_mtime


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _last_line(path: Path) -> str:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    messages = [line.strip() for line in lines if line.strip()]
    return messages[-1] if messages else ""
