"""`python -m benchmarks.kernels`: our element kernels next to FFCx's and CasADi's.

benchmarks/README.md says what is measured and how to read it.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console

from benchmarks import report
from benchmarks.compiling import COMMON_FLAGS, compilers
from benchmarks.measure import Measured, Settings, measure
from benchmarks.problem import Case
from benchmarks.routes import GENERATORS, Generator
from benchmarks.timing import Driver

WIDTH = 148
BUSY = 0.5
"""Load above which a neighbour shares the core's caches and pipes with us."""


@click.command()
@click.option("--quick", is_flag=True, help="Few samples, one compiler, common flags only.")
@click.option(
    "--all-routes", is_flag=True, help="Run and print every route, also those that never win."
)
@click.option(
    "--case",
    "names",
    multiple=True,
    type=click.Choice([c.name.lower() for c in Case]),
    help="Only this case; may be repeated.",
)
@click.option("--rounds", type=click.IntRange(1), help="Samples of each kernel [101, quick 31].")
@click.option(
    "--limit",
    type=click.FloatRange(1.0),
    default=120.0,
    show_default=True,
    help="Seconds that one derivation or one compilation may take.",
)
@click.option(
    "--json", "target", type=click.Path(dir_okay=False, path_type=Path), help="Also write a file."
)
def main(
    quick: bool,
    all_routes: bool,
    names: tuple[str, ...],
    rounds: int | None,
    limit: float,
    target: Path | None,
) -> None:
    """Derive, compile, verify and time one element kernel of each generator, in one run."""
    console, errors = Console(), Console(stderr=True)
    console.width = max(console.width, WIDTH)
    generators = _installed(errors)
    found = compilers(all_found=not quick)
    rounds = rounds or (31 if quick else 101)
    console.print(f"compilers: {'; '.join(c.version for c in found)}")
    busy = os.getloadavg()[0]
    if busy > BUSY:
        errors.print(f"the machine is busy (load {busy:.1f}): times and ratios will be off")
    console.print(f"common flags: {' '.join(COMMON_FLAGS)}; medians of {rounds} samples")
    measured: dict[str, Measured] = {}
    with tempfile.TemporaryDirectory() as scratch, errors.status("") as status:
        settings = Settings(found, rounds, not quick, all_routes, limit, status.update)
        driver = Driver(Path(scratch), found[0])
        for case in (c for c in Case if not names or c.name.lower() in names):
            m = measure(case, generators, driver, Path(scratch), settings)
            measured[case.title] = m
            rows = m.rows if all_routes else report.fastest(m.rows)
            console.print(report.table(case.title, rows, m.peak))
    peaks = {title: m.peak for title, m in measured.items()}
    console.print(report.best_table([b for m in measured.values() for b in m.best], peaks))
    if target is not None:
        report.write_json(target, measured, rounds)


def _installed(errors: Console) -> Sequence[Generator]:
    for generator in GENERATORS:
        if not generator.installed:
            errors.print(f"{generator.title} is not installed: left out (extra `benchmarks`)")
    return [g for g in GENERATORS if g.installed]


if __name__ == "__main__":
    main()
