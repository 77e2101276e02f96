"""Tables of shape functions, weights and products along lines that kernels of a cell use."""

from __future__ import annotations

import re

from softehl.codegen.emit.points import tables
from softehl.codegen.emit.points.layout import Layout, orders


def used(layout: Layout, text: str, prefix: str = "") -> list[str]:
    """The tables of the cell that a text names."""
    name, form = prefix + layout.d.cell, layout.form
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
    single = [piece for text in out for piece in text.split("\n\n") if piece.strip()]
    return [p.strip() + "\n" for p in single if re.search(rf"\b{_name(p)}\b", text)]


def _name(declaration: str) -> str:
    """Name of a table."""
    return declaration.partition("[")[0].rpartition(" ")[2]
