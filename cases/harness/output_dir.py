"""Output folders: the first free one of a series, and folders that a run may write to."""

import re
from itertools import chain, count
from pathlib import Path

from softehl.cases.harness.resume import Existing

_RECORDS = ("run.json", "curve.csv", "sweep.csv")


def unnamed_folder(first: Path, existing: Existing) -> tuple[Path, str]:
    """A folder of the series `first`, `first`-2, `first`-3, ... and a word on it for the user.

    A new run takes the first one that is free; one that is to be resumed or overwritten is the one
    that was written to last. The word is empty where nothing was there.
    """
    if existing == "refuse":
        others = (first.with_name(f"{first.name}-{number}") for number in count(2))
        output = next(folder for folder in chain([first], others) if _is_free(folder))
        return output, "" if output == first else f"{first} is taken; this run goes to {output}"
    output = _newest(first)
    return output, f"--{existing}: {output}" if _holds_records(output) else ""


def _is_free(folder: Path) -> bool:
    """True if a folder has hidden files at most, and no run is under way in it."""
    if not folder.exists():
        return True
    try:
        names = [path.name for path in folder.iterdir()]
    except OSError:  # a file, or a folder that cannot be read
        return False
    return ".lock" not in names and all(name[0] == "." for name in names)


def _newest(first: Path) -> Path:
    """The folder of the series that was written to last, `first` where there is none."""
    if not first.parent.is_dir():
        return first
    name = re.compile(rf"{re.escape(first.name)}(-\d+)?")
    folders = [p for p in first.parent.iterdir() if name.fullmatch(p.name) and _holds_records(p)]
    return max(folders, key=_written, default=first)


def _holds_records(folder: Path) -> bool:
    return any((folder / name).exists() for name in _RECORDS)


def _written(folder: Path) -> float:
    """When the record of a run was last written."""
    return max((folder / n).stat().st_mtime for n in _RECORDS if (folder / n).exists())
