"""`softehl generate PAGE --target HOST --out FOLDER`: a page for another program."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from softehl.codegen.abi import TargetError
from softehl.codegen.hosts.all import ELEMENTS
from softehl.codegen.hosts.interface import Interface
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import cache, samples, user
from softehl.codegen.tools.model_text import ModelFileError

STATES = 2
"""States of an element at which the test of a folder compares values."""
MARK = "softehl"
"""A word in every file that is written."""


def generate(paths: Sequence[Path], host: str, out: Path | None) -> int:
    """Write the folder of a host; exit code 0, or 2 if the host cannot take a page.

    Several pages get folders of their own inside `out`.
    Raises `ModelFileError`, `NoStateError`, OSError.
    """
    if not paths or out is None:
        print(f"softehl: target {host} needs a MODEL.py and --out FOLDER", file=sys.stderr)
        return 2
    pages = [d for p in paths for d in user.definitions(p)]
    user.check_names(", ".join(p.name for p in paths), pages)
    code = 0
    for d in pages:
        folder = out if len(pages) == 1 else out / d.name
        try:
            texts = files(d, host)
        except TargetError as error:
            print(f"softehl: {error}", file=sys.stderr)
            code = 2
            continue
        write(folder, texts)
        print(f"{len(texts)} files of target {host} in {folder}; try: make -C {folder} test")
    return code


def files(d: Definition, host: str) -> dict[str, str]:
    """Every file of a page for a host.  Raises `TargetError`, `NoStateError`."""
    page = Interface.of(d, host)
    return ELEMENTS[host](page, samples.admissible(page.definition, STATES))


def write(folder: Path, texts: Mapping[str, str]) -> None:
    """Write files; raises `ModelFileError` rather than replace one that softehl did not write."""
    for name in texts:
        path = folder / name
        if path.exists() and MARK not in path.read_text(encoding="utf-8", errors="replace"):
            raise ModelFileError(
                f"{path} is there, and softehl did not write it; give another --out"
            )
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        cache.write(folder / name, text.encode(), mode=0o644)
