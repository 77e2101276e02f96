"""The whole compiler on one screen: every stage from a model to C, in order.

    model       SymPy expressions become a graph of exact numbers (`language`)
    tasks       what the kernel family computes: energy, residual, tangent, ...
    interfaces  the few linear forms through which the potential sees its unknowns
    invariants  the fewest quadratic values of these forms of which the energy is a function
    chain rule  the outputs of a task, differentiated in every way that may be the cheapest
    passes      rewrites of each way that keep its values and lower its cost (`optimise`), with
                the loop over the points written out where it is short
    schedule    what is computed once, what at each point, what inside a branch
    choice      of all ways the one with fewest operations
    order       straight pieces in the order of a small register file
    print       C, with a name for each value that is used again, for several elements at once; one
                at a time is the same text with one lane
    routines    local iterations and functions of stretches as C functions of their own

A weak form on a large cell goes another way (`form`): all of this for the function of a point
alone, and loops over points and nodes around it (`emit.points`).

`softehl generate --trace KERNEL` shows what each of them did.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from softehl.codegen import external_function
from softehl.codegen.abi import DESIGN, ROLLED, Target, TargetError, Task, derivative_task
from softehl.codegen.derive import (
    point_outputs,
    point_products,
    potential_structure,
    task_outputs,
)
from softehl.codegen.derive.output_entries import OutputEntry, replace_values
from softehl.codegen.derive.potential_structure import PotentialStructure
from softehl.codegen.derive.task_outputs import Variant
from softehl.codegen.emit import (
    c_printer,
    c_routines,
    c_source,
    product_loops,
    simd_kernel,
    simd_printer,
    simd_routines,
    ufcx,
)
from softehl.codegen.emit.code_motion import Schedule, is_straight, schedule, straight_line
from softehl.codegen.emit.device import kernels as device
from softehl.codegen.emit.device.kernels import DeviceKernels
from softehl.codegen.emit.instruction_scheduling import order_instructions, order_plan
from softehl.codegen.emit.points import (
    cell_constants,
    coarse_tangent,
    point_kernel,
    sum_factored_product,
)
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_kernel import Choice, choose
from softehl.codegen.emit.points.point_layout import Needs, PointLayout
from softehl.codegen.graph.graph import Routine
from softehl.codegen.graph.traversal import operations
from softehl.codegen.language.definition import Definition, functions_of_user
from softehl.codegen.optimise import passes

SHORT = 3000
"""Operations of one element up to which writing the loop over its points out is tried."""


@dataclass(frozen=True)
class Attempt:
    """One chain rule to its end: what each pass left, the plan, operations of one element.

    `unrolled` is True where the loop over the points is written out.
    """

    rule: str
    unrolled: bool
    entries: list[OutputEntry]
    passes: list[passes.TraceRow]
    plan: Schedule
    operations: int


@dataclass(frozen=True)
class Function:
    """One kernel: its C text and how it came about.

    structure: that of the potential (None: none, or the task differentiates nothing). attempts:
    all chain rules that were tried. best: the one with fewest operations. plan: its schedule in the
    printed order. shared: names and texts of files that other kernels may have, too.
    """

    text: str
    plan: Schedule
    temporaries: int
    structure: PotentialStructure | None
    attempts: tuple[Attempt, ...]
    best: Attempt
    printer: str
    routines: tuple[Routine, ...] = ()
    shared: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class KernelSource:
    """A kernel family: its model, its C file and its functions by task.

    design: a second C file with the tasks of sensitivities, empty where none is offered, or where
    they call the same routines as the others. shared:
    files that other families may have, too, by name. cached: numbers that products by sum
    factorisation keep at a point, 0 where there are none. coarse: unknowns of the cell of the
    next lower order, of which there is a tangent beside these products.
    """

    definition: Definition
    text: str
    functions: Mapping[str, Function]
    design: str = ""
    shared: Mapping[str, str] = field(default_factory=dict)
    cached: int = 0
    coarse: int = 0


def compile_model(definition: Definition, target: Target = Target.SIMD) -> KernelSource:
    """Compile all kernels of one model; `codegen.abi` describes the targets."""
    if target is Target.UFCX and definition.term_history:
        raise TargetError(
            f"{definition.name} has history of each term, {definition.term_history[0].name}: "
            "target ufcx has no place for it, use simd"
        )
    made = _compiled(definition, target)
    sources = {
        f"{f.symbol}.c": f.source() for f in functions_of_user(definition).values() if f.text
    }
    if target is Target.UFCX:  # a file holds all that it calls
        return replace(
            made, text=external_function.static("\n".join([*sources.values(), made.text]))
        )
    return replace(made, shared={**made.shared, **sources})


def _compiled(definition: Definition, target: Target) -> KernelSource:
    tasks = task_outputs.tasks(definition)
    if target is Target.UFCX:
        tasks = ufcx.tasks(definition, tasks)
    if target is Target.SIMD:
        choice, tangent = _form(definition)
        if choice.at_points:
            return _with_action(_at_points(definition, tasks, tangent))
    functions = {t: compile_task(definition, t, target) for t in tasks}
    if target is Target.UFCX:
        texts = [f.text for f in functions.values()]
        used = dict.fromkeys(r for f in functions.values() for r in f.routines)
        preamble = c_routines.texts(definition, used)
        return KernelSource(definition, ufcx.source(definition, texts, preamble), functions)
    design = [f for t, f in functions.items() if t in DESIGN]
    others = [f for t, f in functions.items() if t not in DESIGN]
    if {r for f in others for r in f.routines} & {r for f in design for r in f.routines}:
        others, design = others + design, []  # no routine is written twice
    single = target is Target.SCALAR
    text = _file(definition, others, single=single)
    more = _file(definition, design, single=single) if design else ""
    made = KernelSource(definition, text, functions, more)
    return _with_action(made) if target is Target.SIMD else made


def _with_action(made: KernelSource) -> KernelSource:
    """Add a file for products by sum factorisation where the model offers products on such cells.

    See `emit.points.sum_factored_product`.
    """
    d = made.definition
    if d.point is None or Task.PRODUCT not in made.functions:
        return made
    layout = PointLayout(d, d.point)
    if not sum_factored_product.fits(layout):
        return made
    outputs, plan, called = _ordered(layout, Task.PRODUCT)
    action = sum_factored_product.Factored(layout, outputs, plan)
    moduli, moduli_plan, also = _ordered(layout, Task.TANGENT, _moduli_alone(layout.site))
    names = action.cache.names
    lower = coarse_tangent.CoarseTangent(layout, moduli, moduli_plan, names)
    coarse = lower.text()
    preamble = simd_routines.texts(layout.site, dict.fromkeys([*called, *also]))
    text = action.text(preamble, coarse)
    text = action.text([*simd_printer.wrappers(text), *preamble], coarse)
    shared = {**made.shared, f"{d.name}_action.c": text}
    return replace(made, shared=shared, cached=len(names), coarse=lower.size)


def device_kernels(d: Definition) -> DeviceKernels:
    """Kernels of a page of fields for a device.  Raises TargetError for a page without."""
    if d.point is None:
        raise TargetError(f"{d.name} is no page of fields: a device has kernels of such pages only")
    layout = PointLayout(d, d.point)
    device.require(layout)
    tasks = (Task.RESIDUAL, Task.PRODUCT, Task.TANGENT)
    return DeviceKernels(layout, {task: _ordered(layout, task) for task in tasks})


def form(d: Definition) -> Choice:
    """Form of the kernels of a model: whole elements, or loops around functions of a point."""
    return _form(d)[0]


def _form(d: Definition) -> tuple[Choice, Attempt | None]:
    """The form, and the tangent at a point by which it was chosen."""
    if d.point is None:
        return Choice(False, "no page of fields"), None
    site = d.point.definition
    unsupported = [
        t for t, _ in d.derivatives if point_outputs.argument(site, derivative_task(t)) is None
    ]
    if unsupported:
        why = f"a derivative by {unsupported[0]}, which a point does not know"
        return Choice(False, why), None
    attempt = _moduli(site, Task.TANGENT)
    outputs = PointOutputs(attempt.entries)
    return choose(PointLayout(d, d.point), outputs, attempt.operations, SHORT), attempt


def _moduli(site: Definition, task: str) -> Attempt:
    """Outputs of a task at a point."""
    return _attempt(site, Variant("at a point", point_outputs.outputs(site, task)), unrolled=True)


def _moduli_alone(site: Definition) -> Attempt:
    """Moduli at a point without the fluxes."""
    entries = [x for x in point_outputs.outputs(site, Task.TANGENT) if x.column is not None]
    return _attempt(site, Variant("moduli at a point", entries), unrolled=True)


def _at_points(d: Definition, tasks: Sequence[str], tangent: Attempt | None) -> KernelSource:
    """All kernels of a weak form, as loops around functions of the point."""
    assert d.point is not None
    layout = PointLayout(d, d.point)
    functions = {t: _at_point(layout, t, tangent if t == Task.TANGENT else None) for t in tasks}
    files = []
    for some in ([t for t in tasks if t not in DESIGN], [t for t in tasks if t in DESIGN]):
        texts = [functions[t].text for t in some]
        called = dict.fromkeys(r for t in some for r in functions[t].routines)
        routines = simd_routines.texts(layout.site, called)
        preamble = [*_types(d), *simd_printer.wrappers("".join([*routines, *texts]))]
        layouts = [layout, *([layout.at_centroid()] if layout.form.centroid else [])]
        tables = [cell_constants.used(each, "".join(texts)) for each in layouts]
        preamble += [*routines, *dict.fromkeys(table for some in tables for table in some)]
        files.append(c_source.source(d, texts, preamble) if texts else "")
    shared = dict(pair for f in functions.values() for pair in f.shared)
    return KernelSource(d, files[0], functions, files[1], shared)


def _at_point(layout: PointLayout, task: str, attempt: Attempt | None) -> Function:
    """One kernel of a weak form: the function of a point and the loops of the cell.

    attempt: its outputs at a point, where they are known.
    """
    attempt = attempt or _moduli(layout.site, task)
    outputs, plan, called = _ordered(layout, task, attempt)
    made = point_kernel.kernel(
        layout, task, point_kernel.At(outputs, plan), _at_centroid(layout, task, outputs)
    )
    shared = () if made.shared is None else (made.shared,)
    return Function(
        made.text, plan, made.temporaries, None, (attempt,), attempt, "points", called, shared
    )


def _at_centroid(layout: PointLayout, task: str, point: PointOutputs) -> point_kernel.At | None:
    """Values at the centroid that the function of a point reads, None if it reads none."""
    form, needs = layout.form, Needs.of(point.entries)
    first = point_outputs.first_rate(form.definition, task)
    read = {*needs["dofs"], *(k - first for k in needs["direction"])}
    if not read.intersection(form.centroid):
        return None
    variant = Variant("at the centroid", point_outputs.at_centroid(form, task))
    attempt = _attempt(layout.site, variant, unrolled=True)
    outputs, plan, _ = _ordered(layout, task, attempt)
    return point_kernel.At(PointOutputs(outputs.entries, square=False), plan)


def _ordered(
    layout: PointLayout, task: str, attempt: Attempt | None = None
) -> tuple[PointOutputs, Schedule, tuple[Routine, ...]]:
    """Outputs of a task at a point, statements in the printed order, and routines they call."""
    site = layout.site
    attempt = attempt or _moduli(site, task)
    entries, plan = attempt.entries, attempt.plan
    called = tuple(c_routines.called([x.node for x in entries]))
    if is_straight(plan):
        roots, order = order_instructions(site.graph, [x.node for x in entries])
        entries, plan = replace_values(entries, roots), straight_line(order)
    else:
        plan = order_plan(site.graph, plan, [x.node for x in entries])
    return PointOutputs(entries), plan, called


def _file(d: Definition, functions: Sequence[Function], *, single: bool) -> str:
    """The C file of some functions, with the routines that they call. single: with one lane."""
    routines = simd_routines.texts(d, dict.fromkeys(r for f in functions for r in f.routines))
    called = "".join([*routines, *(f.text for f in functions)])
    preamble = [*_types(d), *simd_printer.wrappers(called), *routines]
    return c_source.source(d, [f.text for f in functions], preamble, single=single)


def _types(d: Definition) -> list[str]:
    """Types of C that routines of a model need."""
    return [c_printer.TERMS] if d.term_history else []


def compile_task(d: Definition, task: str, target: Target = Target.SIMD) -> Function:
    """One kernel, all stages in the order of this file's first lines."""
    forms = potential_structure.linear_forms(d) if task_outputs.is_differentiated(task) else None
    structure = None if forms is None else potential_structure.quadratic_values(d, forms)
    attempts = _by_products(d, task, structure) if target is not Target.UFCX else ()
    if not attempts:
        variants = task_outputs.variants(d, task, structure)
        alternatives = [_for_target(v, task, target) for v in variants]
        attempts = tuple(_attempts(d, task, alternatives))
    best = min(attempts, key=lambda a: a.operations)
    entries, plan = best.entries, best.plan
    called = tuple(c_routines.called([x.node for x in entries]))
    self_contained = target is Target.UFCX
    if not self_contained and is_straight(plan):
        roots, order = order_instructions(d.graph, [x.node for x in entries])
        entries, plan = replace_values(entries, roots), straight_line(order)
    elif not self_contained:
        plan = order_plan(d.graph, plan, [x.node for x in entries])
    write = ufcx.function if self_contained else simd_kernel.function
    text, temporaries = write(d, task, entries, plan)
    name = "ufcx" if self_contained else "simd"
    return Function(text, plan, temporaries, structure, attempts, best, name, called)


