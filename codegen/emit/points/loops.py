"""The loops of a cell around the function of a point: interpolation, fluxes to nodes, stores."""

from __future__ import annotations

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.emit.batch import functions
from softehl.codegen.emit.points import function, geometry
from softehl.codegen.emit.points.centroid import Centroid, zeros
from softehl.codegen.emit.points.frame import Frame, components, products, to_nodes
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.inputs import Inputs
from softehl.codegen.emit.points.layout import Layout
from softehl.codegen.emit.points.lines import load, store
from softehl.codegen.emit.points.pairs import Parent, pulled_back
from softehl.codegen.language.definition import Quantity


class Group(Frame):
    """The function that handles one group of elements in a task."""

    def __init__(
        self,
        layout: Layout,
        task: str,
        outputs: Outputs,
        pairs: str = "",
        centroid: Outputs | None = None,
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
        geometry.write(self)
        Inputs(self).write()
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
                out.idle(array)
        out.add("M failed = softehl_mask(0);")
        if self.spread:
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
        call = function.name(self.layout, self.task)
        out.add(f"failed |= {call}(parameters, x, g, e, b, t, P, A);")
        if self.task == Task.ENERGY:
            out.add("r[0] += w * P[0];")
        elif self.task in abi.AT_POINTS:
            width = f"({len(d.fields)} * {self.layout.points})"
            store(out, f"R + {len(d.fields)} * q", "P", len(d.fields), width)
        else:
            moved = self.task == Task.PSEUDO_LOAD
            to_nodes(self, self._moved_fluxes() if moved else self._plain_fluxes(), "r", "w * ")
        if self.task == Task.TANGENT:
            pulled_back(out, self.layout, outputs)
            for k, fluxes in enumerate(self.parent.of_centroid):
                out.open("")
                to_nodes(self, fluxes, f"T[{k}]", "w * ")
                out.close()

    def _plain_fluxes(self) -> dict[Quantity, str]:
        return {q: f"P[{k}]" for k, q in self.layout.form.own.items()}

    def _moved_fluxes(self) -> dict[Quantity, str]:
        """Rates of fluxes with what the moving places add."""
        numbers = {q: k for k, q in self.layout.form.own.items()}
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
