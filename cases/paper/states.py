"""States that figures share: what is asked for, where it is kept, and how it is read back.

Each set of parameters is one ordinary run folder in `runs/`; speeds and strokes are what a run
may add to. A state that a run did not reach, or that collapsed, is still a :class:`RequestedState`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

from softehl.cases.harness.curve_folder import CurveFolder
from softehl.cases.harness.row import OK
from softehl.cases.harness.sweep import differences
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.run_plan import SIGNS
from softehl.cases.seal.states.state import COLLAPSED, FilmRow, Profile, contact_name
from softehl.cases.seal.states.state_files import read_profile
from softehl.runtime.arrays import Array
from softehl.runtime.io import number_text, read_columns, read_json

NOT_REACHED = "not reached"
"""Verdict of a state that its run could not reach."""

SPEEDS = (1600.0, 800.0, 400.0, 200.0, 100.0, 50.0, 25.0)
"""The rod speeds |U| of Table 1, halved from the fastest to the slowest, mm/s."""

ENDED = ("converged", "not converged")
"""Endings in run.json of a run that is complete; the rest of any other run is still missing."""

PAPER: dict[str, Any] = {
    "mesh": "uniform",
    "upwinding": 0.0,
    "error_estimate": False,
    "solid": "taylor",
    "arc_start": -34.0,
    "arc_end": 43.0,
}
"""Keys of the paper's scheme where a run by itself would do better."""

STABILISED: dict[str, Any] = {"mesh": "graded", "upwinding": 1.0, "error_estimate": True}
"""Keys of `softehl run` by itself, on the arc of the paper."""

_IN_NAME = ("density", "sealed_pressure")


def setup(density: int, sealed_pressure: float, **others: Any) -> Seal:
    """Parameters of a run, without speeds and stroke (those are left at their defaults)."""
    values: dict[str, Any] = {"density": density, "sealed_pressure": float(sealed_pressure)}
    return Seal(**{**PAPER, **values, **others})


@dataclass(frozen=True)
class Request:
    """A run that is needed: its parameters and the signed speeds U (mm/s, + = outstroke)."""

    setup: Seal
    speeds: frozenset[float]

    @property
    def name(self) -> str:
        """The folder of the run: density, p_s and what is not as in the paper's default."""
        others = differences(self.setup, Seal(**PAPER), (*CASE.selection, *_IN_NAME))
        first = [f"d{self.setup.density}", f"ps{number_text(self.setup.sealed_pressure)}"]
        return "-".join([*first, *others])

    @property
    def parameters(self) -> Seal:
        """Parameters for `softehl run`; both strokes get the same speeds if both are needed."""
        strokes = [
            stroke for stroke, sign in SIGNS.items() if any(sign * u > 0 for u in self.speeds)
        ]
        magnitudes = tuple(sorted({abs(u) for u in self.speeds}, reverse=True))
        stroke = "both" if len(strokes) == 2 else strokes[0]
        return self.setup.model_copy(update={"stroke": stroke, "speeds": magnitudes})


def ask(parameters: Seal, speeds: Iterable[float]) -> Request:
    """A request for signed speeds U."""
    return Request(parameters, frozenset(float(u) for u in speeds))


def merged(requests: Iterable[Request]) -> list[Request]:
    """One request for each run folder, the finest meshes first, which take longest."""
    by_name: dict[str, Request] = {}
    for request in requests:
        other = by_name.get(request.name)
        speeds = request.speeds | (other.speeds if other else frozenset())
        by_name[request.name] = Request(request.setup, speeds)
    return sorted(by_name.values(), key=lambda r: (-r.setup.density, r.setup.reynolds, r.name))


@dataclass(frozen=True, eq=False)
class RequestedState:
    """A requested state: its row and files if there are any, and its verdict in any case.

    folder: the folder of its files.
    """

    setup: Seal
    rod_speed: float
    row: FilmRow | None = None
    folder: Path | None = None

    @property
    def verdict(self) -> str:
        """One of `cases.seal.states.state`, or :data:`NOT_REACHED`."""
        return self.row.verdict if self.row else NOT_REACHED

    @property
    def usable(self) -> bool:
        """True if there are numbers to be shown, even if they are marked."""
        return self.row is not None and self.row.verdict != COLLAPSED

    @property
    def plain(self) -> bool:
        """True for a result without reservation."""
        return self.verdict == OK

    @property
    def h_star(self) -> float:
        """Film thickness h* in um, nan if there is none or it collapsed."""
        return self.row.h_star_um if self.row is not None and self.usable else nan

    @property
    def profile(self) -> Profile:
        """The fields along the film.  Raises ValueError for a state that was not reached."""
        if self.row is None or self.folder is None:
            raise ValueError(f"no profile at U = {self.rod_speed:g} mm/s: {self.verdict}")
        return read_profile(self.folder, self.row)

    @property
    def title(self) -> str:
        """Density, p_s and U in words."""
        p = self.setup
        return f"density {p.density}, p_s = {p.sealed_pressure:g}, U = {self.rod_speed:+g}"


@dataclass(frozen=True)
class Store:
    """The states in a folder of runs.  Raises OSError, ValueError where a file is damaged."""

    folder: Path
    _rows: dict[Path, list[FilmRow]] = field(default_factory=dict, repr=False)

    def run_folder(self, parameters: Seal) -> Path:
        """Folder of the run of these parameters, whether it exists or not."""
        return self.folder / Request(parameters, frozenset()).name

    def ended(self, parameters: Seal) -> bool:
        """True if the run of these parameters came to its end.  Raises OSError, ValueError."""
        path = self.run_folder(parameters) / "run.json"
        return path.exists() and read_json(path).get("status") in ENDED

    def state(self, parameters: Seal, rod_speed: float) -> RequestedState:
        """The state at a signed speed U, mm/s."""
        run = self.run_folder(parameters)
        for folder in (run, run / "rejected"):
            for row in self._read(folder):
                if row.rod_speed_mm_s == rod_speed:
                    return RequestedState(parameters, rod_speed, row, folder)
        return RequestedState(parameters, rod_speed)

    def states(self, parameters: Seal, speeds: Sequence[float]) -> list[RequestedState]:
        """The states at several signed speeds."""
        return [self.state(parameters, u) for u in speeds]

    def contact(self, parameters: Seal) -> tuple[Array, Array] | None:
        """x (mm) and frictionless contact pressure (MPa) along the arc, None if not reached."""
        path = self.run_folder(parameters) / f"{contact_name(parameters.sealed_pressure)}.csv"
        if not path.exists():
            return None
        columns = read_columns(path, ("x_mm", "p_MPa"))
        return columns["x_mm"], columns["p_MPa"]

    def effort(self, parameters: Seal, stages: Sequence[str], stroke: str) -> tuple[int, float]:
        """Iterations and seconds of some stages of a run; nan seconds where there is none."""
        path = self.run_folder(parameters) / "run.json"
        stages_read = read_json(path).get("stages", []) if path.exists() else []
        selected = [
            record
            for record in stages_read
            if record["name"] in stages and record["stroke"] == stroke
        ]
        seconds = sum(record["seconds"] for record in selected) if selected else nan
        return sum(record["iterations"] for record in selected), seconds

    def _read(self, path: Path) -> list[FilmRow]:
        if path not in self._rows:
            folder = CurveFolder(path, FilmRow)
            folder.load()
            self._rows[path] = folder.rows
        return self._rows[path]
