"""The tangent times a vector by sum factorisation, without a matrix: `keep` and `action`.

On quadrilaterals and hexahedra of any order, for models whose fields have the order of the cell.
`keep` computes once a state the cache of a product at every quadrature point (`PointCache`): the
inverse Jacobian, the volume, and the inputs of the function of the point (gradients, data,
history). `action` adds the product for a range of elements: values from the nodes to the points,
one direction after the other, gradients there, fluxes, and all of it back.

    void softehl_NAME_keep(...)      as a task; values (n, points, kept), n a multiple of 8
    void softehl_NAME_action(ptrdiff_t first, ptrdiff_t last, const double *parameters,
        const double *kept, const int *index, const double *x, double *y)

first, last: elements, multiples of 8. kept: by groups of lanes, [group][point][number][lane].
index: that in x of the first unknown of nodes with x running first, then y, then z, by groups of
8 elements: [group][node][element]. x, y: unknowns of a node are neighbours, in the order of the
model; behind the last one of x stand 3 numbers that are read and not used.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.emit import c_source
from softehl.codegen.emit.c_printer import number
from softehl.codegen.emit.code_motion import Schedule
from softehl.codegen.emit.points import cell_constants, parent_map, point_function
from softehl.codegen.emit.points.c_lines import Lines, load
from softehl.codegen.emit.points.loop_nest import Frame, components, products
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_inputs import PointInputs
from softehl.codegen.emit.points.point_layout import PointLayout
from softehl.codegen.language.definition import Component, PointQuantity


@dataclass(frozen=True, eq=False)
class PointCache:
    """The inverse Jacobian, the volume, and the inputs of the function of the point."""

    layout: PointLayout
    outputs: PointOutputs

    @cached_property
    def frame(self) -> Frame:
        """Loop nest whose inputs are cached."""
        return Frame(self.layout, Task.PRODUCT, self.outputs)

    @property
    def names(self) -> list[str]:
        """Variables of C that are cached at a point."""
        D, needs = range(self.layout.dimension), self.frame.needs
        cached = [f"I{k}{m}" for k in D for m in D] + ["w"]
        for array, letter in point_function.ARRAYS.items():
            if array != "direction":
                cached += [f"{letter}[{k}]" for k in needs[array]]
        return cached

    def text(self) -> str:
        """The task in C: a function for one group of lanes, and one over all groups."""
        f = self.frame
        f.out, d = Lines(), self.layout.d
        out, count, points = f.out, len(self.names), self.layout.points
        sizes = {
            "xs": ("X", d.coordinate_width, f.widths["coordinates"]),
            "us": ("d", len(d.unknowns), f.widths["dofs"]),
            "es": ("a", len(d.data), f.widths["data"]),
        }
        out.add(f"enum {{ points = {points} }};")
        for array, (start, size, width) in sizes.items():
            if size:
                out.add(f"V {array}[{size}];")
                load(out, array, start, size, width)
                out.idle([array])
        out.open(f"for (int q = 0; q < {points}; ++q)")
        products(f)
        parent_map.write(f)
        PointInputs(f).write(direction=False)
        out.idle(["x", "g", "e", "b"])
        out.add(f"softehl_wide *const to = (softehl_wide *)R + {count} * q;")
        for k, value in enumerate(self.names):
            out.add(f"to[{k}] = {value};")
        out.close()
        name, body = abi.function_name(d.name, "keep"), "\n".join(out.lines)
        moved = {"X": f.widths["coordinates"], "d": f.widths["dofs"], "a": f.widths["data"]}
        arrays = {"X": "coordinates", "d": "dofs", "a": "data"}
        arguments = [f"{arrays[k]} + {w} * e" if w != "0" else "0" for k, w in moved.items()]
        return (
            f"static void {name}_group(const double *restrict X, const double *restrict d,\n"
            "    const double *restrict a, const double *restrict parameters, double *restrict R)\n"
            f"{{\n    (void)X, (void)d, (void)a, (void)parameters;\n{body}\n}}\n\n"
            f"{abi.declaration(d.name, 'keep')};\n{abi.declaration(d.name, 'keep')}\n{{\n"
            "    (void)points, (void)modes, (void)data, (void)direction, (void)rule, (void)basis;\n"
            "    (void)tangent;\n"
            "    for (ptrdiff_t e = 0; e < n; e += SOFTEHL_LANES)\n"
            f"        {name}_group({', '.join(arguments)}, "
            f"parameters, values + {count * points} * e);\n}}\n"
        )


GROUP = 8
"""Elements whose node numbers stand together, whatever the lanes of the processor."""

SUPPORT = r"""
#if SOFTEHL_LANES > 1
typedef double softehl_wide __attribute__((vector_size(8 * SOFTEHL_LANES), aligned(8)));
typedef double softehl_two __attribute__((vector_size(16), aligned(8)));

