"""The whole compiler on one screen: model -> outputs -> passes -> schedule -> C."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import ModuleType
from typing import Any

from softehl.codegen import abi
from softehl.codegen.abi import Target
from softehl.codegen.derive import variants
from softehl.codegen.derive.outputs import Entry, placed
from softehl.codegen.emit import c as emit_c
from softehl.codegen.emit import routines as emit_routines
from softehl.codegen.emit import simd as emit_simd
from softehl.codegen.emit import ufcx as emit_ufcx
from softehl.codegen.emit.liveness import peak_live
from softehl.codegen.emit.order import arranged
from softehl.codegen.emit.schedule import Schedule, schedule, straight_line
from softehl.codegen.graph.graph import Routine
from softehl.codegen.language.definition import Definition
from softehl.codegen.optimise import passes


@dataclass(frozen=True)
class Function:
    """One kernel: C text, plan, temporaries, and what each pass bought."""

    text: str
    plan: Schedule
    temporaries: int
    trace: list[passes.TraceRow]
    routines: tuple[Routine, ...] = ()


@dataclass(frozen=True)
class KernelSource:
    """A kernel family: its model, its C file and its functions by task."""

    definition: Definition
    text: str
    functions: Mapping[str, Function]


def compile_model(definition: Definition, target: Target = Target.SIMD) -> KernelSource:
    """All kernels of one model; `codegen.abi` says what each target is."""
    tasks = variants.tasks(definition)
    if target is Target.UFCX:
        tasks = emit_ufcx.tasks(definition, tasks)
    functions = {t: compile_task(definition, t, target) for t in tasks}
    texts = [f.text for f in functions.values()]
    if target is Target.UFCX:
        return KernelSource(definition, emit_ufcx.source(definition, texts), functions)
    called = dict.fromkeys(r for f in functions.values() for r in f.routines)
    before = emit_routines.texts(definition, called) + emit_simd.wrappers("".join(texts))
    return KernelSource(definition, emit_c.source(definition, texts, before), functions)


def compile_task(definition: Definition, task: str, target: Target = Target.SIMD) -> Function:
    """One kernel, all stages in order; of several chain rules the one with fewest operations."""
    written_out = definition.unroll and task != abi.Task.FIELDS
    data = (len(definition.data), len(definition.point_data))
    straight = passes.straight_line(_points(definition), data)
    chosen = straight if written_out else passes.STANDARD
    tried = []
    for entries in variants.variants(definition, task):
        wanted = emit_ufcx.chosen(entries, task) if target is Target.UFCX else entries
        tried.append(_rewritten(definition, wanted, chosen))
    entries, plan, trace = min(tried, key=lambda t: _work(definition, t[1]))
    printer = _printer(target, task, plan)
    if printer is emit_simd:
        entries, plan = _arranged(definition, entries)
    text, temporaries = printer.function(definition, task, entries, plan)
    routines = tuple(emit_routines.called([x.node for x in entries]))
    return Function(text, plan, temporaries, trace, routines)


def _rewritten(
    definition: Definition, entries: list[Entry], chosen: Sequence[passes.Pass]
) -> tuple[list[Entry], Schedule, list[passes.TraceRow]]:
    roots, trace = passes.run(definition.graph, [x.node for x in entries], chosen)
    return placed(entries, roots), schedule(roots), trace


def _arranged(definition: Definition, entries: Sequence[Entry]) -> tuple[list[Entry], Schedule]:
    roots, order = arranged(definition.graph, [x.node for x in entries])
    return placed(entries, roots), straight_line(order)


def _work(definition: Definition, plan: Schedule) -> int:
    """Operations of one element."""
    return plan.operations_once + len(definition.rule.points) * plan.operations_per_point


def _printer(target: Target, task: str, plan: Schedule) -> ModuleType:
    """Lanes where they are wanted and suit; fields are stored point by point, never in lanes."""
    if target is Target.UFCX:
        return emit_ufcx
    lanes = target is Target.SIMD and task != abi.Task.FIELDS and emit_simd.suits(plan)
    return emit_simd if lanes else emit_c


def _points(definition: Definition) -> list[list[Fraction]]:
    """Rows (coordinates..., weight) of the model's rule, to 60 digits."""
    scale = 10**60
    rows = zip(definition.rule.points, definition.rule.weights, strict=True)
    return [[Fraction(int(x.evalf(70) * scale), scale) for x in (*p, w)] for p, w in rows]


def files(kernels: Iterable[KernelSource]) -> dict[str, str]:
    """Every file of `generated/`: C, header, signature, manifest."""
    kernels = list(kernels)
    declarations = [abi.declaration(k.definition.name, t) for k in kernels for t in k.functions]
    out = {f"{k.definition.name}.c": k.text for k in kernels}
    out[emit_c.HEADER] = emit_c.header(declarations)
    out["signature.c"] = SIGNATURE_C
    manifest = {k.definition.name: _manifest(k) for k in kernels}
    out["manifest.json"] = json.dumps({"kernels": manifest}, indent=1) + "\n"
    return out


def ufcx_files(kernels: Iterable[KernelSource]) -> dict[str, str]:
    """Self-contained C files of kernels compiled for target `ufcx`."""
    return {f"{k.definition.name}_ufcx.c": k.text for k in kernels}


SIGNATURE_C = f"""/* Generated by softehl; do not edit. */
#include "{emit_c.HEADER}"

#ifndef SOFTEHL_SIGNATURE
#error "build with python -m softehl.codegen.tools.build, which passes the signature of the sources"
#endif

const char *softehl_signature(void)
{{
    return SOFTEHL_SIGNATURE;
}}
"""


def _manifest(kernel: KernelSource) -> dict[str, Any]:
    d = kernel.definition
    points = [[float(x.evalf(30)) for x in p] for p in d.rule.points]
    return {
        "doc": d.doc,
        "nodes": d.nodes,
        "coordinates": list(d.coordinates),
        "unknowns": list(d.unknowns),
        "interpolated": d.interpolated,
        "components": d.components,
        "parameters": {a.name: a.meaning for a in d.parameters},
        "data": {a.name: a.meaning for a in d.data},
        "point_data": {a.name: a.meaning for a in d.point_data},
        "conditions": [[c.name, c.relation, c.bound, c.where] for c in d.conditions],
        "fields": [name for name, _ in d.fields],
        "unrolled": d.unroll,
        "rule": {"points": points, "weights": [float(w.evalf(30)) for w in d.rule.weights]},
        "tasks": {t: _cost(f, len(points)) for t, f in kernel.functions.items()},
        "bytes": len(kernel.text.encode()),
        "signature": hashlib.sha256(kernel.text.encode()).hexdigest()[:16],
    }


def _cost(f: Function, points: int) -> dict[str, int]:
    once, per_point = f.plan.operations_once, f.plan.operations_per_point
    return {
        "operations": once + points * per_point,
        "operations_once": once,
        "operations_per_point": per_point,
        "temporaries": f.temporaries,
        "peak_live": peak_live(f.plan),
    }
