"""A kernel for one element after another: pointers, stages, loops over the points, stores."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen import abi
from softehl.codegen.derive.outputs import Entry
from softehl.codegen.emit import basis
from softehl.codegen.emit.printer import (
    Printer,
    data_expression,
    design_width,
    direction_expression,
    dofs_expression,
)
from softehl.codegen.emit.schedule import Loop, Schedule
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition


def function(
    definition: Definition, task: str, entries: Sequence[Entry], plan: Schedule
) -> tuple[str, int]:
    """C text of one kernel and the number of its temporaries."""
    p = Printer(definition)
    p.line(1, "for (ptrdiff_t e = 0; e < n; ++e) {")
    _pointers(p, task)
    fallible = any(n.op is Op.CALL for n in reachable([x.node for x in entries]))
    if fallible:
        p.line(2, "int failed = 0;")
    scattered = [x for x in entries if _in_loop(x)]
    if scattered and task not in abi.AT_POINTS:
        _clear(p, task)
    for stage in plan.stages:
        p.block(2, stage.before)
        if stage.loop is not None:
            _loop(p, stage.loop, task, entries)
    _store_after(p, task, entries)
    if fallible:
        _mark(p, task)
    p.line(1, "}")
    body = "\n".join([*_unused(p.lines), p.text()])
    name = abi.function_name(definition.name, task)
    return f"SOFTEHL_KERNEL({name})\n{{\n{body}\n}}\n", p.temporaries


def _in_loop(x: Entry) -> bool:
    return x.row.basis or (x.column is not None and x.column.basis) or x.node.varying


def _pointers(p: Printer, task: str) -> None:
    d = p.d
    if d.coordinates:
        p.line(2, f"const double *restrict X = coordinates + {d.coordinate_width} * e;")
    p.line(2, f"const double *restrict d = dofs + {dofs_expression(d)} * e;")
    if d.data or d.point_data:
        p.line(2, f"const double *restrict a = data + {data_expression(d)} * e;")
    along = direction_expression(d, task)
    if along:
        p.line(2, f"const double *restrict t = direction + {along} * e;")
    if task not in (abi.Task.ENERGY, *abi.AT_POINTS):
        p.line(2, f"double *restrict R = values + {dofs_expression(d)} * e;")
    if task == abi.Task.TANGENT:
        p.line(
            2, f"double *restrict K = tangent + {dofs_expression(d)} * {dofs_expression(d)} * e;"
        )
    used = [*(["X"] if d.coordinates else []), "d", *(["a"] if d.data or d.point_data else [])]
    used += ["t"] if along else []
    p.line(2, " ".join(f"(void){name};" for name in used))


def _clear(p: Printer, task: str) -> None:
    size = dofs_expression(p.d)
    p.line(2, f"for (ptrdiff_t i = 0; i < {size}; ++i) R[i] = 0.0;")
    if task == abi.Task.TANGENT:
        p.line(2, f"for (ptrdiff_t i = 0; i < {size} * {size}; ++i) K[i] = 0.0;")


def _mark(p: Printer, task: str) -> None:
    """A routine without a result spoils its whole element, whatever was computed from it."""
    size = dofs_expression(p.d)
    fields = f"{len(p.d.fields)} * points"
    sizes = {
        abi.Task.ENERGY: {"values + e": "1"},
        **{key: {f"values + {fields} * e": fields} for key in abi.AT_POINTS},
        abi.Task.TANGENT: {"R": size, "K": f"{size} * {size}"},
    }.get(abi.Task(task) if task in set(abi.Task) else abi.Task.RESIDUAL, {"R": size})
    p.line(2, "if (failed) {")
    for array, length in sizes.items():
        p.line(3, f"for (ptrdiff_t i = 0; i < {length}; ++i) ({array})[i] = NAN;")
    p.line(2, "}")


def _store_after(p: Printer, task: str, entries: Sequence[Entry]) -> None:
    """Outputs that are complete when all loops are done."""
    if task not in abi.AT_POINTS:
        for x in entries:
            if not _in_loop(x):
                p.line(2, f"{_target(p.d, task, x)} = {p.ref(x.node)};")
        return
    fixed = [x for x in entries if not x.node.varying]
    if fixed:
        p.line(2, "for (ptrdiff_t q = 0; q < points; ++q) {")
        _store_fields(p, fixed)
        p.line(2, "}")


def _loop(p: Printer, loop: Loop, task: str, entries: Sequence[Entry]) -> None:
    for s in loop.sums:
        p.line(2, f"double {p.fresh(s, 's')} = {{0}};")
    p.line(2, "for (ptrdiff_t q = 0; q < points; ++q) {")
    p.line(3, f"const double *restrict w = rule + {p.d.rule.dimension + 1} * q;")
    p.line(3, "(void)w;")
    if p.d.point_data:
        size = len(p.d.point_data)
        p.line(3, f"const double *restrict b = a + {len(p.d.data)} + {size} * q;")
        p.line(3, "(void)b;")
    if p.d.interpolated:
        p.line(3, f"const double *restrict B = basis + {p.d.components} * modes * q;")
        basis.gather(p, 3, "p", "d")
        if task == abi.Task.PRODUCT:
            basis.gather(p, 3, "t", "t")
        if task == abi.Task.FIELDS_RATE:
            basis.gather(p, 3, "t", "t", design_width(p.d))
    p.block(3, loop.body)
    for s in loop.sums:
        p.line(3, f"{p.ref(s)} += {p.bare(s.args[0])};")
    here = [x for x in entries if x.node in loop.outputs]
    if here and task in abi.AT_POINTS:
        _store_fields(p, here)
    elif here:
        basis.scatter(p, 3, task, here)
    p.line(2, "}")


def _store_fields(p: Printer, entries: Sequence[Entry]) -> None:
    p.line(3, f"double *restrict out = values + {len(p.d.fields)} * (points * e + q);")
    for x in entries:
        p.line(3, f"out[{x.row.position}] = {p.ref(x.node)};")


def _target(d: Definition, task: str, x: Entry) -> str:
    if task == abi.Task.ENERGY:
        return "values[e]"
    if x.column is None:
        return f"R[{x.row.position}]"
    if d.interpolated:
        return f"K[{x.row.position} * {dofs_expression(d)} + {x.column.position}]"
    return f"K[{x.row.position * len(d.unknowns) + x.column.position}]"


def _unused(lines: Sequence[str]) -> list[str]:
    """Silence arguments that a family has no use for."""
    text = "\n".join(lines)
    names = ["points", "modes", "coordinates", "data", "parameters", "direction"]
    names += ["rule", "basis", "tangent"]
    return [f"    (void){name};" for name in names if name not in text]
