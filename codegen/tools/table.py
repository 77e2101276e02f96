"""`softehl kernels`: what the kernels cost (no SymPy needed)."""

from __future__ import annotations

import json

from rich.console import Console
from rich.table import Column, Table

from softehl.codegen.tools.build import GENERATED


def kernels() -> int:
    """Print the cost table of the manifest; the exit code."""
    entries = json.loads((GENERATED / "manifest.json").read_text(encoding="utf-8"))["kernels"]
    titles = ("task", "operations", "once", "per point", "temporaries", "live", "C bytes")
    table = Table(Column("kernel", no_wrap=True), *titles)
    for name, entry in entries.items():
        for task, cost in entry["tasks"].items():
            names = ("operations", "operations_once", "operations_per_point", "temporaries")
            row = [*(cost[n] for n in names), cost["peak_live"], entry["bytes"]]
            table.add_row(name, task, *map(str, row))
    Console().print(table)
    return 0
