"""Target `abaqus` from the page of an element: a user element (UEL), a deck, a small host."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softehl.codegen.abi import TargetError, Task
from softehl.codegen.emit.c_printer import number
from softehl.codegen.graph.evaluation import State
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.abaqus_deck import deck, degrees
from softehl.codegen.hosts.element_interface import (
    ElementInterface,
    PreviousValue,
    Source,
    TimeStepValue,
    UserInput,
)
from softehl.codegen.hosts.test_states import samples


def uel(page: ElementInterface, states: Sequence[State]) -> dict[str, str]:
    """Every file of a user element."""
    _require(page)
    texts, kernel = c_interface.files(page, single=True)
    references = samples(page, kernel, host.with_time_step(page, states))
    substitutions = _substitutions(page)
    texts["uel.c"] = c_interface.filled(c_interface.template("uel.c"), substitutions)
    texts["host.f90"] = host.program(page)
    texts["Makefile"] = c_interface.filled(
        c_interface.template("abaqus.mk"), {**substitutions, "kind": "uel", "host": "host.f90"}
    )
    texts["NOTES.md"] = c_interface.filled(c_interface.template("uel.md"), substitutions)
    texts["samples.txt"] = host.sample_file(page, references)
    if page.cell is not None:
        mesh, settings = patch_mesh.patch(page.cell), host.settings_of(page, references[0])
        texts["patch.txt"] = host.patch_file(page, mesh, settings)
        texts[f"{page.name}.inp"] = deck(page, mesh, settings)
    return texts


def _require(page: ElementInterface) -> None:
    page.require("abaqus", Task.TANGENT)
    if page.free:
        raise TargetError(
            f"{page.name} has unknowns of the element alone ({', '.join(page.free)}): target "
            "abaqus has unknowns at nodes only; condense them by m.implicit, or give them a node"
        )
    if page.dimension not in (1, 2, 3):
        raise TargetError(
            f"{page.name} has {page.dimension} coordinates a node: target abaqus needs 1, 2 or 3"
        )
    if page.remembers:
        page.require("abaqus", Task.FIELDS)


def _substitutions(page: ElementInterface) -> dict[str, object]:
    d, numbers = page.definition, degrees(page)
    rows = [f"| {k + 1} | {a.name}: {a.meaning} |" for k, a in enumerate(page.inputs)]
    names = [f"`{f.name}` is {n}" for f, n in zip(page.nodal, numbers, strict=True)]
    state = [a.name for a in page.state]
    return {
        "name": page.name,
        "NAME": page.name.upper(),
        "given": len(page.inputs),
        "order": ", ".join(map(str, page.by_node())),
        "arguments": "".join(arguments(page)),
        "conditions": "".join(conditions(page, "*jelem")),
        "required": "; ".join(f"{c.name} {c.relation} {c.bound:g}" for c in d.conditions) or "none",
        "outputs": "".join(_outputs(page)),
        "history": "".join(_history(page)),
        "properties": "\n".join(rows) or "| | none |",
        "degrees": ", ".join(names),
        "state": ", ".join(state) or "none",
        "fields": ", ".join(name for name, _ in d.fields) or "none",
        "points": page.points,
        "needed": page.points * len(state),
        "variables": page.variables,
        "coordinates": ", ".join(d.coordinates),
        "symmetry": "symmetric" if page.symmetric else "not symmetric (`UNSYMM` in the deck)",
    }


def arguments(page: ElementInterface) -> Iterable[str]:
    """Lines of C that fill parameters and data."""
    for array, sources in (("p", page.parameters), ("data", page.data)):
        for k, source in enumerate(sources):
            yield f"    {array}[{k}] = {_argument(page, source)};\n"


def conditions(page: ElementInterface, element: str) -> Iterable[str]:
    """Lines of C that refuse arguments which the page does not allow; element: its number in C."""
    d = page.definition
    rows = (("p", d.parameters), ("data", d.data))
    entries = {a.name: f"{array}[{k}]" for array, row in rows for k, a in enumerate(row)}
    for c in d.conditions:
        yield (
            f"    if (!({entries[c.name]} {c.relation} {number(c.bound)}))\n"
            f'        refuse({element}, "{c.name} {c.relation} {c.bound:g} is required");\n'
        )


def _argument(page: ElementInterface, source: Source) -> str:
    rate = "(*dtime > 0.0 ? 1.0 / *dtime : 0.0)"
    match source:
        case UserInput(index):
            return f"props[{index}]"
        case TimeStepValue(what):
            return "*dtime" if what == "dt" else rate
        case PreviousValue(place, is_rate):
            i = page.by_node().index(place)
            return f"-(U[{i}] - du[{i}]) * {rate}" if is_rate else f"U[{i}] - du[{i}]"


def _outputs(page: ElementInterface) -> Iterable[str]:
    if Task.FIELDS in page.tasks:
        needed = "" if page.remembers else "if (*nsvars >= STATE + OUTPUT)\n        "
        yield f"    {needed}{page.name}_fields(1, X, u, data, p, fields);\n"
    if Task.ENERGY in page.tasks:
        yield f"    {page.name}_energy(1, X, u, data, p, stored);\n"


def _history(page: ElementInterface) -> Iterable[str]:
    """Lines of C that store the new state."""
    width, fields = len(page.state), len(page.definition.fields)
    for k, field in enumerate(page.renewed):
        if field is not None:
            yield (
                f"    for (int q = 0; q < {page.points}; ++q)\n"
                f"        svars[{width} * q + {k}] = fields[{fields} * q + {field}];\n"
            )
