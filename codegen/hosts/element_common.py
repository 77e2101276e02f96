"""Shared parts of the hosts that call an element by itself: what they need, lines of their sources.

A host hands over unknowns at nodes, node after node, properties and stored numbers; these lines
make the arguments of the model's functions of them. The languages differ in their `Syntax` alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from softehl.codegen.abi import TargetError, Task
from softehl.codegen.emit.c_printer import number
from softehl.codegen.hosts.element_interface import (
    ElementInterface,
    PreviousValue,
    Source,
    TimeStepValue,
    UserInput,
)


def require(interface: ElementInterface, host: str) -> None:
    """Raise `TargetError` for a model that a program with unknowns at nodes cannot hold."""
    interface.require(host, Task.TANGENT)
    if interface.free:
        raise TargetError(
            f"{interface.name} has unknowns of the element alone ({', '.join(interface.free)}): "
            f"target {host} has unknowns at nodes only; condense them by m.implicit, or give them "
            "a node"
        )
    if interface.dimension not in (1, 2, 3):
        raise TargetError(
            f"{interface.name} has {interface.dimension} coordinates a node: target {host} needs "
            "1, 2 or 3"
        )
    if interface.remembers:
        interface.require(host, Task.FIELDS)


@dataclass(frozen=True)
class Syntax:
    """Entries of arrays in a language: formats of a number that counts from `base`.

    U, du: values at the end of the step and their change, node after node.
    """

    base: int
    parameter: str
    data: str
    props: str
    old: str
    dtime: str
    rate: str


IN_C = Syntax(
    base=0,
    parameter="p[{}]",
    data="data[{}]",
    props="props[{}]",
    old="U[{0}] - du[{0}]",
    dtime="*dtime",
    rate="(*dtime > 0.0 ? 1.0 / *dtime : 0.0)",
)
IN_FORTRAN = Syntax(
    base=1,
    parameter="p({})",
    data="data({}, 1)",
    props="props({})",
    old="u_nodes({0}) - du_nodes({0})",
    dtime="dtime",
    rate="merge(1 / max(dtime, tiny(dtime)), 0d0, dtime > 0)",
)
IN_MATLAB = Syntax(
    base=1,
    parameter="p({}, 1)",
    data="data({}, :)",
    props="props({})",
    old="U({0}, :) - dU({0}, :)",
    dtime="dt",
    rate="(1 / dt)",
)


def arguments(interface: ElementInterface, syntax: Syntax = IN_C) -> Iterable[str]:
    """Lines that fill parameters and data."""
    for entry, sources in (
        (syntax.parameter, interface.parameters),
        (syntax.data, interface.data),
    ):
        for k, source in enumerate(sources):
            end = "\n" if syntax is IN_FORTRAN else ";\n"
            target = entry.format(k + syntax.base)
            yield f"    {target} = {_argument(interface, source, syntax)}{end}"


def _argument(interface: ElementInterface, source: Source, syntax: Syntax) -> str:
    match source:
        case UserInput(index):
            return syntax.props.format(index + syntax.base)
        case TimeStepValue(what):
            return syntax.dtime if what == "dt" else syntax.rate
        case PreviousValue(dof, is_rate):
            old = syntax.old.format(interface.by_node().index(dof) + syntax.base)
            return f"-({old}) * {syntax.rate}" if is_rate else old


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


def notes(
    interface: ElementInterface, degrees: Sequence[int], unsymmetric: str
) -> dict[str, object]:
    """Values for the notes of a host; unsymmetric: remark for a tangent that is not symmetric."""
    d = interface.definition
    rows = [f"| {k + 1} | {a.name}: {a.meaning} |" for k, a in enumerate(interface.inputs)]
    names = [f"`{f.name}` is {n}" for f, n in zip(interface.nodal, degrees, strict=True)]
    state = [a.name for a in interface.state]
    return {
        "name": interface.name,
        "NAME": interface.name.upper(),
        "given": len(interface.inputs),
        "required": "; ".join(f"{c.name} {c.relation} {c.bound:g}" for c in d.conditions) or "none",
        "properties": "\n".join(rows) or "| | none |",
        "degrees": ", ".join(names),
        "state": ", ".join(state) or "none",
        "fields": ", ".join(name for name, _ in d.fields) or "none",
        "points": interface.points,
        "needed": interface.points * len(state),
        "coordinates": ", ".join(d.coordinates),
        "symmetry": "symmetric" if interface.symmetric else f"not symmetric ({unsymmetric})",
    }


def outputs(
    interface: ElementInterface, stored: str = "", *, energy: bool = False
) -> Iterable[str]:
    """Lines of C that compute fields and energy; stored: C condition that fields have a place."""
    if Task.FIELDS in interface.tasks:
        needed = "" if interface.remembers or not stored else f"if ({stored})\n        "
        yield f"    {needed}{interface.name}_fields(1, X, u, data, p, fields);\n"
    if energy and Task.ENERGY in interface.tasks:
        yield f"    {interface.name}_energy(1, X, u, data, p, stored);\n"


def history(interface: ElementInterface, state: str) -> Iterable[str]:
    """Lines of C that put the new values into the stored numbers of all points."""
    width, fields = len(interface.state), len(interface.definition.fields)
    for k, field in enumerate(interface.renewed):
        if field is not None:
            yield (
                f"    for (int q = 0; q < {interface.points}; ++q)\n"
                f"        {state}[{width} * q + {k}] = fields[{fields} * q + {field}];\n"
            )
