"""Kernels of a page of fields for a device, as CUDA.

A block of threads has `elements` elements. Lines of nodes and points, and the points themselves,
are spread over its threads; what passes between threads stands in shared memory. The function of a
point, the matrices along lines and the pulled-back moduli are those of the kernels in C with one
lane.

    residual(n, parameters, history, index, places, X, u, sizes, y)     y += residual
    geometry(n, places, X, kept)                         inverse Jacobian, volume, positions
    product(n, parameters, history, index, places, X, u, x, y)          y += K x, all computed
    product_geometry(n, parameters, history, index, kept, u, x, y)      y += K x by `geometry`
    moduli(n, parameters, history, index, places, X, u, kept)           moduli of the parent cell
    product_moduli(n, kept, index, x, y)                                y += K x by `moduli`
    product_transposed(n, kept, index, x, y)                            y += K' x by `moduli`
    diagonal(n, kept, index, y)                                         y += diagonal of K
    assembleP(n, kept, low, rows, slots, values)     B' S B with shape functions of the order P

n: elements. parameters: constants. index (n, nodes): place in u, x and y of the first unknown of a
node, x running first, then y, then z; the unknowns of a node are neighbours. Fields of lower order
have nodes of their own, behind those of the fields of higher order. places (n, nodes of the cell):
the same for its coordinates in X. history, kept: (blocks, numbers, threads with a point), x running
first in the points of an element. low (n, nodes of order P): number of the first unknown of a node.
rows: start of the row of every unknown in `values` of a CSR matrix. slots (n, nodes, nodes): place
in the row of the first unknown of the second node. sizes: + magnitudes of the residuals of the
elements; null if they are not sought.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import NDArray

from softehl.codegen import abi
from softehl.codegen.abi import TargetError, Task
from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.emit import c_runtime, simd_printer, simd_routines
from softehl.codegen.emit.c_printer import number
from softehl.codegen.emit.code_motion import Schedule
from softehl.codegen.emit.device import header
from softehl.codegen.emit.device.assembly import AssemblyLoops
from softehl.codegen.emit.device.block_sizes import (
    DOUBLE,
    SHARED,
    BlockSizes,
    Nodal,
    node_of,
    nodes_of,
)
from softehl.codegen.emit.points import parent_map, point_function, sum_factored_product
from softehl.codegen.emit.points.btab import Parent, pull_back
from softehl.codegen.emit.points.c_lines import Lines
from softehl.codegen.emit.points.loop_nest import Frame
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_layout import Needs, PointLayout
from softehl.codegen.emit.points.sum_factored_product import SymmetricTable, lagrange, sweep
from softehl.codegen.graph.graph import Routine
from softehl.codegen.language.definition import PointQuantity, functions_of_user

Part = tuple[PointOutputs, Schedule, tuple[Routine, ...]]


def require(layout: PointLayout) -> None:
    """Raise `TargetError` for a page that a device cannot run."""
    d, name = layout.d, layout.d.name
    if not sum_factored_product.has_lines(layout):
        raise TargetError(
            f"{name} on {d.cell}: a device needs quadrilaterals or hexahedra whose shape functions "
            "are products along lines, no values at the centroid and no history of terms"
        )
    if d.data or d.arrays or functions_of_user(d):
        kinds = "data of elements, tables, networks or external functions"
        raise TargetError(f"{name} has {kinds}, and a device knows parameters and history only")


def one_lane(text: str) -> str:
    """Text of lanes as functions of a device.

    C++ has no array literals: an operand of a routine becomes an array with a name.
    """
    text = re.sub(r"^static inline ", "DEVICE ", text, flags=re.MULTILINE)
    text = re.sub(r"^static (M|V|void|int|double) ", r"DEVICE \1 ", text, flags=re.MULTILINE)
    operands = re.compile(
        r"(\w+)\(([\w, ()]*?)\(const V\[\]\)\{(.*?)\}(, \w+, &failed\);)", re.DOTALL
    )
    count = 0

    def named(m: re.Match[str]) -> str:
        nonlocal count
        count += 1
        return f"const V operands{count}[] = {{{m[3]}}};\n    {m[1]}({m[2]}operands{count}{m[4]}"

    return operands.sub(named, text)


def of_reals(text: str) -> str:
    """`one_lane` in the precision of the kernels; routines for one point stay in double."""
    return one_lane(text).replace("const double", "const V")


def single_precision(text: str) -> str:
    """Floating-point literals with the suffix of single precision."""
    literal = r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)(?![\w.])"
    return re.sub(literal, r"\1f", text)


@dataclass(frozen=True, eq=False)
class DeviceKernels(BlockSizes):
    """Kernels of a layout; parts: outputs of its tasks at a point, in the printed order."""

    parts: Mapping[str, Part]

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric."""
        return self.parent.symmetric

    @cached_property
    def parent(self) -> Parent:
        """Moduli of the parent cell."""
        return Parent(self.layout, self.parts[Task.TANGENT][0])

    @cached_property
    def kept(self) -> list[str]:
        """Variables that `geometry` stores at a point."""
        D, names = range(self.D), ["w"]
        if self._positions:
            names += [f"X{i}" for i in D]
        return [f"I{k}{m}" for k in D for m in D] + names

    @cached_property
    def _positions(self) -> bool:
        """True if a point needs its coordinates."""
        of_tasks = [Needs.of(outputs.entries)["coordinates"] for outputs, *_ in self.parts.values()]
        return any(of_tasks) or self.layout.form.axisymmetric

    @cached_property
    def tables(self) -> dict[str, NDArray[np.float64]]:
        """Places of points along a line, slopes there from values there, weights."""
        rule = self.layout.d.rule
        at = [float(p[-1]) for p in rule.points[: self.q]]
        weights = np.array([float(w) for w in rule.weights]).reshape((self.q,) * self.D)
        line = weights.sum(axis=tuple(range(self.D - 1))) / 2.0 ** (self.D - 1)
        return {"points": np.array(at), "slope": lagrange(at, at)[1], "weights": line}

    def _shape(self, order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Values and slopes (points, nodes) along a line of the shape functions of an order."""
        nodes = list(np.linspace(-1.0, 1.0, order + 1)) if order else [0.0]
        if order == self.n - 1:
            nodes = sorted({float(x[0]) for x in ELEMENTS[self.layout.d.cell].nodes})
        return lagrange(nodes, list(self.tables["points"]))

    # the file -----------------------------------------------------------------------------------

    @property
    def orders(self) -> list[int]:
        """Orders with which matrices are assembled: the next one of multigrid, and the own one.

        Fields of several orders have no multigrid.
        """
        own = self.n - 1
        if len(self.fields) > 1:
            return [own] if own <= 2 else []
        next_lower = 2 if own % 2 == 0 and own > 2 else 1
        return sorted({next_lower, own}) if own <= 2 else [next_lower]

    def text(self, real: str = "double") -> str:
        """The file. real: "double" or "float"."""
        kernels = [
            self._residual(),
            self._geometry(),
            self._product(),
            self._product_geometry(),
            self._moduli(),
            self._product_moduli("product_moduli", transposed=False),
            *([] if self.symmetric else [self._product_moduli("product_transposed", True)]),
            self._diagonal(),
            *(self._assemble(order) for order in self.orders),
        ]
        d = self.layout.d
        doc = d.doc.replace("*/", "* /")
        body = "\n".join([*self._functions(), *kernels])
        if real == "float":
            body = single_precision(body)
        return (
            "/* Generated by softehl from a page; do not edit.\n"
            f"   {d.name} on {d.cell}: {doc} */\n"
            f'#define SOFTEHL_REAL {real}\n#include "{header.NAME}"\n\n{body}'
        )

    def _functions(self) -> list[str]:
        """Tables and functions in front of the kernels."""
        stem, tables = self.layout.d.name, self.tables
        orders = sorted({self.n - 1, *(f.order for f in self.fields)})
        lines = {f"to{order}": SymmetricTable(self._shape(order)[0], 1) for order in orders}
        lines["slope"] = SymmetricTable(tables["slope"], -1)
        texts = [
            of_reals(sweep(f"{abi.function_name(stem, label)}_{kind}", table, kind))
            for label, table in lines.items()
            for kind in ("forth", "back")
        ]
        called = dict.fromkeys(r for _, _, some in self.parts.values() for r in some)
        functions = [
            point_function.text(self.layout, task, outputs, plan)[0]
            for task, (outputs, plan, _) in self.parts.items()
        ]
        routines = simd_routines.texts(self.layout.site, called)
        texts += simd_printer.wrappers("".join([*routines, *functions]))
        if called:
            texts += [one_lane(t) for t in (c_runtime.LOCAL, *routines)]
        texts += map(of_reals, functions)
        weights = ", ".join(number(float(w)) for w in tables["weights"])
        texts.append(f"TABLE V weights[{self.q}] = {{{weights}}};\n")
        for order in sorted({f.order for at in self.orders for f in self._assembled(at)}):
            texts.append(_table(f"basis_of_{order}", self.basis(order)))
        return [*texts, *(t for f in self.fields for t in self._squares(f.order))]

    def basis(self, order: int) -> NDArray[np.float64]:
        """Values and parent slopes (points, nodes, 1 + D) of an order, x running first."""
        N, M = self._shape(order)
        k, D = order + 1, self.D
        q = np.unravel_index(np.arange(self.points), (self.q,) * D)
        a = np.unravel_index(np.arange(k**D), (k,) * D)
        values = [N[np.ix_(q[D - 1 - i], a[D - 1 - i])] for i in range(D)]
        slopes = [M[np.ix_(q[D - 1 - i], a[D - 1 - i])] for i in range(D)]
        columns = [np.prod(values, axis=0)]
        for m in range(D):
            columns.append(np.prod([slopes[i] if i == m else values[i] for i in range(D)], axis=0))
        return np.stack(columns, axis=-1)

    def _squares(self, order: int) -> Iterable[str]:
        """Functions that sum products of shape functions, and slopes, along a line to the nodes."""
        N, M = self._shape(order)
        for kind, table in (("NN", N * N), ("MM", M * M), ("NM", N * M)):
            lines = [f"    const V a{k} = a[{k} * step];" for k in range(self.q)]
            for i in range(order + 1):
                terms = [f"{number(float(table[k, i]))} * a{k}" for k in range(self.q)]
                lines.append(f"    b[{i} * step] = {' + '.join(terms)};")
            head = "const V *restrict a, V *restrict b, const int step"
            body = "\n".join(lines)
            yield f"DEVICE void squares_{kind}{order}({head})\n{{\n{body}\n}}\n"

    def _kernel(self, name: str, arguments: str, out: Lines) -> str:
        body = "\n".join(out.lines)
        word = "KERNEL_LARGE" if name in self._large else "KERNEL"
        return f"{word}({name}, {self.threads}, int n, {arguments})\n{{\n    BLOCK\n{body}\n}}\n"

    @cached_property
    def _large(self) -> set[str]:
        """Kernels that may use all registers of a multiprocessor for one block of threads.

        Those with moduli at the point, and all of a law with routines: with half of the registers
        they would spill into memory.
        """
        large = {"moduli", *(f"assemble{order}" for order in self.orders)}
        calls = any(called for _, _, called in self.parts.values())
        return large | ({"residual", "product", "product_geometry"} if calls else set())

    # pieces of a kernel -------------------------------------------------------------------------

    def _shared(self, out: Lines, components: int | None = None) -> None:
        full = (components or self.C) * self.elements * self.size
        out.add(f"SHARED V s0[{full}], s1[{full}], sl[{self.D * full}];")

    def _step(self, axis: int) -> int:
        """Distance of neighbours along an axis in shared memory."""
        return (1, self.row, self.row * self.m)[axis]

    def _lines(
        self, out: Lines, function: str, source: str, target: str, axis: int, f: Nodal
    ) -> None:
        """Apply a function to all lines of components along an axis, from an array to another."""
        m, others = self.m, [self._step(a) for a in range(self.D) if a != axis]
        each = m ** (self.D - 1)
        out.open(f"THREADS(l, {f.count * self.elements * each}, {self.threads})")
        places = [f"l / {m**k} % {m} * {step}" for k, step in enumerate(others)]
        if f.first:
            places.append(str(f.first * self.elements * self.size))
        out.add(f"const int at = l / {each} * {self.size} + {' + '.join(places)};")
        out.add(f"{function}(&{source}[at], &{target}[at], {self._step(axis)});")
        out.close()

    def _sweeps(self, out: Lines, kind: str, axes: Iterable[int], fields: Sequence[Nodal]) -> None:
        """All directions, one after the other, from s0; the last array is `_last`."""
        names = ["s0", "s1"]
        for axis in axes:
            for f in fields:
                function = abi.function_name(self.layout.d.name, f"to{f.order}_{kind}")
                self._lines(out, function, names[0], names[1], axis, f)
            out.add("SYNC")
            names.reverse()

    @property
    def _last(self) -> str:
        """Array after sweeps along all directions."""
        return "s1" if self.D % 2 else "s0"

    def _done_with_values(self, out: Lines, *, read: bool) -> None:
        """A barrier between values that are read at the points and a vector that is written there.

        A thread reads and writes the same places where there are as many nodes as points.
        """
        if read and self._last == "s0" and {f.n for f in self.fields} != {self.q}:
            out.add("SYNC")

    def _position(self, out: Lines, width: int, letter: str) -> None:
        """Place `at` in shared memory of the entry `letter` of an element, x running first."""
        axes = range(self.D)
        places = [f"{letter} / {width**k} % {width} * {self._step(k)}" for k in axes]
        out.add(f"const int at = e * {self.size} + {' + '.join(places)};")

    def _to_points(self, out: Lines, vector: str, index: str, fields: Sequence[Nodal]) -> None:
        """Values of a vector from the nodes to the points, in `_last`, and slopes there, in sl."""
        every = Nodal(self.n - 1, 0, fields[-1].last)
        full, total = every.last * self.elements * self.size, nodes_of(fields, self.D)
        for f in fields:
            self._nodes_of(out, f)
            element = f"block * {self.elements} + e"
            place = f"{index}[({element}) * {total} + {node_of(f, 'a')}]"
            out.add(f"const int from = {element} < n ? {place} : -1;")
            for c in range(f.first, f.last):
                value = f"{vector}[from + {c - f.first}]"
                out.add(f"s0[{c * self.elements * self.size} + at] = from < 0 ? 0 : {value};")
            out.close()
        out.add("SYNC")
        self._sweeps(out, "forth", range(self.D), fields)
        function = abi.function_name(self.layout.d.name, "slope_forth")
        for axis in range(self.D):
            self._lines(out, function, self._last, f"(sl + {axis * full})", axis, every)
        out.add("SYNC")

    def _nodes_of(self, out: Lines, f: Nodal) -> None:
        """Open a loop over the nodes of an order of all elements."""
        nodes = f.n**self.D
        out.open(f"THREADS(l, {self.elements * nodes}, {self.threads})")
        out.add(f"const int e = l / {nodes}, a = l % {nodes};")
        self._position(out, f.n, "a")

    def _from_points(self, out: Lines, result: str, sizes: str = "") -> None:
        """Fluxes in sl, and of values in s0, to the nodes, added to a vector."""
        full, name = self.C * self.elements * self.size, self.layout.d.name
        for axis in range(self.D):
            if axis:
                out.add("SYNC")  # two threads may add to one place
            function = abi.function_name(name, "slope_back")
            for f in self.fields:
                self._lines(out, function, f"(sl + {axis * full})", "s0", axis, f)
        # no barrier: the next sweep has the same lines on the same threads
        self._sweeps(out, "back", reversed(range(self.D)), self.fields)
        self._to_nodes(out, result, self._last, sizes)

    def _to_nodes(self, out: Lines, result: str, source: str, sizes: str = "") -> None:
        """Values at the nodes in an array, added to a vector, and their magnitudes to another."""
        for f in self.fields:
            self._nodes_of(out, f)
            out.open(f"if (block * {self.elements} + e < n)")
            place = f"(block * {self.elements} + e) * {self.nodes} + {node_of(f, 'a')}"
            out.add(f"const int to = index[{place}];")
            for c in range(f.first, f.last):
                value = f"{source}[{c * self.elements * self.size} + at]"
                out.add(f"ADD({result} + to + {c - f.first}, {value});")
                if sizes:
                    out.add(f"if ({sizes}) ADD({sizes} + to + {c - f.first}, fabs({value}));")
            out.close()
            out.close()

    def _own(self, out: Lines) -> None:
        """The point of a thread."""
        out.open(f"OWN(t, {self.owners})")
        out.add(f"const int e = t / {self.points}, q = t % {self.points};")
        self._position(out, self.q, "q")
        out.add("(void)at, (void)q;")

    def _slope(self, c: int, axis: int, components: int | None = None) -> str:
        offset = (axis * (components or self.C) + c) * self.elements * self.size
        return f"sl[{offset} + at]"

    def _value(self, c: int) -> str:
        return f"{self._last}[{c * self.elements * self.size} + at]"

    def _map(self, out: Lines) -> None:
        """Variables of `kept` from coordinates that stand at the points."""
        for i in range(self.D):
            for m in range(self.D):
                out.add(f"const V J{i}{m} = {self._slope(i, m, self.D)};")
        frame = Frame(self.layout, Task.RESIDUAL, self.parts[Task.RESIDUAL][0])
        frame.out = out
        parent_map.write_inverse(frame)
        if self._positions:
            for i in range(self.D):
                out.add(f"const V X{i} = {self._value(i)};")
        ring = " * ((V)6.283185307179586 * X1)" if self.layout.form.axisymmetric else ""
        weights = [f"weights[q / {self.q**k} % {self.q}]" for k in range(self.D)]
        out.add(f"const V w = det * {' * '.join(weights)}{ring};")

    def _of_state(self, out: Lines, task: str, *, kept: bool) -> Needs:
        """Map and fields of the state at every point, in arrays of its thread."""
        needs = Needs.of(self.parts[task][0].entries)
        out.add(f"OWNED(V, frame, {len(self.kept)}, {self.owners});")
        out.add(f"OWNED(V, state, {max(len(needs['dofs']), 1)}, {self.owners});")
        if kept:
            out.open(f"OWN(t, {self.owners})")
            out.add(f"const V *const from = {self._at_points('kept', len(self.kept))};")
            for k in range(len(self.kept)):
                out.add(f"MINE(frame, t)[{k}] = from[{k * self.owners}];")
            out.close()
        else:
            self._to_points(out, "X", "places", self._coordinates)
            self._own(out)
            self._map(out)
            for k, name in enumerate(self.kept):
                out.add(f"MINE(frame, t)[{k}] = {name};")
            out.close()
            self._done_with_values(out, read=self._positions)
        self._to_points(out, "u", "index", self.fields)
        return needs

    def _at_points(self, array: str, count: int) -> str:
        """Place of the numbers of a thread's point."""
        return f"{array} + (long long)block * {count * self.owners} + t"

    def _frame(self, out: Lines) -> None:
        """Variables of the map from the array of the thread."""
        for k, name in enumerate(self.kept):
            out.add(f"const V {name} = MINE(frame, t)[{k}];")
        out.add(" ".join(f"(void){name};" for name in self.kept))

    def _fields(self, out: Lines, target: str, numbers: Iterable[int]) -> None:
        """Fields and gradients at the point; target: format of an entry by its number."""
        components = {c: k for k, c in enumerate(self.components)}
        for k in numbers:
            quantity = self.layout.form.all[k]
            c = components[quantity.component]
            terms = [f"{self._slope(c, m)} * I{m}{quantity.axis}" for m in range(self.D)]
            value = self._value(c) if quantity.axis is None else " + ".join(terms)
            out.add(f"{target.format(k)} = {value};")

    def _arguments(self, out: Lines, task: str, needs: Needs) -> None:
        """Arrays of the function of the point, but its fields."""
        outputs, d = self.parts[task][0], self.layout.d
        sizes = {
            "x": self.D,
            "g": len(self.layout.form.all),
            "b": len(d.point_data),
            "v": 1 + max([*needs["direction"], 0]),
            "P": len(outputs.rows),
            "A": len(outputs.moduli),
        }
        arrays = ", ".join(f"{name}[{max(size, 1)}]" for name, size in sizes.items())
        out.add(f"V {arrays};")
        out.add("(void)x;")
        for k in needs["coordinates"]:
            out.add(f"x[{k}] = X{k};")
        if needs["point data"]:
            out.add(f"const V *const past = {self._at_points('history', len(d.point_data))};")
            for k in needs["point data"]:
                out.add(f"b[{k}] = past[{k * self.owners}];")

    def _call(self, out: Lines, task: str) -> None:
        function = point_function.name(self.layout, task)
        out.add(f"const M failed = {function}(parameters, x, g, (const V *)0, b, v, P, A);")

    def _fluxes(self, out: Lines) -> None:
        """Fluxes at the point overwrite the arrays; all are not-a-number where it has failed."""
        places = {q: f"P[{k}]" for k, q in enumerate(self.layout.form.unknowns)}
        out.add("const V volume = failed ? (V)NAN : w;")
        for k, c in enumerate(self.components):
            value = places.get(PointQuantity(c, None))
            text = f"volume * {value}" if value else "0"
            out.add(f"s0[{k * self.elements * self.size} + at] = {text};")
            of_slopes = {q.axis: v for q, v in places.items() if q.component == c}
            of_slopes.pop(None, None)
            for m in range(self.D):
                total = " + ".join(f"{v} * I{m}{axis}" for axis, v in of_slopes.items())
                flux = f"volume * ({total})" if of_slopes else "0"
                out.add(f"{self._slope(k, m)} = {flux};")

    # kernels ------------------------------------------------------------------------------------

    def _residual(self) -> str:
        out = Lines()
        self._shared(out, max(self.C, self.D))
        needs = self._of_state(out, Task.RESIDUAL, kept=False)
        self._own(out)
        self._frame(out)
        self._arguments(out, Task.RESIDUAL, needs)
        self._fields(out, "g[{}]", needs["dofs"])
        self._call(out, Task.RESIDUAL)
        self._fluxes(out)
        out.close()
        out.add("SYNC")
        self._from_points(out, "y", sizes="sizes")
        return self._kernel("residual", _OF_STATE + "V *restrict sizes, V *restrict y", out)

    def _geometry(self) -> str:
        out = Lines()
        self._shared(out, self.D)
        self._to_points(out, "X", "places", self._coordinates)
        self._own(out)
        self._map(out)
        out.add(f"V *const to = {self._at_points('kept', len(self.kept))};")
        for k, name in enumerate(self.kept):
            out.add(f"to[{k * self.owners}] = {name};")
        out.close()
        arguments = "const int *restrict places, const V *restrict X, V *restrict kept"
        return self._kernel("geometry", arguments, out)

    def _product(self) -> str:
        out = Lines()
        self._shared(out, max(self.C, self.D))
        self._product_at(out, kept=False)
        return self._kernel("product", _OF_STATE + "const V *restrict x, V *restrict y", out)

    def _product_geometry(self) -> str:
        out = Lines()
        self._shared(out)
        self._product_at(out, kept=True)
        arguments = (
            "const V *restrict parameters, const V *restrict history, const int *restrict index, "
            "const V *restrict kept, const V *restrict u, const V *restrict x, V *restrict y"
        )
        return self._kernel("product_geometry", arguments, out)

    def _product_at(self, out: Lines, *, kept: bool) -> None:
        needs = self._of_state(out, Task.PRODUCT, kept=kept)
        self._own(out)
        self._frame(out)
        for n, k in enumerate(needs["dofs"]):
            self._fields(out, f"MINE(state, t)[{n}]", [k])
        out.close()
        form = self.layout.form
        self._done_with_values(out, read=any(form.all[k].axis is None for k in needs["dofs"]))
        self._to_points(out, "x", "index", self.fields)
        self._own(out)
        self._frame(out)
        self._arguments(out, Task.PRODUCT, needs)
        for n, k in enumerate(needs["dofs"]):
            out.add(f"g[{k}] = MINE(state, t)[{n}];")
        self._fields(out, "v[{}]", needs["direction"])
        self._call(out, Task.PRODUCT)
        self._fluxes(out)
        out.close()
        out.add("SYNC")
        self._from_points(out, "y")

    def _moduli(self) -> str:
        out = Lines()
        self._shared(out, max(self.C, self.D))
        needs = self._of_state(out, Task.TANGENT, kept=False)
        self._own(out)
        self._frame(out)
        self._arguments(out, Task.TANGENT, needs)
        self._fields(out, "g[{}]", needs["dofs"])
        self._call(out, Task.TANGENT)
        out.add(f"V *const to = {self._at_points('kept', self.parent.size)};")
        out.add("const V spoilt = failed ? (V)NAN : (V)0;")
        pulled = Lines(depth=out.depth)
        pull_back(pulled, self.layout, self.parts[Task.TANGENT][0])
        text = "\n".join(pulled.lines)

        def place(m: re.Match[str]) -> str:
            return f"to[{int(m[1]) * self.owners}] = spoilt + "

        out.lines.append(re.sub(r"S\[q\]\[(\d+)\] = ", place, text))
        out.close()
        return self._kernel("moduli", _OF_STATE + "V *restrict kept", out)

    def _product_moduli(self, name: str, transposed: bool) -> str:
        out, parent = Lines(), self.parent
        self._shared(out)
        self._to_points(out, "x", "index", self.fields)
        self._own(out)
        out.add(f"const V *const from = {self._at_points('kept', parent.size)};")
        components = {c: k for k, c in enumerate(self.components)}
        label = {
            q: f"{components[q.component]}{'v' if q.axis is None else q.axis}"
            for q in parent.quantities
        }
        for q, text in label.items():
            c = components[q.component]
            value = self._value(c) if q.axis is None else self._slope(c, q.axis)
            out.add(f"const V d{text} = {value};")
            out.add(f"V f{text} = 0;")
        for pair, k in parent.numbers.items():
            row, column = pair[::-1] if transposed else pair
            out.open("")
            out.add(f"const V s = from[{k * self.owners}];")
            out.add(f"f{label[row]} += s * d{label[column]};")
            if parent.symmetric and row != column:
                out.add(f"f{label[column]} += s * d{label[row]};")
            out.close()
        for component, k in components.items():
            of_value = label.get(PointQuantity(component, None))
            flux = f"f{of_value}" if of_value else "0"
            out.add(f"s0[{k * self.elements * self.size} + at] = {flux};")
            for m in range(self.D):
                of_slope = label.get(PointQuantity(component, m))
                out.add(f"{self._slope(k, m)} = {f'f{of_slope}' if of_slope else '0'};")
        out.close()
        out.add("SYNC")
        self._from_points(out, "y")
        arguments = (
            "const V *restrict kept, const int *restrict index, const V *restrict x, V *restrict y"
        )
        return self._kernel(name, arguments, out)

    def _diagonal(self) -> str:
        """Sums over the points of products of shape functions and slopes with moduli."""
        out, parent = Lines(), self.parent
        self._shared(out)
        full = self.C * self.elements * self.size
        groups: dict[tuple[int | None, int | None], list[tuple[int, str]]] = {}
        axes: list[int | None] = [None, *range(self.D)]
        for c, k in ((c, k) for k, c in enumerate(self.components)):
            for a, b in combinations_with_replacement(axes, 2):
                pairs = {(a, b), (b, a)}
                numbers = [
                    parent.number(PointQuantity(c, i), PointQuantity(c, j)) for i, j in pairs
                ]
                terms = [f"from[{i * self.owners}]" for i in numbers if i is not None]
                if terms:
                    groups.setdefault((a, b), []).append((k, " + ".join(terms)))
        out.open(f"THREADS(l, {full}, {self.threads})")
        out.add("sl[l] = 0;")
        out.close()
        for number_of_group, ((a, b), entries) in enumerate(groups.items()):
            if number_of_group and self._last == "s0":
                out.add("SYNC")  # the last sums have been read from it
            self._own(out)
            out.add(f"const V *const from = {self._at_points('kept', parent.size)};")
            values = dict(entries)
            for k in range(self.C):
                text = values.get(k, "0")
                out.add(f"s0[{k * self.elements * self.size} + at] = {text};")
            out.close()
            out.add("SYNC")
            names = ["s0", "s1"]
            for axis in range(self.D):
                kind = ("NN", "NM", "MM")[(a == axis) + (b == axis)]
                for f in self.fields:
                    function = f"squares_{kind}{f.order}"
                    self._lines(out, function, names[0], names[1], axis, f)
                out.add("SYNC")
                names.reverse()
            out.open(f"THREADS(l, {full}, {self.threads})")
            out.add(f"sl[l] += {self._last}[l];")
            out.close()
        out.add("SYNC")
        self._to_nodes(out, "y", "sl")
        return self._kernel(
            "diagonal", "const V *restrict kept, const int *restrict index, V *restrict y", out
        )

    def _assembled(self, order: int) -> list[Nodal]:
        """Fields of a matrix of an order."""
        return self.fields if len(self.fields) > 1 else [Nodal(order, 0, self.C)]

    def _assemble(self, order: int) -> str:
        """B' S B of some elements at a time; a thread has a column of an element, or a part."""
        out, fields = Lines(), self._assembled(order)
        wide = self.parent.size | 1
        each = max(1, min(self.elements, SHARED // (DOUBLE * wide * self.points)))
        slice_points = self.points
        while DOUBLE * wide * slice_points * each > SHARED:  # the points in slices, of one element
            slice_points = -(-slice_points // 2)
        out.add(f"SHARED V S[{each * slice_points}][{wide}];")
        for rows, columns in product(fields, repeat=2):
            AssemblyLoops(self, self.parent, out, fields, rows, columns, each, slice_points).write()
        arguments = (
            "const V *restrict kept, const int *restrict low, const int *restrict rows, "
            "const unsigned short *restrict slots, V *restrict values"
        )
        return self._kernel(f"assemble{order}", arguments, out)


_OF_STATE = (
    "const V *restrict parameters, const V *restrict history, const int *restrict index, "
    "const int *restrict places, const V *restrict X, const V *restrict u, "
)


def _table(name: str, values: NDArray[np.float64]) -> str:
    """A constant array of three indices."""
    rows = ",\n".join(
        "{" + ", ".join("{" + ", ".join(number(float(v)) for v in r) + "}" for r in point) + "}"
        for point in values
    )
    size = "".join(f"[{k}]" for k in values.shape)
    return f"TABLE V {name}{size} = {{\n{rows}}};\n"
