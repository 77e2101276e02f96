"""A case: one declared record of what the harness must know of it; a run: a case with parameters.

A case is what its parameters, its rows and its `solve` make it.  Everything else has a default that
fits a case whose rows follow the values of one key, a list.
"""

import importlib
import re
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from softehl.cases.harness.errors import BadInput, one_line
from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.harness.parameters import Parameters
from softehl.cases.harness.row import Record, Row

P = TypeVar("P", bound=Parameters)
R = TypeVar("R", bound=Row)


class Alarm(str):
    """A line that is shown in red."""

    __slots__ = ()


class Case(Generic[P, R]):
    """Base of the declaration of a case; one instance of it, `CASE`, is in the module of the case.

    name, title: what it is called, and what it is in one line.  parameters, row: their classes.
    list_key: the key whose values the rows follow.  selection: keys that only select rows, which a
    resumed run may change.  method_keys: keys that choose a way to the same rows.  files: patterns
    of the files that it writes beside those of its rows.  shared: name of the folder in which the
    runs of a sweep leave something for each other, empty for none.  left_out: what its model leaves
    out, in words for a report.  source: "module:attribute" of a case that does not ship, set when
    it is loaded.
    """

    name: str
    title: str
    parameters: type[P]
    row: type[R]
    list_key: str = ""
    selection: tuple[str, ...] = ()
    method_keys: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    shared: str = ""
    left_out: tuple[str, ...] = ()
    source: str = ""

    @property
    def reference(self) -> str:
        """Name by which the case is found again: of one that ships, else its source."""
        return self.source or self.name

    def solve(self, parameters: P, observer: Observer, shared: Path | None) -> Outcome[Any]:
        """Compute all rows that are asked for; failure is in the outcome's status.

        shared: folder of what runs leave for each other, None for none.  Imports what is heavy when
        it is called.
        """
        raise NotImplementedError

    def requested(self, parameters: P) -> list[float]:
        """The keys of all rows that are asked for."""
        return list(getattr(parameters, self.list_key))

    def rounds(self, parameters: P) -> Sequence[P]:
        """Parameter sets to be run one after the other; later ones may improve on earlier rows."""
        return [parameters]

    def pieces(self, parameters: P, rows: Sequence[R], jobs: int) -> list[P]:
        """Parameter sets still to be run, given the rows that are there.

        At most `jobs` sets, to run side by side, or any number to run one after the other.
        """
        present = {row.key for row in rows}
        missing = [key for key in self.requested(parameters) if key not in present]
        portions = [missing[start::jobs] for start in range(jobs)]
        updates = [{self.list_key: tuple(share)} for share in portions if share]
        return [parameters.model_copy(update=update) for update in updates]

    def piece_name(self, piece: P) -> str:
        """A name that distinguishes a piece from those that run beside it."""
        return str(self.requested(piece))

    def stage_label(self, name: str, marks: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
        """Title of a stage on the terminal, and its marks in run.json; see `Observer.stage`."""
        return name, marks

    def tables(self, rows: Sequence[R]) -> Mapping[str, Sequence[Record]]:
        """Further tables that follow from the rows: file name without .csv -> records."""
        return {}

    def caption(self, rows: Sequence[R]) -> str:
        """Title of the table on the terminal."""
        return self.title

    def named(self, rows: Sequence[R]) -> str:
        """Some rows in words: "U = +200, +100 mm/s"."""
        return self.row.labels([row.key for row in rows])

    def complaints(
        self, parameters: P, rows: Sequence[R], rejected: Sequence[R], advice: str
    ) -> list[str]:
        """Faults of the rows that are there, in words; empty if there are none.

        advice: the advice that came with the rejected ones.
        """
        return [f"not a result: {self.named(rejected)}. {advice}"] if rejected else []

    def assumed(self, parameters: P, set_keys: Collection[str]) -> list[str]:
        """Important values that were not given, in words.  set_keys: the keys that were."""
        return []

    def warnings(self, parameters: P) -> list[str]:
        """Unusual settings of a run, told before it begins; it runs all the same."""
        return []

    def summary(self, parameters: P, rows: Sequence[R]) -> list[str]:
        """The main results in words, a line each; what should alarm a reader is an Alarm."""
        return []

    def details(self, parameters: P, folder: Path) -> list[str]:
        """Lines that follow the answer, from other files of a finished run."""
        return []

    def merits(self, parameters: P, rows: Sequence[R]) -> Mapping[str, float]:
        """Numbers that runs of a sweep are judged by: words with a unit -> value.

        Of every number of the rows with a head the largest, unless the case knows better.
        """
        return {
            f"largest {c.title}": max(float(getattr(row, c.name)) for row in rows)
            for c in self.row.columns()
            if c.head and c.kind is float and c != self.row.key_column()
        }

    def sense(self, merit: str) -> float:
        """Sign of a merit, 1 where less is better and -1 where more is."""
        return 1.0

    def titled(self, parameters: P) -> str:
        """Title of a run with these parameters."""
        return self.title

    def foreword(self, parameters: P) -> list[str]:
        """Lines that a user should read before the run begins."""
        return []

    def notes(
        self, rows: Sequence[R], advice: Mapping[float, str] = MappingProxyType({})
    ) -> list[str]:
        """Remarks on rows that are results with a reservation.

        advice: advice of the rows by their keys.
        """
        return []

    def cautions(self, parameters: P) -> list[str]:
        """Differences of such a run from measurements, in words, a line each."""
        return []

    def draw(
        self,
        parameters: P,
        folder: Path,
        rows: Sequence[R],
        rejected: Sequence[R],
        kinds: Sequence[str],
    ) -> None:
        """Write pictures of a run; the files of its rows can be read from the folder.

        kinds: of the files of each picture, png or svg; none if empty. Raises OSError, and
        ValueError where a file cannot be read back.
        """

    def report(self, runs: Sequence[Any]) -> Sequence[Any]:
        """Parts (`harness.report.part.Part`) that a report of finished runs has of this case."""
        return ()

    def share(self, parameters: P) -> tuple[float, str]:
        """Duration of a run compared with others, and the name of what it can share.

        Runs of one name can use each other's files in the shared folder.
        """
        return 0.0, ""


AnyCase = Case[Any, Any]
Solve = Callable[[Any, Observer], Outcome[Any]]


def load_case(module: str) -> AnyCase:
    """The case that a module declares as `CASE`."""
    case: AnyCase = importlib.import_module(module).CASE
    return case


def is_reference(name: str) -> bool:
    """True if a name is "module:attribute"."""
    return re.fullmatch(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*", name) is not None


def find_named_case(name: str, shipped: Mapping[str, str]) -> AnyCase:
    """The case of a name: one that ships, or "module:attribute" of a user's module.

    The attribute is a subclass of :class:`Case` or an instance of one.  Modules are found as by
    `python -m`, in the working directory too.  Raises BadInput, and KeyError for another name.
    """
    if not is_reference(name):
        return load_case(shipped[name])
    module, attribute = name.split(":")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    try:
        declared = vars(importlib.import_module(module)).get(attribute)
    except ModuleNotFoundError as error:
        raise BadInput(f"{name}: there is no module {error.name!r} here or in PYTHONPATH") from None
    except Exception as error:
        raise BadInput(f"{name}: {module} cannot be imported, {one_line(error)}") from None
    if declared is None:
        raise BadInput(f"{name}: {module} has no {attribute!r}; allowed: a case, class or instance")
    try:
        case = declared() if isinstance(declared, type) else declared
    except Exception as error:
        raise BadInput(f"{name}: {attribute}() failed, {one_line(error)}") from None
    parts = ("name", "title", "parameters", "row")
    if not isinstance(case, Case) or not all(hasattr(case, part) for part in parts):
        raise BadInput(
            f"{name}: {attribute!r} is no case; allowed: a subclass of Case, or an instance, that "
            f"declares {', '.join(parts)}"
        )
    case.source = name
    return case


@dataclass(frozen=True)
class Run:
    """A case with its checked parameters.

    shared: folder in which runs leave something for each other, None for none.  set_keys: the keys
    that a user gave.  pictures: see `Case.draw`.
    """

    case: AnyCase
    parameters: Any
    shared: Path | None = None
    set_keys: frozenset[str] = frozenset()
    pictures: tuple[str, ...] = ("png",)

    def solve(self, parameters: Any, observer: Observer) -> Outcome[Any]:
        """Run the case with these parameters."""
        return self.case.solve(parameters, observer, self.shared)
