"""Functions of a group of elements and of a batch: their heads, and the widths of their arrays."""

from __future__ import annotations

from softehl.codegen import abi
from softehl.codegen.emit.c_printer import (
    data_expression,
    design_width,
    direction_expression,
    dofs_expression,
    point_values_expression,
)
from softehl.codegen.language.definition import Definition

WIDE = 256
"""Unknowns of an element above which a group of tangents has no room on a stack."""


def widths(d: Definition, task: str) -> dict[str, str]:
    """Values per element of each array, "0" for those that a task does not use."""
    size = dofs_expression(d)
    along = direction_expression(d, task) or "0"
    values = {abi.Task.ENERGY: "1"}
    values |= {t: f"({point_values_expression(d, t)} * points)" for t in abi.AT_POINTS}
    values[abi.Task.ADJOINT_RATE] = str(design_width(d) + len(d.unknowns))
    return {
        "coordinates": str(d.coordinate_width),
        "dofs": size,
        "data": data_expression(d),
        "direction": along,
        "values": values.get(abi.Task(task), size) if task in set(abi.Task) else size,
        "tangent": f"({size} * {size})" if task == abi.Task.TANGENT else "0",
    }


def functions(d: Definition, task: str, body: str) -> str:
    """C text of the function of a group with this body, and of the batch."""
    name = abi.function_name(d.name, task)
    wide = widths(d, task)
    arguments = ", ".join([name, *wide.values()])
    public = f"SOFTEHL_BATCH({arguments})"
    if task == abi.Task.TANGENT and len(d.unknowns) > WIDE:
        public = f"SOFTEHL_WIDE_BATCH({arguments})"
    return f"SOFTEHL_GROUP({name})\n{{\n    SOFTEHL_IDLE;\n{body}\n}}\n{public}\n"
