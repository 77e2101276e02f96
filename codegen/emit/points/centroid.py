"""The centroid of the cell as a second place: values there are inputs of the function of a point.

Their function is called once, before the loop over the points. A tangent gets the products of what
forces lose by each value, T, with the derivatives of that value by the unknowns, G.
"""

from __future__ import annotations

from softehl.codegen.abi import Task
from softehl.codegen.emit.points import function, geometry
from softehl.codegen.emit.points.frame import Frame, products, to_nodes
from softehl.codegen.emit.points.inputs import Inputs
from softehl.codegen.emit.points.lines import Lines
from softehl.codegen.language.definition import Quantity


class Centroid(Frame):
    """The frame of the centroid; its layout has the centroid as its only point."""

    def write(self, out: Lines) -> None:
        """Values c, along a direction their rates dc, for a tangent their derivatives G."""
        self.out, self.spread = out, False
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
        geometry.write(self)
        Inputs(self).write()
        out.add(f"V A[{max(len(outputs.moduli), rates, 1)}];")
        call = function.name(layout, self.task)
        out.add(f"failed |= {call}(parameters, x, g, e, b, t, c, A);")
        if rates:
            out.add(f"for (int k = 0; k < {rates}; ++k) dc[k] = A[k];")
        for k in range(count if self.task == Task.TANGENT else 0):
            pairs = enumerate(outputs.moduli)
            slopes: dict[Quantity, str] = {form.all[j]: f"A[{n}]" for n, (i, j) in pairs if i == k}
            out.open("")
            to_nodes(self, slopes, f"G[{k}]", "")
            out.close()
        out.close()


def zeros(out: Lines, name: str, rows: int, columns: int) -> None:
    """Declare an array of zeros."""
    out.add(f"V {name}[{rows}][{columns}];")
    out.open(f"for (int k = 0; k < {columns}; ++k)")
    for i in range(rows):
        out.add(f"{name}[{i}][k] = softehl_splat(0.0);")
    out.close()
