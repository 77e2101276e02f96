"""Shared files of the hosts of materials: template values, a cell that tests the law, a block.

The cell is a tetrahedron of 4 nodes. The small host has one that asks the law for stress and
modulus as the program does; it must give the forces and the stiffness of the law in our own cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from softehl.codegen.abi import Task
from softehl.codegen.elements import cells
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.abaqus_deck import named
from softehl.codegen.hosts.element_common import arguments, conditions
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import MaterialResponse, Measure, solid
from softehl.codegen.hosts.registry import StatesOf
from softehl.codegen.hosts.test_states import samples
from softehl.codegen.pipeline import compile_model

PULL, TWIST = 0.2, 0.3
"""Stretch of the block in a deck, and its twist by shear."""


def substitutions(r: MaterialResponse, element: str) -> dict[str, object]:
    """Values for the templates of a host; element: C expression of the element's number."""
    interface = r.interface
    outputs = _outputs(r)
    small = r.measure is Measure.SMALL
    stress, _, modulus = str(r.measure).partition(" and ")
    rows = [f"| {k + 1} | {a.name}: {a.meaning} |" for k, a in enumerate(r.parameters)]
    return {
        "name": r.law.name,
        "NAME": r.law.name.upper(),
        "given": len(r.parameters),
        "arguments": "".join(arguments(interface)),
        "conditions": "".join(conditions(interface, element)),
        "history": "".join(_history(interface)),
        "state": ", ".join(a.name for a in interface.state) or "none",
        "outputs": ", ".join(outputs) or "none",
        "output": len(outputs),
        "own": r.first_law_field,
        "depvar": len(interface.state) + len(outputs),
        "small": ".true." if small else ".false.",
        "properties": "\n".join(rows) or "| | none |",
        "stress": stress,
        "modulus": modulus,
        "symmetry": "symmetric" if r.symmetric else "not symmetric (`UNSYMM` in the deck)",
        "steps": "Small strains: NLGEOM=NO." if small else "Large strains: NLGEOM=YES.",
    }


def _outputs(r: MaterialResponse) -> list[str]:
    """Fields that the law gives, without its history."""
    d = r.definition
    return [name for name, _ in d.fields[r.first_law_field : len(d.fields) - len(d.history)]]


def _history(interface: ElementInterface) -> Iterable[str]:
    """Lines of C that store the new state."""
    for k, field in enumerate(interface.renewed):
        value = f"data[{k}]" if field is None else f"fields[{field}]"
        yield f"    after[{k}] = {value};\n"


def modulus_table(r: MaterialResponse, order: Sequence[int] = range(6)) -> str:
    """Rows of a C table: field of each modulus; order: our component for each of the host's."""
    rows = [", ".join(str(r.modulus(i, j)) for j in order) for i in order]
    return "\n".join(f"    {{{row}}}," for row in rows)


def energy_density(r: MaterialResponse) -> str:
    """C expression of the energy per current volume."""
    if r.measure is Measure.SMALL:
        return "fields[0]"
    return (
        "fields[0] / (u[0] * (u[4] * u[8] - u[5] * u[7]) - u[1] * (u[3] * u[8] - u[5] * u[6])\n"
        "        + u[2] * (u[3] * u[7] - u[4] * u[6]))"
    )


def cauchy_element(call: str, host_name: str, values: Mapping[str, object]) -> str:
    """Cell of the small host for Cauchy stress; call: template with the host's call."""
    text = c_interface.template(call) + c_interface.template("cauchy_element.f90")
    return c_interface.filled(text, {**values, "host_name": host_name})


def depvar(r: MaterialResponse) -> list[str]:
    """Lines of a deck with the number of state variables."""
    return ["*DEPVAR", str(n)] if (n := substitutions(r, "")["depvar"]) else []


def tests(r: MaterialResponse, states: StatesOf) -> tuple[dict[str, str], list[float]]:
    """Files of the small host, and values of the constants."""
    d = solid(r.law)
    interface = ElementInterface(
        replace(d, tasks=(Task.TANGENT, Task.FIELDS)[: 1 + bool(d.fields)])
    )
    kernel = compile_model(interface.definition)
    references = samples(
        interface, kernel, host.with_time_step(interface, states(interface.definition))
    )
    settings = host.settings_of(interface, references[0])
    stored = len(interface.state) + len(_outputs(r))
    assert interface.cell is not None
    return {
        "tetrahedron.f90": c_interface.template("tetrahedron.f90"),
        "host.f90": host.program(interface),
        "samples.txt": host.sample_file(interface, references, stored),
        "patch.txt": host.patch_file(
            _from_zero(interface), patch_mesh.patch(interface.cell), settings
        ),
    }, settings


def _from_zero(interface: ElementInterface) -> ElementInterface:
    """The model with a state that begins as zero, whatever its example is."""
    state = {a.name for a in interface.state}
    example = tuple(pair for pair in interface.definition.example if pair[0] not in state)
    return ElementInterface(replace(interface.definition, example=example))


def block(count: int = 2) -> tuple[list[str], list[str], list[str]]:
    """Lines of a deck: nodes and elements of a distorted block, constraints on its ends."""
    mesh = patch_mesh.patch(cells.element("hex8"), count)
    nodes = [f"{n + 1}, {', '.join(map(repr, p))}" for n, p in enumerate(mesh.points)]
    elements = [
        f"{n + 1}, {', '.join(str(k + 1) for k in cell)}" for n, cell in enumerate(mesh.cells)
    ]
    constraints = [f"{n + 1}, 1, 3, 0.0" for n in mesh.left]
    for n in mesh.right:
        _, y, z = mesh.points[n]
        moves = (PULL, -TWIST * (z - 1.5), TWIST * (y - 1.5))
        constraints += [f"{n + 1}, {k + 1}, {k + 1}, {v!r}" for k, v in enumerate(moves)]
    return nodes, elements, constraints


def constants(r: MaterialResponse, values: Sequence[float]) -> list[str]:
    """Lines of *USER MATERIAL: names, then values; those of `m.example` where the law has them."""
    return named(r.parameters, values, r.written.example)
