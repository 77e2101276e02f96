"""Sizes of files and functions by room: `python -m benchmarks.sizes [FOLDER|COMMIT ...] [--list]`.

A line counts if there is anything on it.  A function is counted from `def` to its last line, with
its docstring; the lines of functions inside it are its own, too.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOMS = ("codegen", "runtime", "cases", "benchmarks", "docs", "tests")
FILE = 800
"""Lines of a module, at most about."""

Functions = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Size:
    """Something that is measured: where it is, its lines."""

    place: str
    lines: int


def files_of(folder: Path) -> list[Size]:
    """Python files below a folder."""
    return [Size(str(path), len(_filled(path))) for path in sorted(folder.rglob("*.py"))]


def functions_of(folder: Path) -> list[Size]:
    """Functions and methods below a folder, also those inside others."""
    return [size for path in sorted(folder.rglob("*.py")) for size in _functions(path)]


def _functions(path: Path) -> Iterator[Size]:
    filled = _filled(path)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, Functions):
            lines = len(filled & set(range(node.lineno, (node.end_lineno or node.lineno) + 1)))
            yield Size(f"{path}:{node.lineno} {node.name}", lines)


def _filled(path: Path) -> set[int]:
    """Numbers of the lines that are not blank."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {number for number, line in enumerate(lines, start=1) if line.strip()}


def row(room: str, files: Sequence[Size], functions: Sequence[Size]) -> list[str]:
    """One line of the table."""
    lines, lengths = [f.lines for f in files] or [0], [f.lines for f in functions] or [0]
    return [
        room,
        *(str(n) for n in (len(files), sum(lines), max(lines), sum(n > FILE for n in lines))),
        *(str(n) for n in (len(functions), f"{median(lengths):g}", max(lengths))),
    ]


HEADER = (
    *("room", "files", "lines", "longest file", f"files > {FILE}"),
    *("functions", "median", "longest"),
)


def table(root: Path) -> list[list[str]]:
    """Header and a line for each room that is there."""
    there = [room for room in ROOMS if (root / room).is_dir()]
    return [
        list(HEADER),
        *(row(room, files_of(root / room), functions_of(root / room)) for room in there),
    ]


def long_files(root: Path) -> list[str]:
    """Files that are longer than a module should be."""
    sizes = [size for room in ROOMS for size in files_of(root / room) if size.lines > FILE]
    return [f"{size.place.removeprefix(f'{root}/')}: {size.lines} lines" for size in sizes]


def unpacked(commit: str, folder: Path) -> Path:
    """The files of a commit of this repository, in a folder.  Raises CalledProcessError."""
    command = ["git", "archive", commit]
    content = subprocess.run(command, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def main(arguments: Sequence[str]) -> None:
    """Print a table, in Markdown, for each folder or commit that is named; for this one if none."""
    named = [argument for argument in arguments if argument != "--list"] or ["."]
    for name in named:
        with tempfile.TemporaryDirectory() as place:
            root = Path(name) if Path(name).is_dir() else unpacked(name, Path(place))
            header, *rows = table(root)
            print(f"\n{name}\n")
            for line in (header, ["---"] * len(header), *rows):
                print(f"| {' | '.join(line)} |")
            if "--list" in arguments:
                print("", *long_files(root), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
