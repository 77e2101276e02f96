"""Kernel of one task whose mathematics stands at a point: loops of the cell around its function.

`choose` says whether the loops pay, against one long piece of code for the whole element. That is
the fastest for small elements, and the slowest to build and to run for large ones. Its operations
are estimated from those at a point: looking at the element as a whole saves about a third, on
every cell that was measured.

The tangent is assembled from pulled-back moduli in a C file that knows nothing of the model: models
with the same fields on the same cell share it, so that it is compiled once.

Values at the centroid are inputs of the function of a point. Their function is called once, before
the loop over the points. A tangent gets the products of what forces lose by each value, T, with
the derivatives of that value by the unknowns, G.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from softehl.codegen import abi
from softehl.codegen.abi import PREFIX, Task
from softehl.codegen.emit.batch_functions import functions
from softehl.codegen.emit.c_printer import fields_expression
from softehl.codegen.emit.c_source import HEADER
from softehl.codegen.emit.code_motion import Schedule
from softehl.codegen.emit.points import (
    btab,
    cell_constants,
    parent_map,
    point_function,
)
from softehl.codegen.emit.points.btab import STEM, Pair, Parent, pull_back, ranks
from softehl.codegen.emit.points.c_lines import Lines, load, store
from softehl.codegen.emit.points.loop_nest import Frame, components, products, to_nodes
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_inputs import PointInputs
from softehl.codegen.emit.points.point_layout import PointLayout, orders
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import PointQuantity


class Centroid(Frame):
    """The frame of the centroid; its layout has the centroid as its only point."""

    def write(self, out: Lines) -> None:
        """Values c, along a direction their rates dc, for a tangent their derivatives G."""
        self.out, self.to_unknowns = out, False
        layout, outputs, form = self.layout, self.outputs, self.layout.form
        count, rates = len(form.centroid), len(outputs.rates)
        out.add(f"V c[{count}];")
        if rates:
            out.add(f"V dc[{rates}];")
        if self.task == Task.TANGENT:
            zeros(out, "G", count, len(layout.d.unknowns))
        out.open("")
        out.add("enum { q = 0 };")
        products(self)
        parent_map.write(self)
        PointInputs(self).write()
        out.add(f"V A[{max(len(outputs.moduli), rates, 1)}];")
        call = point_function.name(layout, self.task)
        terms = "&terms, " if layout.d.term_history else ""
        out.add(f"failed |= {call}(parameters, {terms}x, g, e, b, t, c, A);")
        if rates:
            out.add(f"for (int k = 0; k < {rates}; ++k) dc[k] = A[k];")
        for k in range(count if self.task == Task.TANGENT else 0):
            pairs = enumerate(outputs.moduli)
            gradients: dict[PointQuantity, str] = {
                form.all[j]: f"A[{n}]" for n, (i, j) in pairs if i == k
            }
            out.open("")
            to_nodes(self, gradients, f"G[{k}]", "")
            out.close()
        out.close()


def zeros(out: Lines, name: str, rows: int, columns: int) -> None:
    """Declare an array of zeros."""
    out.add(f"V {name}[{rows}][{columns}];")
    out.open(f"for (int k = 0; k < {columns}; ++k)")
    for i in range(rows):
        out.add(f"{name}[{i}][k] = softehl_splat(0.0);")
    out.close()


class Group(Frame):
    """The function that handles one group of elements in a task."""

    def __init__(
        self,
        layout: PointLayout,
        task: str,
        outputs: PointOutputs,
        pairs: str = "",
        centroid: PointOutputs | None = None,
    ) -> None:
        """pairs: name of the function that makes tangents of moduli. centroid: of its function."""
        super().__init__(layout, task, outputs)
        self.pairs, self.centroid, self.parent = pairs, centroid, Parent(layout, outputs)

    # the whole ----------------------------------------------------------------------------------

    def text(self) -> str:
        """C text of the functions of a group and of a batch."""
        self._start()
        if self.centroid is not None:
            Centroid(self.layout.at_centroid(), self.task, self.centroid).write(self.out)
        self.out.open(f"for (int q = 0; q < {self.layout.points}; ++q)")
        products(self)
        parent_map.write(self)
        PointInputs(self).write()
        self._call()
        self.out.close()
        if self.task == Task.TANGENT:
            more = "T, G, " if self.parent.of_centroid else ""
            self.out.add(f"{self.pairs}(S, {more}K);")
        self._finish()
        return functions(self.layout.d, self.task, "\n".join(self.out.lines))

    def _start(self) -> None:
        out, d = self.out, self.layout.d
        arrays = {
            "xs": ("X", d.coordinate_width, self.widths["coordinates"]),
            "us": ("d", len(d.unknowns), self.widths["dofs"]),
            "es": ("a", len(d.data), self.widths["data"]),
            "ts": ("t", self.moving(), self.widths["direction"]),
        }
        for array, (source, count, width) in arrays.items():
            if count:
                out.add(f"V {array}[{count}];")
                load(out, array, source, count, width)
                out.idle([array])
        out.add("M failed = softehl_mask(0);")
        if self.to_unknowns:
            out.add(f"V r[{len(d.unknowns)}];")
            out.add(f"for (int k = 0; k < {len(d.unknowns)}; ++k) r[k] = softehl_splat(0.0);")
        if self.task == Task.ENERGY:
            out.add("V r[1] = {softehl_splat(0.0)};")
        if self.task == Task.TANGENT:
            out.add(f"V S[{self.layout.points}][{self.parent.size}];")
            if self.parent.of_centroid:
                zeros(out, "T", len(self.parent.of_centroid), len(d.unknowns))

    # what it gives ------------------------------------------------------------------------------

    def _call(self) -> None:
        out, outputs, d = self.out, self.outputs, self.layout.d
        out.add(f"V P[{max(len(outputs.rows), 1)}];")
        out.add(f"V A[{max(len(outputs.moduli), len(outputs.rates), 1)}];")
        call = point_function.name(self.layout, self.task)
        terms = "&terms, " if d.term_history else ""
        out.add(f"failed |= {call}(parameters, {terms}x, g, e, b, t, P, A);")
        if self.task == Task.ENERGY:
            out.add("r[0] += w * P[0];")
        elif self.task in abi.AT_POINTS:
            width = f"({fields_expression(d)} * {self.layout.points})"
            store(out, f"R + {fields_expression(d)} * q", "P", len(d.fields), width)
        else:
            moved = self.task == Task.PSEUDO_LOAD
            to_nodes(self, self._moved_fluxes() if moved else self._plain_fluxes(), "r", "w * ")
        if self.task == Task.TANGENT:
            pull_back(out, self.layout, outputs)
            for k, fluxes in enumerate(self.parent.of_centroid):
                out.open("")
                to_nodes(self, fluxes, f"T[{k}]", "w * ")
                out.close()

    def _plain_fluxes(self) -> dict[PointQuantity, str]:
        return {q: f"P[{k}]" for k, q in self.layout.form.cell_quantities.items()}

    def _moved_fluxes(self) -> dict[PointQuantity, str]:
        """Rates of fluxes with the contribution of moving positions."""
        numbers = {q: k for k, q in self.layout.form.cell_quantities.items()}
        fluxes: dict[PointQuantity, str] = {}
        for c in components(numbers):
            by_axis = {q.axis: k for q, k in numbers.items() if q.component == c}
            gradients = {axis: k for axis, k in by_axis.items() if axis is not None}
            for axis in [
                *([None] if None in by_axis else []),
                *(range(self.D) if gradients else []),
            ]:
                terms = []
                if axis in by_axis:
                    terms.append(f"A[{by_axis[axis]}] + swell * P[{by_axis[axis]}]")
                if axis is not None:
                    terms += [f"(-P[{k}]) * L{axis}{m}" for m, k in gradients.items()]
                name = f"moved{len(fluxes)}"
                self.out.add(f"const V {name} = {' + '.join(terms)};")
                fluxes[PointQuantity(c, axis)] = name
        return fluxes

    def _finish(self) -> None:
        out, d = self.out, self.layout.d
        size = len(d.unknowns)
        if self.to_unknowns or self.task == Task.ENERGY:
            count = size if self.to_unknowns else 1
            store(out, "R", "r", count, str(count))
        out.open("if (softehl_any(failed))")
        out.add(f"softehl_spoil(failed, R, {self.widths['values']});")
        if self.task == Task.TANGENT:
            out.add(f"softehl_spoil(failed, K, {size * size});")
        out.close()


_SHORT = 65536
"""Entries of a tangent that a short number counts."""
_NAME = f"{PREFIX}_{STEM}"


def file(layout: PointLayout, outputs: PointOutputs) -> tuple[str, str]:
    """Name of the function and text of its file."""
    body = assembly(layout, outputs)
    tables = "\n".join(cell_constants.used(layout, body, STEM))
    key = hashlib.sha256((tables + body).encode()).hexdigest()[:16]
    name = f"{_NAME}{layout.d.cell}_{key}"
    head = declaration(name, layout, outputs)
    banner = f"/* Generated by softehl: tangents of {layout.d.cell} from moduli; do not edit. */"
    text = f'{banner}\n#include "{HEADER}"\n\n{head};\n\n{tables}\n{head}\n{{\n{body}\n}}\n'
    return name, text


def declaration(name: str, layout: PointLayout, outputs: PointOutputs) -> str:
    """Prototype: moduli of every point of a group of elements, tangents of these.

    With values at the centroid also, for each, derivatives of forces by it and its own by the
    unknowns: their product adds to the tangent.
    """
    rows = f"V (*restrict {{}})[{len(layout.d.unknowns)}], "
    parent = Parent(layout, outputs)
    more = "".join(map(rows.format, "TG")) if parent.of_centroid else ""
    return f"void {name}(V (*restrict S)[{parent.size}], {more}double *restrict K)"


def assembly(layout: PointLayout, outputs: PointOutputs) -> str:
    """Statements that assemble tangents K of a group of elements from their moduli S."""
    out, parent = Lines(), Parent(layout, outputs)
    count = len(layout.d.unknowns) ** 2
    storage = "static _Thread_local " if count > _SHORT else ""  # a stack has no room for it
    out.add(f"{storage}V k_lanes[{count}];")
    needed_orders = orders(parent.quantities)
    pairs = []
    for n, e in enumerate(needed_orders):
        for f in needed_orders[n if parent.symmetric else 0 :]:
            pairs.append(Pair(parent, (e, f), e == f and parent.symmetric))
    covered = {entry for pair in pairs for entry in pair.entries}
    if parent.symmetric:
        covered |= {(j, i) for i, j in covered}
    if len(covered) < len(layout.components) ** 2:
        out.add(f"for (int k = 0; k < {count}; ++k) k_lanes[k] = softehl_splat(0.0);")
    for pair in pairs:
        if pair.entries:
            lines = [layout.shape(order).line for order in pair.order]
            assemble = btab.assemble_by_directions if all(lines) else btab.assemble
            assemble(out, pair)
    size, values = len(layout.d.unknowns), len(parent.of_centroid)
    if values:
        out.open(f"for (int i = 0; i < {size}; ++i)")
        out.open(f"for (int j = 0; j < {size}; ++j)")
        total = " + ".join(f"T[{k}][i] * G[{k}][j]" for k in range(values))
        out.add(f"k_lanes[{size} * i + j] += {total};")
        out.close()
        out.close()
    _store(out, layout, count, symmetric=parent.symmetric)
    return "\n".join(out.lines)


def _store(out: Lines, layout: PointLayout, count: int, *, symmetric: bool) -> None:
    in_groups, name = count - count % 4, f"{STEM}{layout.d.cell}_K"
    if count > _SHORT:
        _store_by_ranks(out, layout, symmetric=symmetric)
        return
    _entry_table(out, layout, name, symmetric=symmetric)
    out.open(f"for (ptrdiff_t k = 0; k < {in_groups}; k += 4)")
    out.add(f"const unsigned short *const at = {name} + k;")
    values = ", ".join(f"k_lanes[at[{i}]]" for i in range(4))
    out.add(f"softehl_store4(K + k, {count}, {values});")
    out.close()
    for k in range(in_groups, count):
        out.add(f"softehl_store1(K + {k}, {count}, k_lanes[{name}[{k}]]);")


def _entry_table(out: Lines, layout: PointLayout, name: str, *, symmetric: bool) -> None:
    """Table of the index in k_lanes of every entry, row by row.

    Of a symmetric tangent that of the two mirrored entries which is computed; the C compiler
    compares the ranks.
    """
    size = len(layout.d.unknowns)
    count, order = size * size, {rank: n for n, rank in enumerate(sorted(ranks(layout)))}
    if not symmetric:
        values = ", ".join(map(str, range(count)))
        out.add(f"static const unsigned short {name}[{count}] = {{{values}}};")
        return
    numbers = ", ".join(f"{name}{j} = {order[rank]}" for j, rank in enumerate(ranks(layout)))
    out.add(f"enum {{{numbers}}};")
    mirrored = f"{name}##j < {name}##i ? j * {size} + i : i * {size} + j"
    out.lines.append(f"#define {name}_entry(i, j) ({mirrored})")
    row = ", ".join(f"{name}_entry(i, {j})" for j in range(size))
    out.lines.append(f"#define {name}_row(i) {row}")
    rows = ", ".join(f"{name}_row({i})" for i in range(size))
    out.add(f"static const unsigned short {name}[{count}] = {{{rows}}};")


def _store_by_ranks(out: Lines, layout: PointLayout, *, symmetric: bool) -> None:
    """Stores of a large tangent: of two mirrored entries the one of lower rank is computed."""
    size = len(layout.d.unknowns)
    order = {rank: n for n, rank in enumerate(sorted(ranks(layout)))}
    numbers = ", ".join(str(order[rank]) for rank in ranks(layout))
    if symmetric:
        out.add(f"static const unsigned short rank[{size}] = {{{numbers}}};")
    out.open(f"for (int i = 0; i < {size}; ++i)")
    out.open(f"for (int j = 0; j < {size}; ++j)")
    mirrored = f"rank[j] < rank[i] ? j * {size} + i : " if symmetric else ""
    out.add(f"const V entry = k_lanes[{mirrored}i * {size} + j];")
    out.add(f"softehl_store1(K + i * {size} + j, {size * size}, entry);")
    out.close()
    out.close()


@dataclass(frozen=True)
class KernelText:
    """C text of a kernel, the number of its temporaries, and a file that models share, if any."""

    text: str
    temporaries: int
    shared: tuple[str, str] | None


@dataclass(frozen=True)
class At:
    """Outputs at the points or at the centroid, and statements in their order."""

    outputs: PointOutputs
    plan: Schedule


def kernel(layout: PointLayout, task: str, point: At, centroid: At | None) -> KernelText:
    """The functions of the point and the centroid, the loops of the cell, and the batch."""
    text, temporaries = point_function.text(layout, task, point.outputs, point.plan)
    pieces, name, shared = [text], "", None
    if centroid is not None:
        centre = layout.at_centroid()
        pieces.append(point_function.text(centre, task, centroid.outputs, centroid.plan)[0])
    if task == Task.TANGENT:
        name, text = file(layout, point.outputs)
        shared = (f"{name.removeprefix('softehl_')}.c", text)
        pieces.insert(0, f"{declaration(name, layout, point.outputs)};\n")
    values = None if centroid is None else centroid.outputs
    pieces.append(Group(layout, task, point.outputs, name, values).text())
    return KernelText("\n".join(pieces), temporaries, shared)


SAVED = 0.35
"""Part of the operations that whole-element code saves: 0.25 to 0.45 on tri3 to tet10."""
LARGE = 12_000
"""Operations up to which simplices and wedges stay whole: there loops save the least.

