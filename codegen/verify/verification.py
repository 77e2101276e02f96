"""Compare compiled kernels with the page as written: what `softehl generate` reports.

The C is called through ctypes on a batch, so that full groups of lanes and the remainder are
both covered. It is compared with an evaluation of the page's own SymPy expressions in 90 digits,
which differentiates numerically (`reference_evaluator`) and shares nothing with the compiler, not
even the conversion to a graph. First at an ordinary state (`random_states`), row by row, then at
far and steered ones (`state_search`), until all are done or the time is over.

Errors are relative.  Residual and tangent: row i of R and of K w (one random direction w without
zeros reaches every column), over the sum of |K_ij w_j| of its row, or |R_i| if that is larger.
In elements of more than 8 unknowns every eighth row is added, with random factors: eight sums,
at one state; of the other states all rows are added, with random factors.
Derivatives by an argument: over the largest component.  Energy: over |Pi| or max |R| max |u|.
Each field: over its largest value at the points.  No scale is below 1e-6 of the largest of its
kind (1e-6 for fields), so that zeros may be rounded.

Far from the ordinary state a page may cancel so many digits that no evaluation in doubles is good
to 1e-10. There the page is evaluated once more with a rounding error in every operation
(`arithmetics.Rounded`), and the kernel may be off by `ROUNDINGS` times what this changes. A state
where it changes more than `LOST` of a value, or has no value in the range of doubles, says nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from time import perf_counter

from softehl.codegen import abi
from softehl.codegen.derive.task_outputs import outputs
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.language.definition import Definition
from softehl.codegen.verify import random_states
from softehl.codegen.verify.comparison import BOUND, Comparison, Report, idle
from softehl.codegen.verify.reference_evaluator import OutOfTimeError
from softehl.codegen.verify.state_search import StateSearch

__all__ = ["BOUND", "Report", "check", "culprit", "errors"]

BATCH = 5
"""Ordinary states, so that a group of lanes is full and some remain."""
SECONDS = 10.0
"""For the check of one kernel."""
SEARCH = 1 / 4
"""Part of these for the search of states."""


def errors(
    definition: Definition, tasks: Iterable[str], library: Path, written: Definition | None = None
) -> dict[str, float]:
    """Largest error of each task of one kernel; NoStateError if no admissible state is found."""
    return check(definition, tasks, library, written).errors


def check(
    definition: Definition,
    tasks: Iterable[str],
    library: Path,
    written: Definition | None = None,
    seconds: float = SECONDS,
) -> Report:
    """Compare one kernel with its page; NoStateError if no admissible state is found.

    The page is `written`, the same one with its names written out (`model_loader.written_out`), if
    there is one. If it gives a derivative of its own, only energy and fields can be compared.
    """
    start = perf_counter()
    tasks = [
        t for t in tasks if not definition.prescribed or t in (abi.Task.ENERGY, abi.Task.FIELDS)
    ]
    states = random_states.admissible(definition, BATCH)
    comparison = Comparison(definition, written or definition, library, start + seconds)
    report = comparison.report
    if any(comparison.batch(states).silent(t) for t in tasks):
        raise random_states.NoStateError(
            f"{definition.name} cannot be checked: its local iteration finds no solution at random "
            f"states; say where it does, e.g. m.example({random_states.suggestion(definition)})"
        )
    explorer = StateSearch(comparison.program, states)
    try:
        comparison.ordinary(states, tasks)
        for state in list(explorer.states(SEARCH * seconds)):
            comparison.far(state, states, tasks)
    except OutOfTimeError:
        report.late = True
    report.late = report.late or explorer.late
    report.unreal += explorer.unreal
    report.tasks = [t for t in tasks if t not in report.errors]
    report.missing += [explorer.text(t) for t in explorer.missing]
    report.missing += idle(comparison) if report.compared else []
    return report


def culprit(d: Definition, task: str) -> str | None:
    """Expression without a value in a task whose result is not a number, for the page's author."""
    gradients = gradient(
        d.graph, d.potential, d.directions, constant=d.constant, prescribed=d.prescribed
    )
    states = random_states.admissible(d, BATCH)
    for nodes in ([gradients[u] for u in d.directions], [x.node for x in outputs(d, task)]):
        for state in states:
            fault = random_states.first_fault(nodes, state)
            if fault is not None:
                return fault
    return None
