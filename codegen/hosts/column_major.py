"""Arrays of a model's functions for languages that store by columns: names, shapes, samples.

The last index counts elements. Only what a page has is an argument; tangent(i, j, e) is
d residual_i / d u_j, which is the transpose of the memory of C.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from softehl.codegen.abi import ARRAY_ENTRIES, TargetError, Task
from softehl.codegen.hosts import c_interface
from softehl.codegen.hosts.c_library import sample_arrays
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.test_states import Sample
from softehl.codegen.verify.kernel_batch import parameters_of

LETTERS = 63
"""Longest name of Fortran 2018 and of MATLAB."""


@dataclass(frozen=True)
class Array:
    """An argument: name, sizes without elements, meaning.

    each: has elements as last index. longer: the size is the least one.
    """

    name: str
    shape: tuple[int, ...]
    meaning: str
    each: bool = True
    longer: bool = False


def inputs(interface: ElementInterface) -> list[Array]:
    """Arguments that every function has."""
    s = c_interface.sizes(interface)
    width = s["DATA"] + s["POINTS"] * s["POINT_DATA"]
    rows = [
        Array("X", (s["DIMENSION"], s["NODES"]), "reference coordinates of the nodes"),
        Array("u", (s["UNKNOWNS"],), "unknowns"),
        Array("data", (width,), "data of the element, then those of its points"),
        _parameters(interface),
    ]
    return [a for a in rows if all(a.shape)]


def _parameters(interface: ElementInterface) -> Array:
    """Parameters; behind them curves, networks and terms, as long as they are."""
    d = interface.definition
    size = len(d.parameters) + ARRAY_ENTRIES * len(d.arrays)
    meaning = "parameters, then curves, networks and terms" if d.arrays else "parameters"
    return Array("p", (size,), meaning, each=False, longer=bool(d.arrays))


def with_length(arguments: Sequence[Array], references: Sequence[Sample]) -> list[Array]:
    """Arguments with the length that the parameters of the states have."""
    length = len(parameters_of(references[0].state))
    return [replace(a, shape=(length,)) if a.longer else a for a in arguments]


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
    arrays = sample_arrays(interface, references)
    arrays["tangent"] = [
        [row[size * i + j] for j in range(size) for i in range(size)]
        for row in arrays["tangent"]
        if row
    ]
    lines = [str(len(references))]
    lines += [" ".join(repr(float(v)) for row in rows for v in row) for rows in arrays.values()]
    return "\n".join(line for line in lines if line) + "\n"


def procedures(interface: ElementInterface) -> list[str]:
    """Functions of a model: its tasks, and `commit` where it has history."""
    return [*interface.tasks, *(["commit"] if c_interface.commits(interface) else [])]


def solves(interface: ElementInterface) -> bool:
    """True for an element with unknowns at nodes of a standard cell: a patch can be solved."""
    d = interface.definition
    possible = interface.cell is not None and Task.TANGENT in interface.tasks
    return possible and not interface.free and not d.arrays


def lists(interface: ElementInterface, task: str) -> tuple[list[Array], list[Array]]:
    """Inputs and results of a function."""
    arguments = inputs(interface)
    if task != "commit":
        return [*arguments, *direction(interface, task)], results(interface, task)
    return results(interface, Task.FIELDS), [a for a in arguments if a.name == "data"]


def expected(interface: ElementInterface) -> list[Array]:
    """Arrays of values.txt behind the arguments, in its order."""
    by_name = {a.name: a for t in interface.tasks for a in results(interface, t)}
    outputs = [a for k in ("energy", "residual", "tangent", "fields") if (a := by_name.get(k))]
    if c_interface.commits(interface):
        shape = next(a.shape for a in inputs(interface) if a.name == "data")
        outputs.append(Array("renewed", shape, "data after a step"))
    return outputs


def array_rows(interface: ElementInterface) -> str:
    """Rows of a table of arrays and shapes."""
    rows = [row for t in interface.tasks for row in lists(interface, t)]
    arrays = {a.name: a for row in rows for a in row}
    return "\n".join(f"| `{a.name}` | {bounds(a)} | {a.meaning} |" for a in arrays.values())


def bounds(a: Array) -> str:
    """Sizes of an argument with n elements, with commas."""
    sizes = [f"at least {v}" if a.longer else str(v) for v in a.shape]
    return ", ".join([*sizes, *(["n"] if a.each else [])])


def require_name(name: str, host: str) -> None:
    """Raise `TargetError` for a name that Fortran and MATLAB do not have."""
    if len(name) > LETTERS or not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise TargetError(
            f"target {host} has no name {name[:70]}: names begin with a letter and have at most "
            f"{LETTERS}; rename the page"
        )
