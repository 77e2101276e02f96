"""Target `abaqus` from the model of an element: a user element (UEL), a deck, a small host."""

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


def uel(interface: ElementInterface, states: Sequence[State]) -> dict[str, str]:
    """Every file of a user element."""
    _require(interface)
    texts, kernel = c_interface.files(interface, single=True)
    references = samples(interface, kernel, host.with_time_step(interface, states))
    substitutions = _substitutions(interface)
    texts["uel.c"] = c_interface.filled(c_interface.template("uel.c"), substitutions)
    texts["host.f90"] = host.program(interface)
    texts["Makefile"] = c_interface.filled(
        c_interface.template("abaqus.mk"), {**substitutions, "kind": "uel", "host": "host.f90"}
    )
    texts["NOTES.md"] = c_interface.filled(c_interface.template("uel.md"), substitutions)
    texts["samples.txt"] = host.sample_file(interface, references)
    if interface.cell is not None:
        mesh, settings = (
            patch_mesh.patch(interface.cell),
            host.settings_of(interface, references[0]),
        )
        texts["patch.txt"] = host.patch_file(interface, mesh, settings)
        texts[f"{interface.name}.inp"] = deck(interface, mesh, settings)
    return texts


def _require(interface: ElementInterface) -> None:
    interface.require("abaqus", Task.TANGENT)
    if interface.free:
        raise TargetError(
            f"{interface.name} has unknowns of the element alone ({', '.join(interface.free)}): "
            "target abaqus has unknowns at nodes only; condense them by m.implicit, or give them a "
            "node"
        )
    if interface.dimension not in (1, 2, 3):
        raise TargetError(
            f"{interface.name} has {interface.dimension} coordinates a node: target abaqus needs "
            "1, 2 or 3"
        )
    if interface.remembers:
        interface.require("abaqus", Task.FIELDS)


def _substitutions(interface: ElementInterface) -> dict[str, object]:
    d, numbers = interface.definition, degrees(interface)
    rows = [f"| {k + 1} | {a.name}: {a.meaning} |" for k, a in enumerate(interface.inputs)]
    names = [f"`{f.name}` is {n}" for f, n in zip(interface.nodal, numbers, strict=True)]
    state = [a.name for a in interface.state]
    return {
        "name": interface.name,
        "NAME": interface.name.upper(),
        "given": len(interface.inputs),
        "order": ", ".join(map(str, interface.by_node())),
        "arguments": "".join(arguments(interface)),
        "conditions": "".join(conditions(interface, "*jelem")),
        "required": "; ".join(f"{c.name} {c.relation} {c.bound:g}" for c in d.conditions) or "none",
        "outputs": "".join(_outputs(interface)),
        "history": "".join(_history(interface)),
        "properties": "\n".join(rows) or "| | none |",
        "degrees": ", ".join(names),
        "state": ", ".join(state) or "none",
        "fields": ", ".join(name for name, _ in d.fields) or "none",
        "points": interface.points,
        "needed": interface.points * len(state),
        "variables": interface.variables,
        "coordinates": ", ".join(d.coordinates),
        "symmetry": "symmetric" if interface.symmetric else "not symmetric (`UNSYMM` in the deck)",
    }


def arguments(interface: ElementInterface) -> Iterable[str]:
    """Lines of C that fill parameters and data."""
    for array, sources in (("p", interface.parameters), ("data", interface.data)):
        for k, source in enumerate(sources):
            yield f"    {array}[{k}] = {_argument(interface, source)};\n"


def conditions(interface: ElementInterface, element: str) -> Iterable[str]:
    """Lines of C that refuse arguments which the model does not allow; element: its number in C."""
    d = interface.definition
    rows = (("p", d.parameters), ("data", d.data))
    entries = {a.name: f"{array}[{k}]" for array, row in rows for k, a in enumerate(row)}
    for c in d.conditions:
        yield (
            f"    if (!({entries[c.name]} {c.relation} {number(c.bound)}))\n"
            f'        refuse({element}, "{c.name} {c.relation} {c.bound:g} is required");\n'
        )


def _argument(interface: ElementInterface, source: Source) -> str:
    rate = "(*dtime > 0.0 ? 1.0 / *dtime : 0.0)"
    match source:
        case UserInput(index):
            return f"props[{index}]"
        case TimeStepValue(what):
            return "*dtime" if what == "dt" else rate
        case PreviousValue(place, is_rate):
            i = interface.by_node().index(place)
            return f"-(U[{i}] - du[{i}]) * {rate}" if is_rate else f"U[{i}] - du[{i}]"


def _outputs(interface: ElementInterface) -> Iterable[str]:
    if Task.FIELDS in interface.tasks:
        needed = "" if interface.remembers else "if (*nsvars >= STATE + OUTPUT)\n        "
        yield f"    {needed}{interface.name}_fields(1, X, u, data, p, fields);\n"
    if Task.ENERGY in interface.tasks:
        yield f"    {interface.name}_energy(1, X, u, data, p, stored);\n"


def _history(interface: ElementInterface) -> Iterable[str]:
    """Lines of C that store the new state."""
    width, fields = len(interface.state), len(interface.definition.fields)
    for k, field in enumerate(interface.renewed):
        if field is not None:
            yield (
                f"    for (int q = 0; q < {interface.points}; ++q)\n"
                f"        svars[{width} * q + {k}] = fields[{fields} * q + {field}];\n"
            )
