"""The loops of a cell around the function of a point: interpolation, fluxes to nodes, stores."""

from __future__ import annotations

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.emit.batch import functions
from softehl.codegen.emit.points import function, geometry, pairs
from softehl.codegen.emit.points.frame import Frame, components, products
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.inputs import Inputs
from softehl.codegen.emit.points.layout import Layout, orders
from softehl.codegen.emit.points.lines import load, store
from softehl.codegen.language.definition import Component, Quantity


class Group(Frame):
    """The function that handles one group of elements in a task."""

    def __init__(self, layout: Layout, task: str, outputs: Outputs, pairs: str = "") -> None:
        """pairs: name of the function that makes tangents of moduli."""
        super().__init__(layout, task, outputs)
        self.pairs = pairs

    # the whole ----------------------------------------------------------------------------------

    def text(self) -> str:
        """C text of the functions of a group and of a batch."""
        self._start()
        self.out.open(f"for (int q = 0; q < {self.layout.points}; ++q)")
        products(self)
        geometry.write(self)
        Inputs(self).write()
        self._call()
        self.out.close()
        if self.task == Task.TANGENT:
            self.out.add(f"{self.pairs}(S, K);")
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
                out.idle(array)
        out.add("M failed = softehl_mask(0);")
        if self.spread:
            out.add(f"V r[{len(d.unknowns)}];")
            out.add(f"for (int k = 0; k < {len(d.unknowns)}; ++k) r[k] = softehl_splat(0.0);")
        if self.task == Task.ENERGY:
            out.add("V r[1] = {softehl_splat(0.0)};")
        if self.task == Task.TANGENT:
            size = pairs.Parent(self.layout, self.outputs).size
            out.add(f"V S[{self.layout.points}][{size}];")

    # what it gives ------------------------------------------------------------------------------

    def _call(self) -> None:
        out, outputs, d = self.out, self.outputs, self.layout.d
        out.add(f"V P[{max(len(outputs.rows), 1)}];")
        out.add(f"V A[{max(len(outputs.moduli), len(outputs.rates), 1)}];")
        call = function.name(self.layout, self.task)
        out.add(f"failed |= {call}(parameters, x, g, e, b, t, P, A);")
        if self.task == Task.ENERGY:
            out.add("r[0] += w * P[0];")
        elif self.task in abi.AT_POINTS:
            width = f"({len(d.fields)} * {self.layout.points})"
            store(out, f"R + {len(d.fields)} * q", "P", len(d.fields), width)
        else:
            moved = self.task == Task.PSEUDO_LOAD
            self._fluxes(self._moved_fluxes() if moved else self._plain_fluxes())
        if self.task == Task.TANGENT:
            pairs.pulled_back(out, self.layout, outputs)

    def _plain_fluxes(self) -> dict[Quantity, str]:
        return {q: f"P[{k}]" for k, q in enumerate(self.layout.form.unknowns)}

    def _moved_fluxes(self) -> dict[Quantity, str]:
        """Rates of fluxes with what the moving places add."""
        numbers = {q: k for k, q in enumerate(self.layout.form.unknowns)}
        found: dict[Quantity, str] = {}
        for c in components(numbers):
            mine = {q.axis: k for q, k in numbers.items() if q.component == c}
            slopes = {axis: k for axis, k in mine.items() if axis is not None}
            for axis in [*([None] if None in mine else []), *(range(self.D) if slopes else [])]:
                terms = []
                if axis in mine:
                    terms.append(f"A[{mine[axis]}] + swell * P[{mine[axis]}]")
                if axis is not None:
                    terms += [f"(-P[{k}]) * L{axis}{m}" for m, k in slopes.items()]
                name = f"moved{len(found)}"
                self.out.add(f"const V {name} = {' + '.join(terms)};")
                found[Quantity(c, axis)] = name
        return found

    def _fluxes(self, fluxes: dict[Quantity, str]) -> None:
        """Fluxes pulled back to the parent cell and added at the nodes."""
        out = self.out
        for order in orders(list(fluxes)):
            here = {q: v for q, v in fluxes.items() if q.component.order == order}
            terms: dict[Component, list[str]] = {}
            for n, c in enumerate(components(here)):
                slopes = {q.axis: v for q, v in here.items() if q.component == c}
                value = slopes.pop(None, None)
                terms[c] = []
                if value is not None:
                    out.add(f"const V f{order}{n} = w * {value};")
                    terms[c].append(f"f{order}{n} * N")
                for m in range(self.D if slopes else 0):
                    total = " + ".join(f"{v} * I{m}{axis}" for axis, v in slopes.items())
                    out.add(f"const V f{order}{n}{m} = w * ({total});")
                    terms[c].append(f"f{order}{n}{m} * D{m}")
            out.open(f"for (int n = 0; n < {self.layout.shape(order).nodes}; ++n)")
            factors = {t.rpartition(" ")[2] for some in terms.values() for t in some}
            self.factors(order, factors, "n")
            for c, some in terms.items():
                out.add(f"r[{self.layout.place(c).at('n')}] += {' + '.join(some)};")
            out.close()

    def _finish(self) -> None:
        out, d = self.out, self.layout.d
        size = len(d.unknowns)
        if self.spread or self.task == Task.ENERGY:
            count = size if self.spread else 1
            store(out, "R", "r", count, str(count))
        out.open("if (softehl_any(failed))")
        out.add(f"softehl_spoil(failed, R, {self.widths['values']});")
        if self.task == Task.TANGENT:
            out.add(f"softehl_spoil(failed, K, {size * size});")
        out.close()
