"""Tables of shape functions, weights and products along lines that kernels of a cell use."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

from softehl.codegen.emit.points import basis_tables
from softehl.codegen.emit.points.point_layout import PointLayout, orders


def used(layout: PointLayout, text: str, prefix: str = "") -> list[str]:
    """The tables of the cell that a text names."""
    name, form = prefix + layout.tables, layout.form
    every = [*form.all, *form.data.values()]
    shapes = {**{o: layout.shape(o) for o in orders(every)}, layout.geometry.order: layout.geometry}
    texts: dict[str, Callable[[], str]] = {}
    texts[f"{name}_W"] = partial(basis_tables.weights, name, layout.d.rule)
    for shape in shapes.values():
        texts |= shape.texts(name)
        if shape.line is not None:
            label = f"{name}_nodes{shape.order}"
            texts[label] = partial(basis_tables.nodes, label, shape.line)
    for a in shapes.values():
        for b in shapes.values():
            if a.line is not None and b.line is not None:
                label = f"{name}_C{a.order}{b.order}"
                texts[label] = partial(basis_tables.pairs, label, a.line, b.line)
    return [
        make().strip() + "\n" for label, make in texts.items() if re.search(rf"\b{label}\b", text)
    ]
