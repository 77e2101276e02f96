"""`softehl kernels`: what the kernels cost (no SymPy needed)."""

from __future__ import annotations

import json

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Column, Table

from softehl.codegen.tools.build import GENERATED

_COSTS = ("operations", "operations_once", "operations_per_point", "temporaries", "peak_live")
_HEADS = ("ops", "once", "point", "temp", "live", "C bytes")
_MEANING = (
    "ops: operations of one element, of which once for the element and at each point of its rule; "
    "temp: temporaries of the C code, of which live at the same time."
)


def kernels() -> int:
    """Print the cost table of the manifest, readable at 80 columns; the exit code."""
    entries = json.loads((GENERATED / "manifest.json").read_text(encoding="utf-8"))["kernels"]
    heads = [Column(head, no_wrap=True, justify="right") for head in _HEADS]
    table = Table(Column("kernel, task", no_wrap=True), *heads, box=SIMPLE, padding=(0, 1, 0, 0))
    table.pad_edge = False
    for name, entry in entries.items():
        table.add_row(name, *[""] * len(_COSTS), str(entry["bytes"]))
        for task, cost in entry["tasks"].items():
            table.add_row(f"  {task}", *(str(cost[n]) for n in _COSTS))
    console = Console()
    console.print(table)
    console.print(_MEANING, highlight=False)
    return 0
