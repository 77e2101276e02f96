"""`softehl generate` and `softehl kernels`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Column, Table

from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.models import ALL
from softehl.codegen.tools import cache, product, targets
from softehl.codegen.tools import files as cli_files
from softehl.codegen.tools.build import GENERATED
from softehl.codegen.tools.trace import show as show_trace


def generate(
    models: Sequence[Path] = (),
    check: bool = False,
    trace: str | None = None,
    target: str = Target.SIMD,
    out: Path | None = None,
) -> int:
    """Regenerate `generated/`; with `check` write nothing and name what is stale (exit code 1).

    With `models` do the same for the files of a user, as `codegen.tools.files` says.
    Another `target` than simd is only written, into the folder `out`.
    """
    if target != Target.SIMD:
        if check or trace is not None:
            print(f"softehl: --check and --trace know target simd, not {target}", file=sys.stderr)
            return 2
        if models:
            return cli_files.write_target(models, Target(target), out)
        return targets.write((make() for make in ALL.values()), Target(target), out)
    if models:
        return cli_files.generate(models, out=out, check=check, trace=trace)
    if out is not None:
        print("softehl: --out needs a MODEL.py or a --target", file=sys.stderr)
        return 2
    if trace is not None:
        return _trace(trace)
    files = product.files(pipeline.compile_model(make()) for make in ALL.values())
    stale = [name for name, text in files.items() if _differs(GENERATED / name, text)]
    known = {*files, "__init__.py"}
    strange = [p.name for p in GENERATED.glob("*.[chj]*") if p.name not in known]
    if check:
        for name in stale + strange:
            print(f"stale: generated/{name}", file=sys.stderr)
        if stale or strange:
            print("mend it with: softehl generate", file=sys.stderr)
        return 1 if stale or strange else 0
    GENERATED.mkdir(exist_ok=True)
    for name in strange:
        (GENERATED / name).unlink()
    for name in stale:
        cache.write(GENERATED / name, files[name].encode())
    print(f"{len(files)} files in generated/, {len(stale)} of them new or changed")
    return 0


def _differs(path: Path, text: str) -> bool:
    return not path.exists() or path.read_text(encoding="utf-8") != text


def _trace(family: str) -> int:
    if family not in ALL:
        print(f"softehl: no model {family!r}; there are {', '.join(ALL)}", file=sys.stderr)
        return 2
    show_trace(ALL[family]())
    return 0


def kernels() -> int:
    """Print the cost table of the manifest."""
    entries = json.loads((GENERATED / "manifest.json").read_text())["kernels"]
    titles = ("task", "operations", "once", "per point", "temporaries", "live", "C bytes")
    table = Table(Column("kernel", no_wrap=True), *titles)
    for name, entry in entries.items():
        for task, cost in entry["tasks"].items():
            names = ("operations", "operations_once", "operations_per_point", "temporaries")
            row = [*(cost[n] for n in names), cost["peak_live"], entry["bytes"]]
            table.add_row(name, task, *map(str, row))
    Console().print(table)
    return 0
