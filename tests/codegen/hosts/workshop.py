"""Folders of hosts: written, made and asked."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.material import Law
from softehl.codegen.tools import host_files
from softehl.codegen.verify import random_states
from tests.codegen.workshop import compiled

_ERROR = re.compile(r"(\d\.\de[-+]\d\d)  (?:ok|FAILED)$", re.MULTILINE | re.IGNORECASE)


def folder(d: Definition | Law, host: str, place: Path) -> Path:
    """The folder of a page for a host."""
    host_files.write(place, _of_law(d, host) if isinstance(d, Law) else host_files.files(d, host))
    return place


@cache
def _of_law(law: Law, host: str) -> dict[str, str]:
    return host_files.files(law, host)


def made(place: Path, target: str = "test", **settings: str) -> subprocess.CompletedProcess[str]:
    """What `make` says in a folder, without optimisation (it is faster)."""
    flags = {"CFLAGS": "-O0 -Wno-psabi", "CXXFLAGS": "-O0", **settings}
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


def off_python(d: Definition, place: Path) -> float:
    """Largest difference of residual and tangent in libNAME.so from those of the Python kernel."""
    states = random_states.admissible_states(d, 3)
    X, u = (np.array([getattr(s, k) for s in states]) for k in ("coordinates", "dofs"))
    constants, points = (np.array([getattr(s, k) for s in states]) for k in ("data", "point_data"))
    p, n, size = np.array(states[0].parameters), len(u), len(d.unknowns)
    (place / "python").mkdir()
    kernel = compiled(d, place / "python")
    known = {"data": constants} if constants.size else {}
    known |= {"point_data": points} if points.size else {}
    expected = kernel.tangent(X, u, parameters=p, **known)
    found = np.empty((n, size)), np.empty((n, size, size))
    data = np.hstack([constants.reshape(n, -1), points.reshape(n, -1)])
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (X, u, data, p, *found)]
    library = ctypes.CDLL(str(place / f"lib{d.name}.so"))
    getattr(library, f"{d.name}_tangent")(ctypes.c_ssize_t(n), *pointers)
    pairs = zip(found, expected, strict=True)
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)
