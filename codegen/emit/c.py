"""Printing: one scheduled value, one line of C.  Nothing is optimised here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softehl.codegen import abi
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.emit import support as support_c
from softehl.codegen.emit.schedule import If, Loop, Schedule, Statement
from softehl.codegen.graph.graph import BOOLEAN, ELEMENTARY, Input, Node, Op, Place, Routine
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition

HEADER = "softehl_kernels.h"


_FORMATS: dict[Op, str] = {
    Op.ADD: "{} + {}",
    Op.SUB: "{} - {}",
    Op.MUL: "{} * {}",
    Op.NEG: "-{}",
    Op.RECIP: "1.0 / {}",
    Op.SQRT: "sqrt({})",
    Op.CBRT: "cbrt({})",
    Op.RCBRT: "softehl_rcbrt({})",
    Op.LOG: "log({})",
    Op.EXP: "exp({})",
    Op.SIN: "sin({})",
    Op.COS: "cos({})",
    Op.ATAN2: "atan2({}, {})",
    **{op: f"{op}({{}})" for op in sorted(ELEMENTARY)},
    Op.LT: "{} < {}",
    Op.LE: "{} <= {}",
    Op.EQ: "{} == {}",
    Op.AND: "{} && {}",
    Op.OR: "{} || {}",
    Op.NOT: "!{}",
}

_ARRAYS = {
    "coordinates": "X[{}]",
    "dofs": "d[{}]",
    "direction": "t[{}]",
    "data": "a[{}]",
    "parameters": "parameters[{}]",
    "rule": "w[{}]",
    "point data": "b[{}]",
    "local": "s[{}]",
    "external": "p[{}]",
    "interpolated": "p{}",
    "interpolated direction": "t{}",
}


def number(value: float) -> str:
    """A double that C reads back exactly."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


class Printer:
    """Lines of one function body."""

    def __init__(self, definition: Definition) -> None:
        self.d = definition
        self.lines: list[str] = []
        self.names: dict[Node, str] = {}
        self.temporaries = 0

    def line(self, depth: int, text: str) -> None:
        self.lines.append("    " * depth + text)

    def ref(self, n: Node) -> str:
        if n.op is Op.CONST:
            return number(float(n.value))
        if isinstance(n.payload, Input):
            return _ARRAYS[n.payload.array].format(n.payload.index)
        return self.names[n]

    def fresh(self, n: Node, letter: str = "v") -> str:
        self.temporaries += 1
        self.names[n] = f"{letter}{self.temporaries}"
        return self.names[n]

    def block(self, depth: int, statements: Iterable[Statement]) -> None:
        for s in statements:
            if isinstance(s, If):
                self.branch(depth, s)
            elif isinstance(s.payload, Routine):
                self.call(depth, s, s.payload)
            else:
                right = self.expression(s)
                kind = "int" if s.op in BOOLEAN else "double"
                self.line(depth, f"const {kind} {self.fresh(s)} = {right};")

    def call(self, depth: int, n: Node, routine: Routine) -> None:
        """Run a routine on its operands; a failure is remembered."""
        operands = ", ".join(self.ref(a) for a in n.args) or "0.0"
        name = f"{abi.PREFIX}_{self.d.name}_{routine.name}"
        self.line(depth, f"double {self.fresh(n)}[{routine.outputs}];")
        self.line(depth, f"failed |= {name}((const double[]){{{operands}}}, {self.ref(n)});")

    def expression(self, n: Node) -> str:
        if isinstance(n.payload, Place):
            return f"{self.ref(n.args[0])}[{n.payload.index}]"
        if n.op is Op.POW:
            return f"pow({self.ref(n.args[0])}, {number(float(n.payload))})"  # type: ignore[arg-type]
        return _FORMATS[n.op].format(*(self.ref(a) for a in n.args))

    def branch(self, depth: int, s: If) -> None:
        names = [self.fresh(n) for n in s.merged]
        self.line(depth, f"double {', '.join(names)};")
        for head, k, inner in (
            (f"if ({self.ref(s.condition)}) {{", 1, s.then),
            ("} else {", 2, s.otherwise),
        ):
            self.line(depth, head)
            self.block(depth + 1, inner)
            for n, name in zip(s.merged, names, strict=True):
                self.line(depth + 1, f"{name} = {self.ref(n.args[k])};")
        self.line(depth, "}")


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
    if scattered and task != abi.Task.FIELDS:
        _clear(p, task)
    for stage in plan.stages:
        p.block(2, stage.before)
        if stage.loop is not None:
            _loop(p, stage.loop, task, entries)
    _store_after(p, task, entries)
    if fallible:
        _mark(p, task)
    p.line(1, "}")
    body = "\n".join(_unused(p.lines) + p.lines)
    text = f"{abi.declaration(definition.name, task)}\n{{\n{body}\n}}\n"
    return text, p.temporaries


