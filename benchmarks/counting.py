"""Count the operations of a candidate: its C runs once on numbers that count."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np

from benchmarks.candidate import Candidate
from benchmarks.compiling import run
from benchmarks.deriving import TimeLimitError
from benchmarks.problem import Elements
from softehl.runtime.arrays import Array

HEADER = Path(__file__).resolve().with_name("counted.hpp")
FLAGS = ("-std=gnu++20", "-O0", "-w", "-fpermissive")

MAIN = """#include "{header}"
{sources}
{tables}
int main()
{{
    static Counted values[8], tangent[64];
    counted_operations = 0;
    bench_entry(1, X_, u_, p_, values, tangent);
    std::printf("%lld\\n", counted_operations);
}}
"""


def count(candidate: Candidate, folder: Path, given: Elements, limit: float = 120.0) -> int | None:
    """Operations of the first element (None: no C++ compiler, or not within `limit` seconds).

    The count is that of the text, before the optimiser removes or repeats anything.  The
    program is written into `folder`, where the headers of the candidate are.
    """
    if shutil.which("c++") is None:
        return None
    sources = "\n".join(
        re.sub(r"\brestrict\b", "", text)  # a word of C alone
        for name, text in sorted(candidate.files.items())
        if name.endswith(".c")
    )
    X, u = candidate.layout.pack(given)
    tables = "\n".join(
        f"static const Counted {name}[] = {{{_numbers(row)}}};"
        for name, row in (("X_", X[0]), ("u_", u[0]), ("p_", given.parameters))
    )
    main, program = folder / "count.cpp", folder / "count"
    main.write_text(MAIN.format(header=HEADER, sources=sources, tables=tables), encoding="utf-8")
    includes = [f"-I{path}" for path in candidate.include]
    try:
        run(["c++", *FLAGS, *includes, str(main), "-o", str(program)], limit)
        return int(run([str(program)], limit))
    except TimeLimitError:
        return None


def _numbers(row: Array) -> str:
    return ", ".join(repr(float(v)) for v in np.ravel(row))