#if SOFTEHL_LANES == 8
#define SOFTEHL_ROWS(x, at, l) __builtin_shufflevector( \
    *(const softehl_row *)((x) + (at)[l]), *(const softehl_row *)((x) + (at)[(l) + 4]), \
    0, 1, 2, 3, 4, 5, 6, 7)
#define SOFTEHL_HALVES 2
#define softehl_part(v, h) ((h) ? __builtin_shufflevector(v, v, 4, 5, 6, 7) \
    : __builtin_shufflevector(v, v, 0, 1, 2, 3))
#else
#define SOFTEHL_ROWS(x, at, l) (*(const softehl_row *)((x) + (at)[l]))
#define SOFTEHL_HALVES 1
#define softehl_part(v, h) (v)
#endif

/* Four values from the place of every lane on. */
static inline void softehl_take(const double *x, const int *at, V *a, V *b, V *c, V *d)
{
    *a = SOFTEHL_ROWS(x, at, 0);
    *b = SOFTEHL_ROWS(x, at, 1);
    *c = SOFTEHL_ROWS(x, at, 2);
    *d = SOFTEHL_ROWS(x, at, 3);
    softehl_transpose(a, b, c, d);
}

/* Add `count` of the four values to the place of every lane. */
static inline void softehl_give(double *y, const int *at, const int count, V a, V b, V c, V d)
{
    softehl_transpose(&a, &b, &c, &d);
    const V rows[4] = {a, b, c, d};
#pragma GCC unroll 2
    for (int h = 0; h < SOFTEHL_HALVES; ++h) {
#pragma GCC unroll 4
        for (int l = 0; l < 4; ++l) {
            const softehl_four row = softehl_part(rows[l], h);
            double *const to = y + at[4 * h + l];
            if (count == 4) *(softehl_row *)to += row;
            if (count == 2 || count == 3)
                *(softehl_two *)to += __builtin_shufflevector(row, row, 0, 1);
            if (count == 3) to[2] += row[2];
            if (count == 1) to[0] += row[0];
        }
    }
}
#else
typedef double softehl_wide;

static inline void softehl_take(const double *x, const int *at, V *a, V *b, V *c, V *d)
{
    const double *const from = x + at[0];
    *a = from[0], *b = from[1], *c = from[2], *d = from[3];
}