def _in_loop(x: Entry) -> bool:
    return x.row.basis or (x.column is not None and x.column.basis) or x.node.varying


def dofs_expression(d: Definition) -> str:
    direct = len(d.unknowns)
    return f"({direct} + modes)" if d.interpolated else str(direct)


def data_expression(d: Definition) -> str:
    """Data of one element, those of its points included."""
    if not d.point_data:
        return str(len(d.data))
    return f"({len(d.data)} + {len(d.point_data)} * points)"


def _pointers(p: Printer, task: str) -> None:
    d = p.d
    if d.coordinates:
        p.line(2, f"const double *restrict X = coordinates + {d.coordinate_width} * e;")
    p.line(2, f"const double *restrict d = dofs + {dofs_expression(d)} * e;")
    if d.data or d.point_data:
        p.line(2, f"const double *restrict a = data + {data_expression(d)} * e;")
    if task == abi.Task.PRODUCT:
        p.line(2, f"const double *restrict t = direction + {dofs_expression(d)} * e;")
    if task not in (abi.Task.ENERGY, abi.Task.FIELDS):
        p.line(2, f"double *restrict R = values + {dofs_expression(d)} * e;")
    if task == abi.Task.TANGENT:
        p.line(
            2, f"double *restrict K = tangent + {dofs_expression(d)} * {dofs_expression(d)} * e;"
        )
    used = [*(["X"] if d.coordinates else []), "d", *(["a"] if d.data or d.point_data else [])]
    used += ["t"] if task == abi.Task.PRODUCT else []
    p.line(2, " ".join(f"(void){name};" for name in used))


def _clear(p: Printer, task: str) -> None:
    size = dofs_expression(p.d)
    p.line(2, f"for (ptrdiff_t i = 0; i < {size}; ++i) R[i] = 0.0;")
    if task == abi.Task.TANGENT:
        p.line(2, f"for (ptrdiff_t i = 0; i < {size} * {size}; ++i) K[i] = 0.0;")


def _mark(p: Printer, task: str) -> None:
    """A routine without a result spoils its whole element, whatever was computed from it."""
    size = dofs_expression(p.d)
    sizes = {
        abi.Task.ENERGY: {"values + e": "1"},
        abi.Task.FIELDS: {
            f"values + {len(p.d.fields)} * points * e": f"{len(p.d.fields)} * points"
        },
        abi.Task.TANGENT: {"R": size, "K": f"{size} * {size}"},
    }.get(abi.Task(task) if task in set(abi.Task) else abi.Task.RESIDUAL, {"R": size})
    p.line(2, "if (failed) {")
    for array, length in sizes.items():
        p.line(3, f"for (ptrdiff_t i = 0; i < {length}; ++i) ({array})[i] = NAN;")
    p.line(2, "}")


def _store_after(p: Printer, task: str, entries: Sequence[Entry]) -> None:
    """Outputs that are complete when all loops are done."""
    if task != abi.Task.FIELDS:
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
        p.line(2, f"double {p.fresh(s, 's')} = 0.0;")
    p.line(2, "for (ptrdiff_t q = 0; q < points; ++q) {")
    p.line(3, f"const double *restrict w = rule + {p.d.rule.dimension + 1} * q;")
    p.line(3, "(void)w;")
    if p.d.point_data:
        size = len(p.d.point_data)
        p.line(3, f"const double *restrict b = a + {len(p.d.data)} + {size} * q;")
        p.line(3, "(void)b;")
    if p.d.interpolated:
        p.line(3, f"const double *restrict B = basis + {p.d.components} * modes * q;")
        _gather(p, "p", "d")
        if task == abi.Task.PRODUCT:
            _gather(p, "t", "t")
    p.block(3, loop.body)
    for s in loop.sums:
        p.line(3, f"{p.ref(s)} += {p.ref(s.args[0])};")
    here = [x for x in entries if x.node in loop.outputs]
    if here and task == abi.Task.FIELDS:
        _store_fields(p, here)
    elif here:
        _scatter(p, task, here)
    p.line(2, "}")