Neo-Hooke on wedge6 (9,300): loops take 1.35 times as long, and 0.5 s to build instead of 2.6.
On tet10 (12,600): 1.1 times, and 0.6 s instead of 5, with a third of the C.
"""


@dataclass(frozen=True)
class Choice:
    """The chosen form of a model, and why."""

    at_points: bool
    why: str


def choose(layout: PointLayout, tangent: PointOutputs, operations: int, short: int) -> Choice:
    """The form of a model. operations: of the moduli at a point; short: up to which whole pays.

    tangent: moduli that are not zero.
    """
    d = layout.d
    if d.unroll is not None:
        return Choice(d.unroll is False, "the page asks for it")
    work = layout.points * (2 * multiply_adds(layout, tangent) + operations)
    element_operations = round((1 - SAVED) * work)
    estimate = f"about {element_operations} operations of the whole element"
    if any(n.op is Op.CALL for n in reachable([x.node for x in tangent.entries])):
        return Choice(True, f"local unknowns or functions of stretches, {estimate}")
    if d.history and layout.points > 1:
        return Choice(True, f"history at {layout.points} points, {estimate}")
    simple = d.cell.startswith(("tri", "tet", "wedge", "pyramid"))
    limit = LARGE if simple and not d.history else short
    return Choice(element_operations > limit, f"{estimate}, limit {limit}")


def multiply_adds(layout: PointLayout, tangent: PointOutputs) -> int:
    """Multiply-adds of B^T S B at one point, pair by pair of nodes."""
    parent = Parent(layout, tangent)
    total, needed_orders = 0, orders(parent.quantities)
    for n, e in enumerate(needed_orders):
        for f in needed_orders[n if parent.symmetric else 0 :]:
            pair = Pair(parent, (e, f), e == f and parent.symmetric)
            rows, columns = layout.shape(e).nodes, layout.shape(f).nodes
            pairs = rows * (rows + 1) // 2 if pair.half else rows * columns
            met = sum(
                parent.number(q, o) is not None
                for i in pair.components(0)
                for q in parent.of(i)
                for j in pair.components(1)
                for o in parent.of(j)
            )
            per_entry = sum(len(parent.of(i)) for i, _ in pair.entries)
            total += columns * met + pairs * per_entry
    return total
