"""`softehl generate --trace KERNEL`: what every stage of the compiler did to every task."""

from __future__ import annotations

from collections.abc import Iterator

from rich import box
from rich.console import Console
from rich.table import Table

from softehl.codegen import pipeline
from softehl.codegen.derive.potential_structure import PotentialStructure
from softehl.codegen.derive.task_outputs import tasks
from softehl.codegen.emit.liveness import peak_live
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition
from softehl.codegen.pipeline import Function


def show(definition: Definition) -> None:
    """Print all stages of all kernels of a model."""
    console = Console()
    page = len(reachable([definition.potential, *(n for _, n in definition.fields)]))
    console.print(f"page: a graph of {page} nodes; tasks: {', '.join(tasks(definition))}")
    if definition.point is not None:
        form = pipeline.form(definition)
        console.print(f"form: {'at points' if form.at_points else 'whole element'}: {form.why}")
    for task, function in pipeline.compile_model(definition).functions.items():
        console.rule(f"{definition.name} {task}", align="left")
        stages = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
        stages.add_column(no_wrap=True)
        for title, text in _stages(definition, function):
            stages.add_row(title, text)
        console.print(stages)
        console.print(_passes(function))


def _stages(d: Definition, f: Function) -> Iterator[tuple[str, str]]:
    yield "interfaces", _interfaces(d, f.structure)
    yield "invariants", _invariants(f.structure)
    for k, a in enumerate(f.attempts, 1):
        how = ", loop over the points written out" if a.unrolled else ""
        yield f"chain rule {k}", f"{a.rule}{how}: {a.operations} operations of one element"
    if len(f.attempts) > 1:
        yield "choice", f"chain rule {f.attempts.index(f.best) + 1}"
    plan = f.plan
    loops = sum(title.loop is not None for title in plan.stages)
    per_point = f", {plan.operations_per_point} at each point" if loops else ""
    yield "schedule", f"{plan.operations_once} operations once{per_point}; {_count(loops, 'loop')}"
    scheduled, after = peak_live(f.best.plan), peak_live(plan)
    moved = f"{scheduled} values live at most, {after} in the printed order"
    yield "order", moved if plan is not f.best.plan else f"as scheduled, {after} values live"
    yield "print", f"{f.printer}: {f.temporaries} temporaries, {f.text.count(chr(10))} lines of C"


def _interfaces(d: Definition, s: PotentialStructure | None) -> str:
    if s is None:
        return f"none found; the page names {len(d.interface)}"
    modes, forms = len(s.interface.modes), len(s.forms)
    point = f"{len(s.interface.point)} values at a point, " if s.interface.point else ""
    return f"{len(d.directions)} unknowns, {modes} modal coordinates, {point}{forms} linear forms"


def _invariants(s: PotentialStructure | None) -> str:
    if s is None or not s.squares:
        return "none found"
    return f"{len(s.squares)} {'invariants' if s.invariants else 'quadratic values of the page'}"


def _count(n: int, thing: str) -> str:
    return f"{n or 'no'} {thing}{'' if n == 1 else 's'}"


def _passes(f: Function) -> Table:
    """Nodes and operations that each pass left, for each chain rule with the passes of the chosen.

    The loop over the points, written out or not, decides which passes there are.
    """
    table = Table("pass", box=box.SIMPLE_HEAD)
    rules = [a for a in f.attempts if a.unrolled is f.best.unrolled]
    for k, a in ((k, a) for k, a in enumerate(f.attempts, 1) if a in rules):
        label = f"rule {k}{'*' if a is f.best else ''}" if len(rules) > 1 else ""
        table.add_column(f"{label} nodes".strip(), justify="right")
        table.add_column("operations", justify="right")
    for rows in zip(*(a.passes for a in rules), strict=True):
        cells = [str(v) for row in rows for v in (row.nodes, row.operations)]
        table.add_row(rows[0].name, *cells)
    return table
