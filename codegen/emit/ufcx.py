"""Printing for DOLFINx: UFCx `tabulate_tensor` functions of one cell, in self-contained C.

`codegen.abi` says what the pointers are.  The order of DOLFINx's vertices is woven into the
subscripts, so that nothing is copied; a loop over points keeps its rule in a table of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softehl.codegen import abi
from softehl.codegen.derive.output_entries import OutputEntry
from softehl.codegen.emit.c_printer import Printer, number
from softehl.codegen.emit.c_routines import called
from softehl.codegen.emit.c_runtime import ROOTS
from softehl.codegen.emit.code_motion import Loop, Schedule
from softehl.codegen.graph.graph import InputEntry, Node
from softehl.codegen.language.definition import Definition

_NOT_OFFERED = (abi.Task.PRODUCT, abi.Task.PSEUDO_LOAD, abi.Task.FIELDS_RATE)


def tasks(d: Definition, offered: Iterable[str]) -> list[str]:
    """The tasks that a form of DOLFINx can use; raises `TargetError` for an unfit model."""
    if d.interpolated:
        raise abi.TargetError(
            f"{d.name} interpolates {d.interpolated} with any number of unknowns: target ufcx "
            "needs a fixed number, use simd or scalar"
        )
    if (d.nodes, d.rule.dimension) not in abi.VERTEX_ORDER:
        supported = ", ".join(f"{n} in {k}-D" for n, k in abi.VERTEX_ORDER)
        raise abi.TargetError(
            f"{d.name} has {d.nodes} nodes and a rule in {d.rule.dimension}-D; DOLFINx has "
            f"Lagrange elements of as many nodes as {supported}: choose one of them, or use simd "
            "or scalar"
        )
    return [t for t in offered if t not in _NOT_OFFERED]


def task_entries(entries: Sequence[OutputEntry], task: str) -> list[OutputEntry]:
    """Outputs of one form: the matrix alone for the tangent."""
    return [x for x in entries if task != abi.Task.TANGENT or x.column is not None]


def vertices(d: Definition) -> tuple[int, ...]:
    """DOLFINx vertex of each node of the model."""
    return abi.VERTEX_ORDER[d.nodes, d.rule.dimension]


def vertex_positions(d: Definition) -> list[int]:
    """Place of each unknown of the model among the unknowns of the DOLFINx cell."""
    out = list(range(len(d.unknowns)))
    for start, components in d.nodal:
        for node, vertex in enumerate(vertices(d)):
            for c in range(components):
                out[start + node * components + c] = start + vertex * components + c
    return out


class _CellPrinter(Printer):
    """A printer whose arguments are those of UFCx."""

    def __init__(self, definition: Definition) -> None:
        super().__init__(definition)
        self.vertices, self.positions = vertices(definition), vertex_positions(definition)

    def ref(self, n: Node) -> str:
        return self.argument(n.payload) if isinstance(n.payload, InputEntry) else super().ref(n)

    def argument(self, source: InputEntry) -> str:
        k = source.index
        match source.array:
            case "coordinates":
                node, component = divmod(k, len(self.d.coordinates))
                return f"coordinate_dofs[{3 * self.vertices[node] + component}]"
            case "dofs":
                return f"w[{self.positions[k]}]"
            case "data":
                return f"w[{len(self.positions) + k}]"
            case "point data":
                start, width = len(self.positions) + len(self.d.data), len(self.d.point_data)
                return f"w[{start} + {width} * q + {k}]"
            case "parameters":
                return f"c[{k}]"
            case "arrays":
                return "0.0"
        return f"rule[{self.d.rule.dimension + 1} * q + {k}]"


def function(
    definition: Definition, task: str, entries: Sequence[OutputEntry], plan: Schedule
) -> tuple[str, int]:
    """C text of one cell kernel and the number of its temporaries."""
    p = _CellPrinter(definition)
    p.line(1, "(void)w, (void)c, (void)coordinate_dofs;")
    p.line(1, "(void)entity_local_index, (void)quadrature_permutation, (void)custom_data;")
    if any(group.loop is not None for group in plan.stages):
        _table(p)
    if definition.arrays:
        p.line(1, "const double *const parameters = c;")
        p.line(1, "(void)parameters;")
    fallible = bool(called([x.node for x in entries]))
    if fallible:
        p.line(1, "int failed = 0;")
    values = {} if task == abi.Task.FIELDS else {_target(p, task, x): x.node for x in entries}
    p.read(plan, [x.node for x in entries])
    for group in plan.stages:
        p.block(1, group.preamble)
        if group.loop is not None:
            _loop(p, group.loop, entries if task == abi.Task.FIELDS else [])
    if task == abi.Task.FIELDS:
        _same_at_all_points(p, entries)
    for k in sorted(values):
        if values[k] is not definition.graph.zero:
            p.line(1, f"A[{k}] += {p.ref(values[k])};")
    if fallible:
        _mark(p, task)
    declaration = abi.ufcx_declaration(definition.name, task)
    body = p.text()
    return f"{declaration};\n\n{declaration}\n{{\n{body}\n}}\n", p.temporaries


def _target(p: _CellPrinter, task: str, x: OutputEntry) -> int:
    if task == abi.Task.ENERGY:
        return 0
    row = p.positions[x.row.position]
    if x.column is None:
        return row
    return row * len(p.positions) + p.positions[x.column.position]


def _table(p: Printer) -> None:
    """Rows (coordinates..., weight) of the model's rule."""
    p.line(1, "static const double rule[] = {")
    for point, weight in zip(p.d.rule.points, p.d.rule.weights, strict=True):
        row = ", ".join(number(float(x.evalf(30))) for x in (*point, weight))
        p.line(2, f"{row},")
    p.line(1, "};")


