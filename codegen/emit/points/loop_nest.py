"""Frame of the loops of a cell: the task, its lines, sums over nodes."""

from __future__ import annotations

from collections.abc import Iterable

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.emit.batch_functions import widths
from softehl.codegen.emit.c_printer import design_width
from softehl.codegen.emit.points import point_function
from softehl.codegen.emit.points.c_lines import Lines
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_layout import Needs, PointLayout, orders
from softehl.codegen.language.definition import Component, PointQuantity


class Frame:
    """The function of a group of elements while it is written.

    Arrays of the element: places xs, unknowns us, data es, variation ts, forces r. D: dimension.
    ring: whether the volume is that of a ring. design: whether places move. to_unknowns: whether
    fluxes go to nodes. first_dof: unknowns in a variation come after so many entries.
    """

    def __init__(self, layout: PointLayout, task: str, outputs: PointOutputs) -> None:
        self.layout, self.task, self.outputs = layout, task, outputs
        self.needs = Needs.of(outputs.entries)
        self.out = Lines()
        self.D = layout.dimension
        self.widths = widths(layout.d, task)
        self.ring = layout.form.axisymmetric
        self.design = task in abi.DESIGN
        self.to_unknowns = point_function.used(task)
        self.first_dof = design_width(layout.d)

    def moving(self) -> int:
        """Entries of `direction` of an element."""
        d = self.layout.d
        sizes = {
            Task.PRODUCT: len(d.unknowns),
            Task.PSEUDO_LOAD: self.first_dof,
            Task.FIELDS_RATE: self.first_dof + len(d.unknowns),
        }
        return sizes.get(Task(self.task), 0) if self.task in set(Task) else 0

    def sums(self, order: int, sums: dict[str, tuple[str, str]]) -> None:
        """Sums over the nodes of an order: name -> value at the node n, factor N, D0, D1 or D2."""
        if not sums:
            return
        out = self.out
        nodes = self.layout.shape(order).nodes
        out.add(f"V {', '.join(f'{k} = softehl_splat(0.0)' for k in sums)};")
        out.open(f"for (int n = 0; n < {nodes}; ++n)")
        self.factors(order, {f for _, f in sums.values()}, "n")
        values = dict.fromkeys(v for v, _ in sums.values())
        named = {v: f"value{k}" for k, v in enumerate(values)}
        for v, k in named.items():
            out.add(f"const V {k} = {v};")
        for k, (v, f) in sums.items():
            out.add(f"{k} += {named[v]} * {f};")
        out.close()

    def factors(self, order: int, letters: Iterable[str], node: str) -> None:
        """Shape functions N and derivatives D0, D1, D2 of a node at the point q."""
        name = self.layout.tables
        if self.layout.shape(order).long:
            for f in sorted(letters):
                table = f"N{order}[{node}]" if f == "N" else f"D{order}[{node}][{f[1:]}]"
                self.out.add(f"const double {f} = {table};")
            return
        for f in sorted(letters):
            entry = "" if f == "N" else f"[{f[1:]}]"
            table = "N" if f == "N" else "D"
            self.out.add(f"const double {f} = {name}_{table}{order}[q][{node}]{entry};")


def products(f: Frame) -> None:
    """Shape functions N<order> and derivatives D<order> at the point q where tables are long."""
    out, D, name = f.out, f.D, f.layout.tables
    for order in f.layout.long_orders:
        shape = f.layout.shape(order)
        assert shape.line is not None
        points, nodes = len(shape.line.values), shape.nodes
        out.add(f"double N{order}[{nodes}], D{order}[{nodes}][{D}];")
        out.open(f"for (int n = 0; n < {nodes}; ++n)")
        out.add(f"const int *const at = {name}_along{order}[n];")
        for k in range(D):
            index = f"q / {points ** (D - 1 - k)} % {points}"
            out.add(f"const double l{k} = {name}_L{order}[{index}][at[{k}]];")
            out.add(f"const double m{k} = {name}_M{order}[{index}][at[{k}]];")
        out.add(f"N{order}[n] = {' * '.join(f'l{k}' for k in range(D))};")
        for by in range(D):
            terms = " * ".join(f"{'m' if k == by else 'l'}{k}" for k in range(D))
            out.add(f"D{order}[n][{by}] = {terms};")
        out.close()
        out.idle([f"N{order}", f"D{order}"])


def components(quantities: Iterable[PointQuantity]) -> list[Component]:
    """Components of quantities, each once."""
    return list(dict.fromkeys(q.component for q in quantities))


def to_nodes(f: Frame, fluxes: dict[PointQuantity, str], to: str, weight: str) -> None:
    """Fluxes at the point q, pulled back to the parent cell, times their weight added at nodes."""
    out = f.out
    for order in orders(list(fluxes)):
        of_order = {q: v for q, v in fluxes.items() if q.component.order == order}
        terms: dict[Component, list[str]] = {}
        for n, c in enumerate(components(of_order)):
            of_component = {q.axis: v for q, v in of_order.items() if q.component == c}
            value = of_component.pop(None, None)
            terms[c] = []
            if value is not None:
                out.add(f"const V f{order}{n} = {weight}{value};")
                terms[c].append(f"f{order}{n} * N")
            for m in range(f.D if of_component else 0):
                total = " + ".join(f"{v} * I{m}{axis}" for axis, v in of_component.items())
                out.add(f"const V f{order}{n}{m} = {weight}({total});")
                terms[c].append(f"f{order}{n}{m} * D{m}")
        out.open(f"for (int n = 0; n < {f.layout.shape(order).nodes}; ++n)")
        factors = {t.rpartition(" ")[2] for some in terms.values() for t in some}
        f.factors(order, factors, "n")
        for c, some in terms.items():
            out.add(f"{to}[{f.layout.entries(c).at('n')}] += {' + '.join(some)};")
        out.close()
