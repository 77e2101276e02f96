"""Resume of a run: the rows of an earlier run in a folder, and which of them are intact.

A row is kept if `curve.csv` and `run.json` have the same values for it and its files are those that
were written. Any other row is computed again, with a message.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypeAlias

from softehl.cases.harness.case import Run
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.file_content import file_digest
from softehl.cases.harness.row import Row
from softehl.runtime.io import read_csv, read_json
from softehl.runtime.kernels.shared_library import GENERATED, manifest

Existing: TypeAlias = Literal["refuse", "resume", "overwrite"]
"""Treatments of an earlier run in a folder."""


def existing_of(*, resume: bool, overwrite: bool) -> Existing:
    """From both options.  Raises BadInput where both are given."""
    if resume and overwrite:
        raise BadInput("--resume keeps what --overwrite replaces; allowed: one of them")
    return "resume" if resume else "overwrite" if overwrite else "refuse"


ANEW = "--overwrite begins anew"


@dataclass(frozen=True)
class Earlier:
    """An earlier run: what run.json says of it, the rows that are kept, and words on the others."""

    content: Mapping[str, Any] = field(default_factory=dict)
    rows: tuple[Any, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """Time that it took."""
        seconds = self.content.get("seconds", 0.0)
        return float(seconds) if isinstance(seconds, int | float) else 0.0

    @property
    def advice(self) -> dict[float, str]:
        """Advice in run.json on rows that are kept, by their keys."""
        return advice_of(self.content, self.rows)

    @property
    def stages(self) -> tuple[Any, ...]:
        """Stages as run.json records them."""
        stages = self.content.get("stages", ())
        return tuple(stages) if isinstance(stages, list) else ()


def advice_of(content: Mapping[str, Any], rows: Sequence[Row]) -> dict[float, str]:
    """Advice in run.json on rows whose verdict is not ok, by their keys."""
    advice = {}
    for row in rows:
        name = row.key_column().name
        for state in content.get("states", ()):
            if isinstance(state, dict) and state.get(name) == row.key:
                advice[row.key] = str(state.get("advice") or "")
    return advice


def holds_a_run(folder: Path) -> bool:
    """True if a folder holds anything of a run."""
    return any((folder / name).exists() for name in ("run.json", "curve.csv"))


def kernel_signatures() -> dict[str, str]:
    """Kernel -> signature, of all that ship."""
    return {name: entry["signature"] for name, entry in manifest(GENERATED).items()}


def read_earlier(folder: Path, run: Run, version: str | None) -> Earlier:
    """The earlier run in a folder, to be resumed by this one; nothing where there is none.

    Raises BadInput where it is another one, of another version, or cannot be read.
    """
    if not holds_a_run(folder):
        return Earlier()
    try:
        content = read_json(folder / "run.json")
        _states(content)
    except FileNotFoundError:
        if not _has_rows(folder / "curve.csv"):
            return Earlier()  # a run that was ended before it had anything
        raise BadInput(f"--resume: {folder} has a curve.csv and no run.json; {ANEW}") from None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise BadInput(
            f"--resume: {folder / 'run.json'} is damaged ({_shortened(error)}); {ANEW}"
        ) from None
    difference = _difference(content, run, version)
    if difference:
        raise BadInput(
            f"--resume: {folder} holds a run with {difference}; allowed to differ: "
            f"{', '.join(run.case.selection) or 'nothing'}; {ANEW}"
        )
    rows, warnings = _believed(folder, run, content)
    return Earlier(content, tuple(rows), tuple(warnings))


def _has_rows(path: Path) -> bool:
    try:
        return len(path.read_bytes().splitlines()) != 1
    except OSError:
        return True


def _states(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The rows of run.json.  Raises ValueError."""
    states = content.get("states")
    if not isinstance(states, list) or not all(isinstance(s, dict) for s in states):
        raise ValueError("it has no list of states")
    return states


def _difference(content: Mapping[str, Any], run: Run, version: str | None) -> str:
    """Differences of an earlier run from this one, in words; empty if there are none."""
    if content.get("case") != run.case.reference:
        return f"other parameters: case = {content.get('case')!r}, now {run.case.reference!r}"
    previous, now = content.get("parameters"), run.parameters.model_dump(mode="json")
    if not isinstance(previous, dict):
        return "other parameters: run.json has none"
    for key in [*now, *previous]:
        if key not in run.case.selection and previous.get(key) != now.get(key):
            return f"other parameters: {key} = {previous.get(key)!r}, now {now.get(key)!r}"
    versions, kernels = content.get("versions"), content.get("kernels")
    used = versions.get("softehl") if isinstance(versions, dict) else None
    if used != version:
        return f"another version: softehl {used}, now {version}"
    signatures = kernel_signatures()
    if not isinstance(kernels, dict) or not kernels:
        return "unknown kernels"
    other = [name for name, signature in kernels.items() if signatures.get(name) != signature]
    return f"other kernels: {', '.join(map(str, other))}" if other else ""


def _believed(folder: Path, run: Run, content: Mapping[str, Any]) -> tuple[list[Row], list[str]]:
    """Rows that can be kept, and words on those that cannot."""
    states, intact, warnings = _states(content), list[Row](), list[str]()
    try:
        table = read_csv(folder / "curve.csv", run.case.row.header())
    except (OSError, ValueError) as error:
        table, damage = [], _shortened(error)
        if states:
            warnings.append(f"curve.csv cannot be read ({damage}): its rows are computed again")
    rows: list[Row] = []
    for number, cells in enumerate(table, start=1):
        try:
            rows.append(run.case.row.parse(cells))
        except (ValueError, TypeError, OverflowError):
            warnings.append(f"line {number + 1} of curve.csv is no row: it is computed again")
    count = Counter(row.key for row in rows)
    for row in rows:
        reason = "it is there twice" if count[row.key] > 1 else disbelief(folder, row, states)
        reason = reason or edited_table(folder, content, f"_{row.name}.csv")
        if reason:
            warnings.append(f"{row.label(row.key)}: {reason}; computed again")
        else:
            intact.append(row)
    return intact, list(dict.fromkeys(warnings))


def edited_table(folder: Path, content: Mapping[str, Any], ending: str = ".csv") -> str:
    """Return a fault of the tables of these names beside the curve, empty if there is none.

    content: of run.json. A table that is not there is not believed either.
    """
    digests = content.get("tables")
    for name, digest in digests.items() if isinstance(digests, dict) else ():
        path = folder / name
        if name.endswith(ending) and path.exists() and file_digest(path) != digest:
            return f"{name} is not what was written"
    return ""


def disbelief(folder: Path, row: Row, states: Sequence[Mapping[str, Any]]) -> str:
    """Why a row of curve.csv cannot be believed, empty if it can."""
    values = _plain(row.as_dict())
    same = [state for state in states if {k: state.get(k) for k in values} == values]
    if not same:
        return "curve.csv and run.json differ"
    digests = same[0].get("digests")
    for name in row.file_names():
        digest = digests.get(name) if isinstance(digests, dict) else None
        try:
            actual = file_digest(folder / name)
        except OSError:
            return f"{name} is missing"
        if actual != digest:
            return f"{name} is not what was written"
    return ""


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values as run.json has them: what is not finite is null."""
    return {
        key: None if isinstance(value, float) and not isfinite(value) else value
        for key, value in json.loads(json.dumps(values)).items()
    }


def _shortened(error: BaseException) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else f"{text[:117]}..."