def _loop(p: Printer, loop: Loop, fields: Sequence[OutputEntry]) -> None:
    """The loop over the points; `fields` are stored in it."""
    for s in loop.sums:
        p.line(1, f"double {p.fresh(s, 's')} = 0.0;")
    p.line(1, f"for (int q = 0; q < {len(p.d.rule.weights)}; ++q) {{")
    p.block(2, loop.body)
    for s in loop.sums:
        p.line(2, f"{p.ref(s)} += {p.bare(s.args[0])};")
    for x in fields:
        if x.node in loop.outputs:
            _store(p, 2, x)
    p.line(1, "}")


def _store(p: Printer, depth: int, x: OutputEntry) -> None:
    p.line(depth, f"A[{len(p.d.fields)} * q + {x.row.position}] += {p.ref(x.node)};")


def _same_at_all_points(p: Printer, entries: Sequence[OutputEntry]) -> None:
    """Fields that do not vary with the point."""
    fixed = [x for x in entries if not x.node.varying]
    if fixed:
        p.line(1, f"for (int q = 0; q < {len(p.d.rule.weights)}; ++q) {{")
        for x in fixed:
            _store(p, 2, x)
        p.line(1, "}")


def _mark(p: _CellPrinter, task: str) -> None:
    """A routine without a result spoils the whole cell."""
    size = len(p.positions)
    sizes = {
        abi.Task.ENERGY: 1,
        abi.Task.TANGENT: size**2,
        abi.Task.FIELDS: len(p.d.rule.weights) * len(p.d.fields),
    }
    count = sizes.get(abi.Task(task), size) if task in set(abi.Task) else size
    p.line(1, "if (failed)")
    p.line(2, f"for (int k = 0; k < {count}; ++k) A[k] = NAN;")


def source(definition: Definition, functions: Iterable[str], preamble: Iterable[str] = ()) -> str:
    """The C file of a kernel family; `preamble` are the routines that its functions call."""
    includes = ["#include <stddef.h>"] if definition.arrays else []
    head = [_banner(definition), "#include <math.h>", *includes, "#include <stdint.h>", ROOTS]
    return "\n".join([*head, *preamble, *functions])


def _banner(d: Definition) -> str:
    at = dict(zip(vertex_positions(d), d.unknowns, strict=True))
    rows = [f"w[{k}]  {at[k]}" for k in sorted(at)]
    rows += [f"w[{len(at) + k}]  {a.name}: {a.meaning}" for k, a in enumerate(d.data)]
    first, width = len(at) + len(d.data), len(d.point_data)
    rows += [
        f"w[{first + k} + {width} q]  {a.name}: {a.meaning}" for k, a in enumerate(d.point_data)
    ]
    rows += [f"A[{k} + {len(d.fields)} q]  {name}" for k, (name, _) in enumerate(d.fields)]
    rows += [f"c[{k}]  {a.name}: {a.meaning}" for k, a in enumerate(d.parameters)]
    for k, array in enumerate(d.arrays):
        first = len(d.parameters) + abi.ARRAY_ENTRIES * k
        rows.append(
            f"c[{first}], c[{first + 1}], c[{first + 2}]  place and length of {array.name}, 0"
        )
    order = ", ".join(f"{a + 1} at {v}" for a, v in enumerate(vertices(d)))
    lines = [f"{d.name}: {d.doc}", "", f"nodes and their vertices: {order}", *rows]
    text = "\n".join(f" * {line}".rstrip() for line in lines).replace("*/", "* /")
    return f"/* Generated by softehl for UFCx from a model page; do not edit.\n *\n{text}\n */"
