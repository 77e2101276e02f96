"""The function of a point: fluxes, moduli or other values from fields and gradients, in lanes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.derive.output_entries import OutputEntry
from softehl.codegen.derive.point_outputs import RATES
from softehl.codegen.emit.code_motion import If, Same, Schedule, Statement
from softehl.codegen.emit.points.point_layout import Needs, PointLayout
from softehl.codegen.emit.simd_printer import LanePrinter
from softehl.codegen.graph.graph import FREE, Node

ARRAYS = {"coordinates": "x", "dofs": "g", "data": "e", "point data": "b", "direction": "t"}
"""Arguments of the function by arrays of the graph."""
_NAMES = {"coordinates": "X", "dofs": "d", "data": "a", "point data": "b", "direction": "t"}


@dataclass(frozen=True, eq=False)
class PointOutputs:
    """Outputs of a task and their indices in the arrays P and A of the function.

    moduli: number in A by row and column, of those that are not zero; of symmetric ones the upper
    triangle alone. square: whether rows and columns are the same quantities.
    """

    entries: Sequence[OutputEntry]
    square: bool = True

    @cached_property
    def symmetric(self) -> bool:
        """True if every modulus and its mirror are one and the same value."""
        if not self.square:
            return False
        pairs = ((x.row, x.column, x.node) for x in self.entries if x.column is not None)
        nodes = {(i.position, j.position): n for i, j, n in pairs}
        return all(nodes.get((j, i)) is n for (i, j), n in nodes.items())

    @property
    def rows(self) -> list[OutputEntry]:
        """The outputs in P."""
        return [x for x in self.entries if x.column is None and x.row.position < RATES]

    @property
    def rates(self) -> list[OutputEntry]:
        """Rates of fluxes, in A."""
        return [x for x in self.entries if x.column is None and x.row.position >= RATES]

    @property
    def moduli(self) -> dict[tuple[int, int], Node]:
        """Moduli by row and column, in the order of A."""
        numbers = {}
        for x in self.entries:
            if x.column is not None and not _is_zero(x.node):
                i, j = x.row.position, x.column.position
                if i <= j or not self.symmetric:
                    numbers[i, j] = x.node
        return numbers

    def targets(self) -> list[tuple[str, Node]]:
        """Every output with the variable that takes it."""
        out = [(f"P[{x.row.position}]", x.node) for x in self.rows]
        out += [(f"A[{x.row.position - RATES}]", x.node) for x in self.rates]
        return out + [(f"A[{k}]", n) for k, n in enumerate(self.moduli.values())]


def _is_zero(n: Node) -> bool:
    return n.op == "const" and n.value == 0


def name(layout: PointLayout, task: str) -> str:
    """Name of the function."""
    return f"{abi.function_name(layout.d.name, task)}_{layout.place_of_points}"


def text(layout: PointLayout, task: str, outputs: PointOutputs, plan: Schedule) -> tuple[str, int]:
    """C text of the function and the number of its temporaries.

    It returns the lanes in which a local iteration has failed.
    """
    p = LanePrinter(layout.site)
    needs = Needs.of(outputs.entries)
    p.line(1, f"{' '.join(f'(void){n};' for n in ('parameters', *ARRAYS.values(), 'P', 'A'))}")
    if layout.site.term_history:
        p.line(1, "(void)terms;")
    p.line(1, "M failed = softehl_mask(0);")
    for array, argument in ARRAYS.items():
        for k in needs[array]:
            p.line(1, f"const V {_NAMES[array]}{k} = {argument}[{k}];")
    written = [n for _, n in outputs.targets()]
    p.read(plan, written, written)
    _statements(p, outputs.targets(), [s for group in plan.stages for s in group.preamble])
    p.line(1, "return failed;")
    arguments = ", ".join(f"const V *restrict {a}" for a in ARRAYS.values())
    terms = "const softehl_terms *terms, " if layout.site.term_history else ""
    head = (
        f"static M {name(layout, task)}(\n    const double *restrict parameters, {terms}"
        f"{arguments},\n"
        "    V *restrict P, V *restrict A)"
    )
    return "\n".join([head, "{", p.text(), "}", ""]), p.temporaries


def _statements(
    p: LanePrinter, targets: Iterable[tuple[str, Node]], statements: Iterable[Statement]
) -> None:
    """Print statements in their order; each output is stored as soon as it is computed."""
    waiting: dict[Node, list[str]] = {}
    for target, n in targets:
        waiting.setdefault(n, []).append(target)

    def store(nodes: Iterable[Node]) -> None:
        for n in nodes:
            for target in waiting.pop(n, []):
                p.line(1, f"{target} = {p.value(n)};")

    store([n for n in waiting if n.op in FREE])
    for s in statements:
        p.block(1, [s])
        store(s.merged if isinstance(s, If) else [s.old if isinstance(s, Same) else s])


def used(task: str) -> bool:
    """True for a task with fluxes, which are spread over the nodes."""
    return task not in (Task.ENERGY, *abi.AT_POINTS)