def _attempts(d: Definition, task: str, alternatives: Sequence[Variant]) -> Iterator[Attempt]:
    """Every way with a loop over the points; of short ones also with the loop written out.

    A model may have decided (`Definition.unroll`), or the task does.  A loop over shape functions
    stands inside the one over the points, which stays.
    """
    fixed = False if task in ROLLED or d.interpolated or d.term_history else d.unroll
    fewest = 0
    if not fixed:
        looped = [_attempt(d, variant, unrolled=False) for variant in alternatives]
        yield from looped
        fewest = min(a.operations for a in looped)
    if fixed or (fixed is None and fewest <= SHORT):
        yield from (_attempt(d, variant, unrolled=True) for variant in alternatives)


def _by_products(
    d: Definition, task: str, structure: PotentialStructure | None
) -> tuple[Attempt, ...]:
    """A large tangent as loops over products at the points; nothing for any other one."""
    size = len(d.unknowns)
    if task != Task.TANGENT or size < point_products.FEW or d.unroll:
        return ()
    if not point_products.is_vast(d):
        usual = min(
            task_outputs.variants(d, task, structure),
            key=lambda v: operations([x.node for x in v.entries]),
        )
        if not point_products.is_large(usual.entries):
            return ()
    residual = next(task_outputs.variants(d, Task.RESIDUAL, structure)).entries
    entries = point_products.outputs(d, residual)
    if entries is None:
        return ()
    attempt = _attempt(d, Variant("products at the points", entries), unrolled=False)
    if sum(s.loop is not None and bool(s.loop.outputs) for s in attempt.plan.stages) > 1:
        return ()
    loops = product_loops.operations(entries, size, symmetric=d.conservative)
    return (replace(attempt, operations=attempt.operations + len(d.rule.points) * loops),)


def _for_target(v: Variant, task: str, target: Target) -> Variant:
    return Variant(v.rule, ufcx.task_entries(v.entries, task)) if target is Target.UFCX else v


def _attempt(d: Definition, variant: Variant, *, unrolled: bool) -> Attempt:
    straight = passes.straight_line(d.rule.rows(), (len(d.data), len(d.point_data)))
    rewrites = straight if unrolled else passes.STANDARD
    roots, trace = passes.run(d.graph, [x.node for x in variant.entries], rewrites)
    plan = schedule(roots)
    work = plan.operations_once + len(d.rule.points) * plan.operations_per_point
    return Attempt(
        variant.rule, unrolled, replace_values(variant.entries, roots), trace, plan, work
    )