static inline void softehl_give(double *y, const int *at, const int count, V a, V b, V c, V d)
{
    double *const to = y + at[0];
    const V row[4] = {a, b, c, d};
    for (int k = 0; k < count; ++k) to[k] += row[k];
}
#endif
"""


def gather(components: int, nodes: int) -> list[str]:
    """Lines that take values of the nodes to u[component][node], and call for those of `next`."""
    lines = ["V idle[4];", "(void)idle;"]
    lines.append(f"for (int a = 0; a < {nodes}; ++a) {{")
    for first in range(0, components, 4):
        names = [
            f"&u[{c}][a]" if c < components else f"&idle[{c - first}]"
            for c in range(first, first + 4)
        ]
        lines.append(f"    softehl_take(x + {first}, index + {GROUP} * a, {', '.join(names)});")
    lines.append("    for (int l = 0; l < SOFTEHL_LANES; ++l) {")
    for array in ("x", "y"):
        lines.append(f"        __builtin_prefetch({array} + next[{GROUP} * a + l]);")
    return [*lines, "    }", "}"]


def scatter(components: int, nodes: int) -> list[str]:
    """Lines that add u[component][node] to the nodes."""
    lines = [f"for (int a = 0; a < {nodes}; ++a) {{"]
    for first in range(0, components, 4):
        count = min(4, components - first)
        names = [f"u[{first + min(k, count - 1)}][a]" for k in range(4)]
        lines.append(
            f"    softehl_give(y + {first}, index + {GROUP} * a, {count}, {', '.join(names)});"
        )
    return [*lines, "}"]


def fits(layout: PointLayout) -> bool:
    """True if a model has a product by sum factorisation on its cell."""
    return has_lines(layout) and {c.order for c in layout.components} == {layout.geometry.order}


def has_lines(layout: PointLayout) -> bool:
    """True if sums over the points of the cell go along lines, and no value is at the centroid."""
    shape, cell = layout.geometry, layout.d.cell
    if layout.form.centroid or layout.d.term_history:
        return False
    if shape.line is None or not cell.startswith(("quad", "hex")) or layout.dimension < 2:
        return False
    return len(shape.line.values) >= len(shape.line.values[0])


@dataclass(frozen=True, eq=False)
class Factored:
    """The functions of a model whose product at a point has these outputs."""

    layout: PointLayout
    outputs: PointOutputs
    plan: Schedule

    def text(self, preamble: list[str], coarse: str) -> str:
        """C file. preamble: routines that the functions of the point call. coarse: functions
        that stand behind the product.
        """
        point, _ = point_function.text(self.layout, Task.PRODUCT, self.outputs, self.plan)
        keep, action = self.cache.text(), self._action()
        tables = cell_constants.used(self.layout, keep)
        pieces = [self._tables_of_lines(), point, keep, action, coarse]
        return c_source.source(self.layout.d, pieces, [*preamble, SUPPORT, *tables])

    @cached_property
    def cache(self) -> PointCache:
        """The variables that a product needs at a point."""
        return PointCache(self.layout, self.outputs)

    # the product --------------------------------------------------------------------------------

    @property
    def _sizes(self) -> tuple[int, int]:
        """Nodes and points along a line."""
        line = self.layout.geometry.line
        assert line is not None
        return len(line.values[0]), len(line.values)

    @cached_property
    def _tables(self) -> dict[str, SymmetricTable]:
        """to: from nodes to points. slope: derivatives at points from values there."""
        rule, D = self.layout.d.rule, self.layout.dimension
        n, count = self._sizes
        at = [float(p[-1]) for p in rule.points[:count]]
        cell = sorted({float(node[0]) for node in ELEMENTS[self.layout.d.cell].nodes})
        assert len(cell) == n
        assert len(rule.points) == count**D
        to, slope = lagrange(cell, at)[0], lagrange(at, at)[1]
        return {"to": SymmetricTable(to, 1), "slope": SymmetricTable(slope, -1)}

    def _tables_of_lines(self) -> str:
        return "\n".join(
            sweep(f"{abi.function_name(self.layout.d.name, label)}_{kind}", table, kind)
            for label, table in self._tables.items()
            for kind in ("forth", "back")
        )

    def _action(self) -> str:
        out, D, d = Lines(), self.layout.dimension, self.layout.d
        n, q = self._sizes
        C, big = len(self.layout.components), max(n, q) ** D
        out.add(f"V u[{C}][{big}], other[{big}], slopes[{C}][{D}][{q**D}];")
        out.add("M failed = softehl_mask(0);")
        for line in gather(C, n**D):
            out.add(line)
        out.open(f"for (int c = 0; c < {C}; ++c)")
        self._sweeps(out, "to", "forth", range(D))
        for axis in range(D):
            self._sweep(out, "slope", "forth", ("u[c]", f"slopes[c][{axis}]"), (q,) * D, axis)
        out.close()
        self._points(out, q**D)
        out.open(f"for (int c = 0; c < {C}; ++c)")
        if not self._of_values:
            out.add(f"for (int q = 0; q < {q**D}; ++q) u[c][q] = softehl_splat(0.0);")
        for axis in range(D):
            self._sweep(out, "slope", "back", (f"slopes[c][{axis}]", "u[c]"), (q,) * D, axis)
        self._sweeps(out, "to", "back", reversed(range(D)))
        out.add(f"if (softehl_any(failed)) for (int a = 0; a < {n**D}; ++a)")
        out.add("    u[c][a] = softehl_blend(failed, softehl_splat(NAN), u[c][a]);")
        out.close()
        for line in scatter(C, n**D):
            out.add(line)
        name, body = abi.function_name(d.name, "action"), "\n".join(out.lines)
        step = len(self.cache.names) * q**D
        arguments = (
            "ptrdiff_t first, ptrdiff_t last, const double *restrict parameters,\n"
            "    const double *restrict kept, const int *restrict index, const double *restrict x,"
            "\n    double *restrict y"
        )
        return (
            f"static void {name}_group(const double *restrict parameters,\n"
            "    const softehl_wide *restrict kept, const int *restrict index,\n"
            "    const int *restrict next, const double *restrict x, double *restrict y)\n"
            f"{{\n    (void)parameters;\n{body}\n}}\n\n"
            f"void {name}({arguments});\nvoid {name}({arguments})\n{{\n"
            "    for (ptrdiff_t e = first; e < last; e += SOFTEHL_LANES) {\n"
            f"        const int *const here = {self._numbers('e')};\n"
            "        const ptrdiff_t after = e + SOFTEHL_LANES < last ? e + SOFTEHL_LANES : e;\n"
            f"        const int *const next = {self._numbers('after')};\n"
            f"        {name}_group(parameters, (const softehl_wide *)(kept + {step} * e), here, "
            "next, x, y);\n    }\n}\n"
        )

    def _numbers(self, e: str) -> str:
        """Numbers of the nodes of a group of lanes."""
        count = self._sizes[0] ** self.layout.dimension
        return f"index + {count} * ({e} - {e} % {GROUP}) + {e} % {GROUP}"

    def _sweeps(self, out: Lines, table: str, kind: str, axes: object) -> None:
        """All directions, from u[c] to u[c]."""
        n, q = self._sizes
        sizes = [n if kind == "forth" else q] * self.layout.dimension
        names = ["u[c]", "other"]
        for axis in axes:  # type: ignore[attr-defined]
            self._sweep(out, table, kind, (names[0], names[1]), tuple(sizes), axis)
            sizes[axis] = q if kind == "forth" else n
            names.reverse()
        if names[0] == "other":
            count = int(np.prod(sizes))
            out.add(f"for (int k = 0; k < {count}; ++k) u[c][k] = other[k];")

    def _sweep(
        self,
        out: Lines,
        table: str,
        kind: str,
        arrays: tuple[str, str],
        sizes: tuple[int, ...],
        axis: int,
    ) -> None:
        """One direction: every line along it from one array to another."""
        name = f"{abi.function_name(self.layout.d.name, table)}_{kind}"
        n, q = self._sizes
        new = sizes[axis] if table == "slope" else (q if kind == "forth" else n)
        step, lines = int(np.prod(sizes[:axis])), int(np.prod(sizes[axis + 1 :]))
        out.open(f"for (int j = 0; j < {lines}; ++j)")
        out.add(f"for (int i = 0; i < {step}; ++i)")
        out.add(
            f"    {name}(&{arrays[0]}[{step * sizes[axis]} * j + i], "
            f"&{arrays[1]}[{step * new} * j + i], {step});"
        )
        out.close()

    @property
    def _of_values(self) -> bool:
        """True if some fluxes are conjugate to values."""
        return any(q.axis is None for q in self.layout.form.unknowns)

    def _points(self, out: Lines, points: int) -> None:
        """Emit fluxes at each point; they overwrite the gradient buffer."""
        layout, D, count = self.layout, self.layout.dimension, len(self.cache.names)
        f = self.cache.frame
        out.open(f"for (int q = 0; q < {points}; ++q)")
        out.add(f"const softehl_wide *const from = kept + {count} * q;")
        out.add(f"for (int k = 0; k < {count}; ++k)")
        out.add(f"    __builtin_prefetch(from + {count * points} + k);")
        # the rule has its first direction outermost, arrays have it innermost
        out.add(f"const int p = {self._position()};")
        sizes = {"X": D, "g": len(layout.form.all), "e": len(layout.site.data)}
        sizes["b"] = len(layout.d.point_data)
        sizes["t"] = 1 + max([*f.needs["direction"], 0])
        sizes["P"], sizes["A"] = max(len(self.outputs.rows), 1), 1
        for letter, size in sizes.items():
            out.add(f"V {letter}[{max(size, 1)}];")
        for k, value in enumerate(self.cache.names):
            value = value.replace("x[", "X[")  # x is the vector here
            kind = "" if "[" in value else "const V "
            out.add(f"{kind}{value} = from[{k}];")
        number = {c: k for k, c in enumerate(layout.components)}
        for k in f.needs["direction"]:
            quantity = layout.form.all[k]
            c = number[quantity.component]
            terms = [f"slopes[{c}][{m}][p] * I{m}{quantity.axis}" for m in range(D)]
            value = f"u[{c}][p]" if quantity.axis is None else " + ".join(terms)
            out.add(f"t[{k}] = {value};")
        call = point_function.name(layout, Task.PRODUCT)
        out.add(f"failed |= {call}(parameters, X, g, e, b, t, P, A);")
        self._fluxes(out, number, D)
        out.close()

    def _position(self) -> str:
        D, q = self.layout.dimension, self._sizes[1]
        terms = [f"q / {q ** (D - 1 - k)} % {q} * {q**k}" for k in range(D)]
        return " + ".join(terms)

    def _fluxes(self, out: Lines, number: dict[Component, int], D: int) -> None:
        entries = {quantity: f"P[{k}]" for k, quantity in enumerate(self.layout.form.unknowns)}
        met = components(entries)
        for c, k in number.items():
            value = entries.get(PointQuantity(c, None))
            if self._of_values:
                out.add(f"u[{k}][p] = {f'w * {value}' if value else 'softehl_splat(0.0)'};")
            gradients = {q.axis: v for q, v in entries.items() if q.component == c}
            gradients.pop(None, None)
            for m in range(D):
                total = " + ".join(f"{v} * I{m}{axis}" for axis, v in gradients.items())
                text = f"w * ({total})" if gradients and c in met else "softehl_splat(0.0)"
                out.add(f"slopes[{k}][{m}][p] = {text};")


@dataclass(frozen=True, eq=False)
class SymmetricTable:
    """A matrix (rows, columns) that is the same, or its negative, when both are reversed.

    sign: 1 or -1.
    """

    values: NDArray[np.float64]
    sign: int

    def __post_init__(self) -> None:
        """Raises ValueError where it has no such symmetry."""
        mirrored = self.sign * self.values[::-1, ::-1]
        if not np.allclose(mirrored, self.values, rtol=0.0, atol=1e-12):
            raise ValueError("the matrix along a line is not symmetric to its middle")


def sweep(name: str, table: SymmetricTable, kind: str) -> str:
    """A function of C that multiplies values along a line by the matrix.

    kind: "forth", or "back" by the transpose; back along slopes adds to what is there. Sums and
    differences of mirrored values are multiplied, each by half of the matrix.
    """
    matrix = table.values if kind == "forth" else table.values.T
    rows, columns = matrix.shape
    half = columns // 2
    lines: list[str] = []
    adds = "+=" if kind == "back" and table.sign < 0 else "="
    for k in range((rows + 1) // 2):
        row, mirror = matrix[k], rows - 1 - k
        even = [(row[i] + row[columns - 1 - i]) / 2 for i in range(half)]
        odd = [(row[i] - row[columns - 1 - i]) / 2 for i in range(half)]
        even += [row[half]] if columns % 2 else []
        if k == mirror and table.sign < 0:
            even = []
        if k == mirror and table.sign > 0:
            odd = []
        lines.append(f"    const V E{k} = {_sum('e', even)};")
        lines.append(f"    const V O{k} = {_sum('o', odd)};")
        lines.append(f"    b[{k} * step] {adds} E{k} + O{k};")
        if k != mirror:
            value = f"E{k} - O{k}" if table.sign > 0 else f"O{k} - E{k}"
            lines.append(f"    b[{mirror} * step] {adds} {value};")
    body = "\n".join([*_read(columns, lines), *lines])
    head = "const V *restrict a, V *restrict b, const int step"
    return f"static inline void {name}({head})\n{{\n{body}\n}}\n"


def _read(columns: int, lines: list[str]) -> list[str]:
    """Lines that read the values, and the sums and differences that `lines` need."""
    used = set(re.findall(r"\b[eo]\d+\b", "\n".join(lines)))
    loads = [f"    const V a{k} = a[{k} * step];" for k in range(columns)]
    for i in range(columns // 2):
        j = columns - 1 - i
        loads += [
            f"    const V {letter}{i} = a{i} {sign} a{j};"
            for letter, sign in (("e", "+"), ("o", "-"))
            if f"{letter}{i}" in used
        ]
    middle = columns // 2
    if columns % 2:
        read = f"const V e{middle} = a{middle};"
        loads.append(f"    {read if f'e{middle}' in used else f'(void)a{middle};'}")
    return loads


def _sum(letter: str, factors: list[float]) -> str:
    """Sum of products; zero if there are none."""
    terms = [f"{letter}{i} * {number(float(f))}" for i, f in enumerate(factors) if f]
    return " + ".join(terms) or "softehl_splat(0.0)"


def lagrange(
    nodes: list[float], at: list[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and derivatives (points, nodes) of Lagrange's polynomials."""
    values, derivatives = np.ones((len(at), len(nodes))), np.zeros((len(at), len(nodes)))
    for a, x in enumerate(nodes):
        others = [b for b in nodes if b != x]
        scale = float(np.prod([x - b for b in others]))
        for k, p in enumerate(at):
            values[k, a] = np.prod([p - b for b in others]) / scale
            derivatives[k, a] = (
                sum(np.prod([p - b for b in others if b != c]) for c in others) / scale
            )
    return values, derivatives
