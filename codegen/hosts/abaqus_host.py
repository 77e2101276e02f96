"""Files of the small host of a user element: states with their values, and a patch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.c_library import DIFFERENCE, LIMIT
from softehl.codegen.hosts.element_interface import (
    ElementInterface,
    PreviousValue,
    Source,
    TimeStepValue,
    UserInput,
)
from softehl.codegen.hosts.patch_mesh import Patch
from softehl.codegen.hosts.test_states import Sample, renewed

INCREMENTS = 4
"""Increments of the patch."""


def program(interface: ElementInterface) -> str:
    """The host itself, in Fortran."""
    substitutions = {
        "name": interface.name,
        "limit": _fortran(LIMIT),
        "difference": _fortran(DIFFERENCE),
        "differences": ".false." if interface.definition.prescribed else ".true.",
    }
    return c_interface.filled(c_interface.template("uel_host.f90"), substitutions)


def _fortran(value: float) -> str:
    return f"{value:g}".replace("e", "d")


def dt_of(interface: ElementInterface) -> float:
    """Length of an increment."""
    return dict(interface.definition.example).get("dt", 1.0)


def with_time_step(
    interface: ElementInterface, states: Sequence[EvaluationState]
) -> list[EvaluationState]:
    """States whose values of the step before are those of the state before in the list."""
    return [_stepped(interface, s, states[k - 1].dofs) for k, s in enumerate(states)]


def _stepped(
    interface: ElementInterface, state: EvaluationState, previous: Sequence[float]
) -> EvaluationState:
    dt = dt_of(interface)

    def value(source: Source, default: float) -> float:
        match source:
            case TimeStepValue(what):
                return dt if what == "dt" else 1 / dt
            case PreviousValue(dof, rate):
                return -previous[dof] / dt if rate else previous[dof]
        return default

    return replace(
        state,
        parameters=[
            value(s, v) for s, v in zip(interface.parameters, state.parameters, strict=True)
        ],
        data=[value(s, v) for s, v in zip(interface.data, state.data, strict=True)],
    )


def settings_of(interface: ElementInterface, s: Sample) -> list[float]:
    """Values of the properties: those of a state."""
    values = [0.0] * len(interface.inputs)
    pairs = [*zip(interface.parameters, s.state.parameters, strict=True)]
    pairs += [*zip(interface.data, s.state.data, strict=True)]
    for source, v in pairs:
        if isinstance(source, UserInput):
            values[source.index] = v
    return values


def _stored(interface: ElementInterface, s: Sample, stored: int | None) -> list[float]:
    """State of all points after a step, then the fields."""
    return [*renewed(interface, s), *s.fields][:stored]


def sample_file(
    interface: ElementInterface, references: Sequence[Sample], stored: int | None = None
) -> str:
    """samples.txt: what the host hands over, and what the element must give back.

    stored: numbers that the element stores; without it, state and fields.
    """
    order, size = interface.by_node(), len(interface.definition.unknowns)
    after = _stored(interface, references[0], stored)
    head = [len(references), size, interface.definition.nodes, interface.dimension]
    lines = [
        " ".join(map(str, (*head, len(interface.inputs), len(after), len(references[0].fields))))
    ]
    for k, s in enumerate(references):
        u, previous = s.state.dofs, references[k - 1].state.dofs
        old = [v for row in s.state.point_data for v in row]
        matrix = [s.tangent[i * size + j] for j in order for i in order]
        groups = (
            [dt_of(interface)],
            s.state.coordinates,
            [u[i] for i in order],
            [u[i] - previous[i] for i in order],
            settings_of(interface, s),
            [*old, *[0.0] * len(s.fields)][:stored],
            [-s.residual[i] for i in order],
            matrix,
            _stored(interface, s, stored),
        )
        lines += [" ".join(repr(float(v)) for v in group) for group in groups]
    return "\n".join(lines) + "\n"


def patch_file(interface: ElementInterface, mesh: Patch, settings: Sequence[float]) -> str:
    """Text of patch.txt: mesh, equations of each cell, prescribed values."""
    number, fixed = patch_mesh.numbers(interface, mesh), patch_mesh.prescribed(interface, mesh)
    width = interface.variables
    initial = patch_mesh.starts(interface)
    state = [dict(interface.definition.example).get(a.name, 0.0) for a in interface.state]
    start = ([*state * interface.points] + [0.0] * width)[:width]
    of_place = {dof: k for k, f in enumerate(interface.nodal) for dof in f.dofs}
    nodes = [interface.definition.dof_nodes[i][1] for i in interface.by_node()]
    head = [len(mesh.points), interface.dimension, len(mesh.cells), interface.definition.nodes]
    head += [
        len(interface.definition.unknowns),
        len(number),
        len(interface.inputs),
        width,
        len(fixed),
    ]
    lines = [" ".join(map(str, [*head, INCREMENTS, INCREMENTS * dt_of(interface)]))]
    lines += [" ".join(map(repr, p)) for p in mesh.points]
    for cell in mesh.cells:
        dofs = [
            number[cell[node or 0], of_place[i]] + 1
            for i, node in zip(interface.by_node(), nodes, strict=True)
        ]
        lines.append(" ".join(str(v) for v in [*(n + 1 for n in cell), *dofs]))
    lines.append(" ".join(repr(float(v)) for v in settings))
    lines.append(" ".join(repr(float(v)) for v in start))
    lines.append(" ".join(repr(initial[k]) for _, k in number))
    lines += [f"{number[h.node, h.field] + 1} {h.value!r}" for h in fixed]
    return "\n".join(lines) + "\n"
