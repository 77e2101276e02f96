"""The whole compiler on one screen: every stage from a model page to C, in order.

    page        SymPy expressions become a graph of exact numbers (`language`)
    tasks       what the kernel family computes: energy, residual, tangent, ...
    interfaces  the few linear forms through which the potential sees its unknowns
    invariants  the fewest quadratic values of these forms of which the energy is a function
    chain rule  the outputs of a task, differentiated in every way that may be the cheapest
    passes      rewrites of each way that keep its values and lower its cost (`optimise`)
    schedule    what is computed once, what at each point, what inside a branch
    choice      of all ways the one with fewest operations
    order       straight-line code in the order of a small register file
    print       one value, one line of C: element by element, or several at once
    routines    local iterations and functions of stretches as C functions of their own

`softehl generate --trace KERNEL` shows what each of them did.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import ModuleType

from softehl.codegen.abi import AT_POINTS, DESIGN, ROLLED, Target
from softehl.codegen.derive import structure, variants
from softehl.codegen.derive.outputs import Entry, placed
from softehl.codegen.derive.structure import Structure
from softehl.codegen.derive.variants import Variant
from softehl.codegen.emit import c as emit_c
from softehl.codegen.emit import routines as emit_routines
from softehl.codegen.emit import simd as emit_simd
from softehl.codegen.emit import source as emit_source
from softehl.codegen.emit import ufcx as emit_ufcx
from softehl.codegen.emit.order import arranged
from softehl.codegen.emit.schedule import Schedule, schedule, straight_line
from softehl.codegen.graph.graph import Routine
from softehl.codegen.language.definition import Definition
from softehl.codegen.optimise import passes


@dataclass(frozen=True)
class Attempt:
    """One chain rule to its end: what each pass left, the plan, operations of one element."""

    rule: str
    entries: list[Entry]
    passes: list[passes.TraceRow]
    plan: Schedule
    operations: int


@dataclass(frozen=True)
class Function:
    """One kernel: its C text and how it came about.

    `found` is what was found in the potential (None: nothing, or the task differentiates nothing);
    of the `attempts` one was `chosen`; `plan` is its schedule in the printed order.
    """

    text: str
    plan: Schedule
    temporaries: int
    found: Structure | None
    attempts: tuple[Attempt, ...]
    chosen: Attempt
    printer: str
    routines: tuple[Routine, ...] = ()


@dataclass(frozen=True)
class KernelSource:
    """A kernel family: its model, its C file and its functions by task.

    design: a second C file with the tasks of sensitivities, empty where none is offered.
    """

    definition: Definition
    text: str
    functions: Mapping[str, Function]
    design: str = ""


def compile_model(definition: Definition, target: Target = Target.SIMD) -> KernelSource:
    """All kernels of one model; `codegen.abi` says what each target is."""
    tasks = variants.tasks(definition)
    if target is Target.UFCX:
        tasks = emit_ufcx.tasks(definition, tasks)
    functions = {t: compile_task(definition, t, target) for t in tasks}
    if target is Target.UFCX:
        texts = [f.text for f in functions.values()]
        return KernelSource(definition, emit_ufcx.source(definition, texts), functions)
    design = [f for t, f in functions.items() if t in DESIGN]
    others = [f for t, f in functions.items() if t not in DESIGN]
    text, more = _file(definition, others), _file(definition, design) if design else ""
    return KernelSource(definition, text, functions, more)


def _file(definition: Definition, functions: Sequence[Function]) -> str:
    """The C file of some functions, with what they call."""
    texts = [f.text for f in functions]
    called = dict.fromkeys(r for f in functions for r in f.routines)
    before = emit_routines.texts(definition, called) + emit_simd.wrappers("".join(texts))
    return emit_source.source(definition, texts, before)


def compile_task(d: Definition, task: str, target: Target = Target.SIMD) -> Function:
    """One kernel, all stages in the order of this file's first lines."""
    forms = structure.linear_forms(d) if variants.differentiated(task) else None
    found = None if forms is None else structure.quadratic_values(d, forms)
    rewrites = _passes(d, task)
    ways = (_for_target(v, task, target) for v in variants.variants(d, task, found))
    attempts = tuple(_attempt(d, way, rewrites) for way in ways)
    chosen = min(attempts, key=lambda a: a.operations)
    entries, plan = chosen.entries, chosen.plan
    printer = _printer(target, task, plan)
    if printer is emit_simd:
        roots, order = arranged(d.graph, [x.node for x in entries])
        entries, plan = placed(entries, roots), straight_line(order)
    text, temporaries = printer.function(d, task, entries, plan)
    called = tuple(emit_routines.called([x.node for x in entries]))
    name = printer.__name__.rpartition(".")[2]
    return Function(text, plan, temporaries, found, attempts, chosen, name, called)


def _passes(d: Definition, task: str) -> Sequence[passes.Pass]:
    """The loop over the points is written out where the model says so and the task allows it."""
    if not d.unroll or task in ROLLED:
        return passes.STANDARD
    return passes.straight_line(_points(d), (len(d.data), len(d.point_data)))


def _for_target(v: Variant, task: str, target: Target) -> Variant:
    return Variant(v.rule, emit_ufcx.chosen(v.entries, task)) if target is Target.UFCX else v


def _attempt(d: Definition, way: Variant, rewrites: Sequence[passes.Pass]) -> Attempt:
    roots, trace = passes.run(d.graph, [x.node for x in way.entries], rewrites)
    plan = schedule(roots)
    work = plan.operations_once + len(d.rule.points) * plan.operations_per_point
    return Attempt(way.rule, placed(way.entries, roots), trace, plan, work)


def _printer(target: Target, task: str, plan: Schedule) -> ModuleType:
    """Several elements at once where wanted and fit; fields are stored point by point."""
    if target is Target.UFCX:
        return emit_ufcx
    at_once = target is Target.SIMD and task not in AT_POINTS and emit_simd.suits(plan)
    return emit_simd if at_once else emit_c


def _points(definition: Definition) -> list[list[Fraction]]:
    """Rows (coordinates..., weight) of the model's rule, to 60 digits."""
    scale = 10**60
    rows = zip(definition.rule.points, definition.rule.weights, strict=True)
    return [[Fraction(int(x.evalf(70) * scale), scale) for x in (*p, w)] for p, w in rows]
