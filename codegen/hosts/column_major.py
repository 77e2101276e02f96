"""Arrays of a model's functions for languages that store by columns: names, shapes, samples.

The last index counts elements. Only what a page has is an argument; tangent(i, j, e) is
d residual_i / d u_j, which is the transpose of the memory of C.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from softehl.codegen.abi import Task
from softehl.codegen.hosts import c_interface
from softehl.codegen.hosts.c_library import sample_arrays
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.test_states import Sample, renewed


@dataclass(frozen=True)
class Array:
    """An argument: name, sizes without elements, meaning; `each`: has elements as last index."""

    name: str
    shape: tuple[int, ...]
    meaning: str
    each: bool = True


def inputs(interface: ElementInterface) -> list[Array]:
    """Arguments that every function has."""
    s = c_interface.sizes(interface)
    width = s["DATA"] + s["POINTS"] * s["POINT_DATA"]
    rows = [
        Array("X", (s["DIMENSION"], s["NODES"]), "reference coordinates of the nodes"),
        Array("u", (s["UNKNOWNS"],), "unknowns"),
        Array("data", (width,), "data of the element, then those of its points"),
        Array("p", (s["PARAMETERS"],), "parameters", each=False),
    ]
    return [a for a in rows if all(a.shape)]


def results(interface: ElementInterface, task: str) -> list[Array]:
    """Results of a task, in the order of its C function."""
    s = c_interface.sizes(interface)
    n = s["UNKNOWNS"]
    residual = Array("residual", (n,), "internal minus external forces")
    rows: dict[str, list[Array]] = {
        Task.ENERGY: [Array("energy", (), "potential")],
        Task.RESIDUAL: [residual],
        Task.TANGENT: [residual, Array("tangent", (n, n), "d residual(i) / d u(j)")],
        Task.FIELDS: [Array("fields", (s["FIELDS"], s["POINTS"]), "fields of the points")],
        Task.PRODUCT: [Array("product", (n,), "tangent times direction")],
    }
    slope = Array("slope", (n,), f"derivative of the residual by {task.removeprefix('d_')}")
    return rows.get(task, [slope])


def direction(interface: ElementInterface, task: str) -> list[Array]:
    """Further inputs of a task."""
    if task != Task.PRODUCT:
        return []
    return [Array("direction", (len(interface.definition.unknowns),), "a vector")]


def sample_text(interface: ElementInterface, references: Sequence[Sample]) -> str:
    """values.txt: their number, then each array with all states; the tangent by columns."""
    size = len(interface.definition.unknowns)
    arrays = sample_arrays(references)
    arrays["tangent"] = [
        [row[size * i + j] for j in range(size) for i in range(size)]
        for row in arrays["tangent"]
        if row
    ]
    if c_interface.commits(interface):
        arrays["renewed"] = [[*s.state.data, *renewed(interface, s)] for s in references]
    lines = [str(len(references))]
    lines += [" ".join(repr(float(v)) for row in rows for v in row) for rows in arrays.values()]
    return "\n".join(line for line in lines if line) + "\n"
