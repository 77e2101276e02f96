"""The C of a family whose mathematics stands at a point, task by task, and its tables."""

from __future__ import annotations

import re
from collections.abc import Sequence

from softehl.codegen.emit import simd
from softehl.codegen.emit.points import function, loops, pairs, tables
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.layout import Layout, orders
from softehl.codegen.emit.schedule import Schedule


def text(layout: Layout, task: str, outputs: Outputs, plan: Schedule) -> tuple[str, int]:
    """C text of one kernel: the function of the point, the loops, the batch."""
    point, temporaries = function.text(layout, task, outputs, plan)
    group = loops.Group(layout, task, outputs).text()
    return "\n".join([point, group, simd.batch(layout.d, task)]), temporaries


def constants(layout: Layout, texts: Sequence[str]) -> list[str]:
    """Tables of those constants that the kernels use."""
    name, form = layout.d.name, layout.form
    every = [*form.all, *form.data.values()]
    found = {**{o: layout.shape(o) for o in orders(every)}, layout.geometry.order: layout.geometry}
    out = [tables.weights(name, layout.d.rule)]
    for shape in found.values():
        out.append(shape.text(name))
        if shape.line is not None:
            out.append(tables.nodes(f"{name}_nodes{shape.order}", shape.line))
    for a in found.values():
        for b in found.values():
            if a.line is not None and b.line is not None:
                out.append(tables.pairs(f"{name}_C{a.order}{b.order}", a.line, b.line))
    places = pairs.stored(layout)
    numbers = ", ".join(map(str, places))
    out.append(f"static const unsigned short {name}_K[{len(places)}] = {{{numbers}}};")
    called = "".join(texts)
    single = [piece for text in out for piece in text.split("\n\n") if piece.strip()]
    return [p.strip() + "\n" for p in single if re.search(rf"\b{_name(p)}\b", called)]


def _name(declaration: str) -> str:
    """Name of a table."""
    return declaration.partition("[")[0].rpartition(" ")[2]
