"""The published budget of every shipped kernel, `budget.json`: no cost may rise above it.

`python -m tests.codegen.budget` writes the costs of `generated/manifest.json` as the new budget;
a commit that raises a number says why.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softehl.runtime.kernels.shared_library import GENERATED

PATH = Path(__file__).with_name("budget.json")
REMEDY = "if the rise is meant: python -m tests.codegen.budget"
COSTS = ("operations", "temporaries", "peak_live")
LARGEST_FILE = 140_000
"""Bytes of C of one family; the largest, a conserving film of Carreau oil, has two iterations."""

Budget = dict[str, int]


def costs(kernels: Mapping[str, Any]) -> Budget:
    """Every cost of a manifest under one flat name, e.g. `solid_q4 tangent operations`."""
    out: Budget = {}
    for name, entry in kernels.items():
        out[f"{name} bytes"] = entry["bytes"]
        out[f"{name} design_bytes"] = entry["design_bytes"]
        for task, cost in entry["tasks"].items():
            out.update({f"{name} {task} {c}": cost[c] for c in COSTS})
    return out


def excess(found: Budget, allowed: Budget) -> list[str]:
    """What rose above the budget or has none, in words."""
    return [
        f"{key}: {value}, budget {allowed.get(key, 'missing')}"
        for key, value in found.items()
        if value > allowed.get(key, -1)
    ]


def shipped() -> Budget:
    """Costs that the manifest of `generated/` publishes."""
    return costs(json.loads((GENERATED / "manifest.json").read_text(encoding="utf-8"))["kernels"])


def published() -> Budget:
    """The checked-in budget."""
    allowed: Budget = json.loads(PATH.read_text(encoding="utf-8"))
    return allowed


if __name__ == "__main__":
    PATH.write_text(json.dumps(shipped(), indent=1) + "\n", encoding="utf-8")
    print(f"wrote {PATH}")
