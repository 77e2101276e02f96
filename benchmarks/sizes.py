"""Sizes of files and functions by room: `python -m benchmarks.sizes [FOLDER|COMMIT ...] [--list]`.

A line counts if there is anything on it.  A function is counted from `def` to its last line, with
its docstring; the lines of functions inside it are its own, too.  Parameters are those that a call
may give, without `self` and `cls`.
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
FILE, FUNCTION, PARAMETERS = 300, 40, 6
"""Budgets: lines of a file, lines of a function, parameters."""

Functions = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Size:
    """Something that is measured: where it is, its lines, its parameters (0 for a file)."""

    place: str
    lines: int
    parameters: int = 0


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
            yield Size(f"{path}:{node.lineno} {node.name}", lines, _parameters(node))


def _filled(path: Path) -> set[int]:
    """Numbers of the lines that are not blank."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {number for number, line in enumerate(lines, start=1) if line.strip()}


def _parameters(node: Functions) -> int:
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def row(room: str, files: Sequence[Size], functions: Sequence[Size]) -> list[str]:
    """One line of the table."""
    lengths = [f.lines for f in functions] or [0]
    return [
        room,
        *(str(n) for n in (len(files), sum(f.lines for f in files))),
        *(str(n) for n in (max((f.lines for f in files), default=0), _over(files, FILE))),
        *(str(n) for n in (len(functions), f"{median(lengths):g}", max(lengths))),
        str(_over(functions, FUNCTION)),
        str(sum(f.parameters > PARAMETERS for f in functions)),
    ]


def _over(sizes: Sequence[Size], budget: int) -> int:
    return sum(size.lines > budget for size in sizes)


HEADER = (
    *("room", "files", "lines", "longest file", f"files > {FILE}"),
    *("functions", "median", "longest", f"functions > {FUNCTION}", f"parameters > {PARAMETERS}"),
)


def table(root: Path) -> list[list[str]]:
    """Header and a line for each room that is there."""
    there = [room for room in ROOMS if (root / room).is_dir()]
    return [
        list(HEADER),
        *(row(room, files_of(root / room), functions_of(root / room)) for room in there),
    ]


def over_budget(root: Path) -> list[str]:
    """Files and functions that are larger than their budget, outside the tests."""
    found = []
    for room in ROOMS[:-1]:
        found += [f for f in files_of(root / room) if f.lines > FILE]
        functions = functions_of(root / room)
        found += [f for f in functions if f.lines > FUNCTION or f.parameters > PARAMETERS]
    return [
        f"{f.place.removeprefix(f'{root}/')}: {f.lines} lines, {f.parameters} parameters"
        for f in found
    ]


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
                print("", *over_budget(root), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
