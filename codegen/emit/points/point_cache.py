"""The function `keep`: variables at every point of a state that a factored product needs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.emit.points import parent_map, point_function
from softehl.codegen.emit.points.c_lines import Lines, load
from softehl.codegen.emit.points.loop_nest import Frame, products
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_inputs import PointInputs
from softehl.codegen.emit.points.point_layout import Layout


@dataclass(frozen=True, eq=False)
class Kept:
    """The inverse Jacobian, the volume, and the inputs of the function of the point."""

    layout: Layout
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
                out.idle(array)
        out.open(f"for (int q = 0; q < {points}; ++q)")
        products(f)
        parent_map.write(f)
        PointInputs(f).write(direction=False)
        out.idle("x", "g", "e", "b")
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