def _gather(p: Printer, value: str, array: str) -> None:
    """Values and xi-derivatives of the interpolated fields at the point."""
    names = [f"{value}{k}" for k in range(p.d.components)]
    p.line(3, f"double {', '.join(f'{name} = 0.0' for name in names)};")
    p.line(3, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    for name, shape in zip(names, _shapes(p.d, "i"), strict=True):
        p.line(4, f"{name} += {shape} * {array}[{len(p.d.unknowns)} + i];")
    p.line(3, "}")
    p.line(3, f"{', '.join(f'(void){name}' for name in names)};")


def _shapes(d: Definition, mode: str) -> list[str]:
    """Where the components of a shape function stand in the basis of a point."""
    offsets = ["", *(f" + {k}" for k in range(1, d.components))]
    return [f"B[{d.components} * {mode}{offset}]" for offset in offsets]


def _letters(d: Definition) -> list[str]:
    """Names of the components of one shape function: N, D of the first field, N1, D1, ..."""
    return [f"{letter}{k or ''}" for k in range(d.components // 2) for letter in "ND"]


def _store_fields(p: Printer, entries: Sequence[Entry]) -> None:
    p.line(3, f"double *restrict out = values + {len(p.d.fields)} * (points * e + q);")
    for x in entries:
        p.line(3, f"out[{x.row.position}] = {p.ref(x.node)};")


def _scatter(p: Printer, task: str, entries: Sequence[Entry]) -> None:
    direct = len(p.d.unknowns)
    at = {(x.row, x.column): p.ref(x.node) for x in entries}
    p.line(3, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    letters = _letters(p.d)
    values = zip(letters, _shapes(p.d, "i"), strict=True)
    p.line(4, f"const double {', '.join(f'{name} = {shape}' for name, shape in values)};")
    p.line(4, f"{', '.join(f'(void){name}' for name in letters)};")
    for column, target in _scatter_targets(p.d, task):
        left = _combination(letters, [at.get(k) for k in column])
        if left:
            p.line(4, f"{target} += {left};")
    size = range(p.d.components)
    blocks = [[at.get((Slot(True, r), Slot(True, c))) for r in size] for c in size]
    if any(value is not None for pair in blocks for value in pair):
        for c, pair in enumerate(blocks):
            p.line(4, f"const double r{c} = {_combination(letters, pair) or '0.0'};")
        p.line(4, "for (ptrdiff_t j = 0; j < modes; ++j)")
        products = " + ".join(f"r{c} * {shape}" for c, shape in enumerate(_shapes(p.d, "j")))
        p.line(
            5,
            f"K[({direct} + i) * {dofs_expression(p.d)} + {direct} + j] += {products};",
        )
    p.line(3, "}")


Key = tuple[Slot, Slot | None]


def _scatter_targets(d: Definition, task: str) -> list[tuple[list[Key], str]]:
    """Pairs (components of an output, its place for basis function i)."""
    direct, dofs = len(d.unknowns), dofs_expression(d)
    both = [Slot(True, k) for k in range(d.components)]
    out: list[tuple[list[Key], str]] = [([(s, None) for s in both], f"R[{direct} + i]")]
    if task == abi.Task.TANGENT:
        for k in range(direct):
            out.append(([(s, Slot(False, k)) for s in both], f"K[({direct} + i) * {dofs} + {k}]"))
            out.append(([(Slot(False, k), s) for s in both], f"K[{k} * {dofs} + {direct} + i]"))
    return out


def _combination(letters: Sequence[str], values: Sequence[str | None]) -> str:
    return " + ".join(f"{b} * {v}" for b, v in zip(letters, values, strict=True) if v is not None)


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


def source(definition: Definition, functions: Iterable[str], before: Iterable[str] = ()) -> str:
    """The C file of a kernel family; `before` are the routines that its functions call."""
    return "\n".join([_banner(definition), f'#include "{HEADER}"', "", *before, *functions])


def _banner(d: Definition) -> str:
    def rows(label: str, entries: Iterable[str]) -> list[str]:
        return [f" * {label}[{k}]  {text}" for k, text in enumerate(entries)]

    lines = [" *", f" * {d.name}: {d.doc}", " *", *rows("dofs", d.unknowns)]
    if d.interpolated:
        lines.append(f" * dofs[{len(d.unknowns)} + i]  {d.interpolated}, i < modes")
    groups = (("parameters", d.parameters), ("data", d.data), ("point data", d.point_data))
    for label, arguments in groups:
        lines += rows(label, [f"{a.name}: {a.meaning}" for a in arguments])
    lines += rows("fields", [name for name, _ in d.fields])
    text = "\n".join(lines).replace("*/", "* /")
    return f"/* Generated by softehl from a model page; do not edit.\n{text}\n */"


def header(declarations: Iterable[str]) -> str:
    """The one header of all kernels."""
    guard = "SOFTEHL_KERNELS_H"
    lines = ["/* Generated by softehl; do not edit.  codegen/abi.py says what every pointer is. */"]
    lines += [
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <math.h>",
        "#include <stddef.h>",
    ]
    lines += [
        support_c.TEXT,
        *(f"{d};" for d in declarations),
        "",
        "const char *softehl_signature(void);",
    ]
    return "\n".join([*lines, "", "#endif", ""])
