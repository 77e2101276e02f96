"""The tangent at a lower order of the shape functions, and its diagonal: the function `coarse`.

Multigrid in the order needs P^T K P for the interpolation P from the lower order, and the diagonal
of K. Lower shape functions are sums of those of the cell, so P^T K P is B^T S B of the lower ones
at the same points: no tangent of the cell is made. S, the moduli pulled back to the parent cell,
follows from what the product keeps at a point (`sum_factored_product`). The diagonal takes squares
of shape functions and slopes along the lines, one direction after the other.

    void softehl_NAME_coarse(ptrdiff_t first, ptrdiff_t last, const double *parameters,
        const double *kept, double *diagonals, double *tangents)

first, last, kept: as for `action`. diagonals: (n, ndof), tangents: (n, k, k), of which k unknowns
go node by node of the lower cell, in the order of the model; both are written.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from softehl.codegen import abi
from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.elements.element import Element
from softehl.codegen.emit.c_printer import number
from softehl.codegen.emit.code_motion import Schedule
from softehl.codegen.emit.points import basis_tables, cell_constants, point_function, point_kernel
from softehl.codegen.emit.points.basis_tables import BasisTable, LineTable
from softehl.codegen.emit.points.btab import STEM, Parent, pull_back
from softehl.codegen.emit.points.c_lines import Lines
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_layout import Needs, PointLayout
from softehl.codegen.language.definition import Component

LOWER = {1: 1, 2: 1, 3: 1, 4: 2, 5: 1, 6: 2}
"""Order of the next level: where nodes of order 2 are not among those there are, 1."""
TASK = "coarse"


def lower_cell(cell: Element) -> Element:
    """The quadrilateral or hexahedron of the next level."""
    return ELEMENTS[cell.name.rstrip("0123456789") + str((LOWER[cell.order] + 1) ** cell.dimension)]


@dataclass(frozen=True, eq=False)
class CoarseLayout(PointLayout):
    """Unknowns of the next level at the points of a cell."""

    @classmethod
    def of(cls, layout: PointLayout) -> CoarseLayout:
        """Of the layout of a cell."""
        names = list(dict.fromkeys(name for name, _ in layout.d.dof_nodes))
        nodes = range(len(lower_cell(ELEMENTS[layout.d.cell]).nodes))
        dofs = tuple((name, node) for node in nodes for name in names)
        d = replace(layout.d, dof_nodes=dofs, unknowns=tuple(f"{n}{a + 1}" for n, a in dofs))
        return cls(d, layout.form)

    def shape(self, order: int) -> BasisTable:
        """Shape functions of the lower cell at the points of the cell itself."""
        return basis_tables.shape(order, lower_cell(ELEMENTS[self.d.cell]), self.d.rule)


@dataclass(frozen=True, eq=False)
class CoarseTangent:
    """The function of a model whose moduli at a point are these outputs.

    names: variables that the product keeps at a point.
    """

    layout: PointLayout
    outputs: PointOutputs
    plan: Schedule
    names: Sequence[str]

    @property
    def name(self) -> str:
        """Name of the function."""
        return abi.function_name(self.layout.d.name, TASK)

    @cached_property
    def parent(self) -> Parent:
        """Moduli pulled back."""
        return Parent(self.layout, self.outputs)

    @cached_property
    def lower(self) -> PointLayout:
        """Layout of the unknowns of the lower order."""
        return CoarseLayout.of(self.layout)

    @property
    def size(self) -> int:
        """Number of the unknowns of the lower order."""
        return len(self.lower.d.unknowns)

    @property
    def line(self) -> LineTable:
        """Shape functions along a direction."""
        line = self.layout.geometry.line
        assert line is not None
        return line

    def text(self) -> str:
        """C text of the function, with its tables."""
        point, _ = point_function.text(self.layout, TASK, self.outputs, self.plan)
        assembly = point_kernel.assembly(self.lower, self.outputs)
        tables = cell_constants.used(self.lower, assembly, STEM)
        group = self._group()
        order = self.layout.geometry.order
        label = f"{self.layout.tables}_nodes{order}"
        tables.append(basis_tables.nodes(label, self.line))
        return "\n".join([point, *tables, *self._squares(), self._assembly(assembly), group])

    def _assembly(self, body: str) -> str:
        head = f"V (*restrict S)[{self.parent.size}], double *restrict K"
        return f"static void {self.name}_assembly({head})\n{{\n{body}\n}}\n"

    def _group(self) -> str:
        out, d, points = Lines(), self.layout.d, self.layout.points
        count, size = len(self.names), self.size
        out.add(f"V S[{points}][{self.parent.size}];")
        out.add("M failed = softehl_mask(0);")
        out.open(f"for (int q = 0; q < {points}; ++q)")
        out.add(f"const softehl_wide *const from = kept + {count} * q;")
        self._inputs(out)
        call = point_function.name(self.layout, TASK)
        out.add(f"failed |= {call}(parameters, x, g, e, b, t, P, A);")
        pull_back(out, self.layout, self.outputs)
        out.close()
        out.add(f"{self.name}_assembly(S, K);")
        for c in self.layout.components:
            self._diagonal(out, c)
        out.open("if (softehl_any(failed))")
        out.add(f"softehl_spoil(failed, R, {len(d.unknowns)});")
        out.add(f"softehl_spoil(failed, K, {size**2});")
        out.close()
        body = "\n".join(out.lines)
        arguments = (
            "ptrdiff_t first, ptrdiff_t last, const double *restrict parameters,\n"
            "    const double *restrict kept, double *restrict diagonals, "
            "double *restrict tangents"
        )
        return (
            f"static void {self.name}_group(const double *restrict parameters,\n"
            "    const softehl_wide *restrict kept, double *restrict R, double *restrict K)\n"
            f"{{\n    (void)parameters;\n{body}\n}}\n\n"
            f"void {self.name}({arguments});\nvoid {self.name}({arguments})\n{{\n"
            "    for (ptrdiff_t e = first; e < last; e += SOFTEHL_LANES)\n"
            f"        {self.name}_group(parameters, (const softehl_wide *)(kept + "
            f"{count * points} * e),\n"
            f"            diagonals + {len(d.unknowns)} * e, tangents + {size**2} * e);\n}}\n"
        )

    def _inputs(self, out: Lines) -> None:
        """The arguments of the function of the point, from what is kept."""
        layout, needs = self.layout, Needs.of(self.outputs.entries)
        sizes = {"x": layout.dimension, "g": len(layout.form.all), "e": len(layout.site.data)}
        sizes |= {"b": len(layout.d.point_data), "t": 1, "P": 1}
        sizes["A"] = len(self.outputs.moduli)
        for letter, size in sizes.items():
            out.add(f"V {letter}[{max(size, 1)}];")
        read = {f"{letter}[{k}]" for a, letter in point_function.ARRAYS.items() for k in needs[a]}
        assert read <= set(self.names), f"{layout.d.name}: moduli read more than products do"
        for k, value in enumerate(self.names):
            if "[" not in value:
                out.add(f"const V {value} = from[{k}];")
            elif value in read:
                out.add(f"{value} = from[{k}];")

    # the diagonal -------------------------------------------------------------------------------

    def _squares(self) -> list[str]:
        """Functions that add products along a line: of values, value and slope, slopes."""
        texts = []
        values, derivatives = self.line.values, self.line.derivatives
        for kind, (first, second) in enumerate(
            [(values, values), (values, derivatives), (derivatives,) * 2]
        ):
            lines = []
            for a in range(len(values[0])):
                terms = [
                    f"a[{q} * step] * {number(p[a] * r[a])}"
                    for q, (p, r) in enumerate(zip(first, second, strict=True))
                    if p[a] * r[a]
                ]
                lines.append(f"    b[{a} * step] += {' + '.join(terms) or 'softehl_splat(0.0)'};")
            head = "const V *restrict a, V *restrict b, const int step"
            body = "\n".join(["    (void)a;", *lines])
            texts.append(f"static inline void {self.name}_{kind}({head})\n{{\n{body}\n}}\n")
        return texts

    def _diagonal(self, out: Lines, c: Component) -> None:
        """Entries of the diagonal of a component."""
        D, points = self.layout.dimension, len(self.line.values)
        nodes = len(self.line.values[0])
        integrands: dict[tuple[int, ...], Counter[int]] = {}
        for row, column in product(self.parent.of(c), repeat=2):
            entry = self.parent.number(row, column)
            if entry is not None:
                kinds = tuple((row.axis == k) + (column.axis == k) for k in range(D))
                integrands.setdefault(kinds, Counter())[entry] += 1
        out.open("")
        arrays: dict[tuple[int, ...], str] = {}
        for n, (kinds, entries) in enumerate(integrands.items()):
            arrays[kinds] = f"s{n}"
            out.add(f"V s{n}[{points**D}];")
            terms = (f"{m}.0 * S[q][{k}]" if m > 1 else f"S[q][{k}]" for k, m in entries.items())
            out.add(f"for (int q = 0; q < {points**D}; ++q) s{n}[q] = {' + '.join(terms)};")
        for axis in range(D):
            arrays = self._summed(out, arrays, axis, (nodes, points))
        at = f"{self.layout.tables}_nodes{self.layout.geometry.order}"
        total = next(iter(arrays.values()), "")
        out.open(f"for (int k = 0; k < {nodes**D}; ++k)")
        out.add(f"const int a = {at}[k];")
        value = f"{total}[k]" if total else "softehl_splat(0.0)"
        position = self.layout.entries(c).at("a")
        out.add(f"softehl_store1(R + {position}, {len(self.layout.d.unknowns)}, {value});")
        out.close()
        out.close()

    def _summed(
        self, out: Lines, arrays: dict[tuple[int, ...], str], axis: int, sizes: tuple[int, int]
    ) -> dict[tuple[int, ...], str]:
        """Arrays after the sums over the points along an axis."""
        nodes, points = sizes
        step = points ** (self.layout.dimension - 1 - axis)
        blocks = nodes**axis
        summed: dict[tuple[int, ...], str] = {}
        for kinds, source in arrays.items():
            remaining = kinds[1:]
            if remaining not in summed:
                summed[remaining] = f"d{axis}{len(summed)}"
                count = blocks * nodes * step
                out.add(f"V {summed[remaining]}[{count}];")
                out.add(f"for (int k = 0; k < {count}; ++k)")
                out.add(f"    {summed[remaining]}[k] = softehl_splat(0.0);")
            out.add(f"for (int j = 0; j < {blocks}; ++j)")
            out.add(f"    for (int i = 0; i < {step}; ++i)")
            first, second = f"{points * step} * j + i", f"{nodes * step} * j + i"
            target = summed[remaining]
            out.add(
                f"        {self.name}_{kinds[0]}(&{source}[{first}], &{target}[{second}], {step});"
            )
        return summed
