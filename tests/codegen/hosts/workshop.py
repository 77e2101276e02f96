"""Folders of hosts: written, made and asked."""

from __future__ import annotations

import os
import re
import subprocess
from functools import cache
from pathlib import Path

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.material import Law
from softehl.codegen.tools import hosts

_ERROR = re.compile(r"(\d\.\de[-+]\d\d)  (?:ok|FAILED)$", re.MULTILINE | re.IGNORECASE)


def folder(d: Definition | Law, host: str, place: Path) -> Path:
    """The folder of a page for a host."""
    hosts.write(place, _of_law(d, host) if isinstance(d, Law) else hosts.files(d, host))
    return place


@cache
def _of_law(law: Law, host: str) -> dict[str, str]:
    return hosts.files(law, host)


def made(place: Path, target: str = "test", **settings: str) -> subprocess.CompletedProcess[str]:
    """What `make` says in a folder, with little optimisation (it is faster)."""
    flags = {"CFLAGS": "-O1 -Wno-psabi", "CXXFLAGS": "-O1", **settings}
    words = [f"{k}={v}" for k, v in flags.items()]
    return subprocess.run(
        ["make", "-s", target, *words],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def errors(printed: str) -> list[float]:
    """The errors that a test printed, in its order."""
    return [float(m[1]) for m in _ERROR.finditer(printed)]
