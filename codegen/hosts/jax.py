"""Target `jax`: XLA operations with derivatives from the exact tangent."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

from softehl.codegen.abi import ARRAY_ENTRIES, Task
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.c_library import DIFFERENCE, LIMIT
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import at_one_point
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import Sample, samples
from softehl.codegen.verify.kernel_batch import parameters_of


def module(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of a module for JAX."""
    interface.require("jax", Task.RESIDUAL, Task.TANGENT)
    interface = with_derivatives(interface)
    texts, kernel = c_interface.files(interface)
    references = samples(interface, kernel, states)
    substitutions = _substitutions(interface, references[0])
    texts["jax_ops.cc"] = c_interface.filled(
        c_interface.template("jax.cc"),
        {**substitutions, "operations": "\n".join(_operations(interface))},
    )
    parts = "".join(c_interface.template(f"jax_{t}.py.in") for t in _parts(interface))
    module = c_interface.template("jax.py.in").replace("@functions@\n", parts)
    texts[f"{interface.name}_jax.py"] = c_interface.filled(module, substitutions).rstrip() + "\n"
    texts[f"test_{interface.name}.py"] = c_interface.filled(
        c_interface.template("jax_test.py.in"), substitutions
    )
    texts["equilibrium.py"] = c_interface.filled(
        c_interface.template("equilibrium.py.in"), substitutions
    )
    if interface.cell is not None and interface.nodal and not interface.free:
        texts["patch.json"] = _patch_file(interface)
    texts["samples.json"] = _sample_file(references)
    texts["Makefile"] = c_interface.filled(c_interface.template("jax.mk"), substitutions)
    texts["NOTES.md"] = c_interface.filled(c_interface.template("jax.md"), substitutions)
    return texts


JAX = Host(element=module, material=at_one_point(module), arrays=True)


def with_derivatives(interface: ElementInterface) -> ElementInterface:
    """The model with derivatives of its residual by every parameter and datum of the element."""
    d = interface.definition
    arrays = (("parameters", d.parameters), ("data", d.data))
    by = [(a.name, d.graph.input(array, k)) for array, row in arrays for k, a in enumerate(row)]
    return ElementInterface(replace(d, derivatives=tuple(by)))


def _parts(interface: ElementInterface) -> list[str]:
    optional = [t for t in (Task.ENERGY, Task.FIELDS) if t in interface.tasks]
    return [*optional, Task.RESIDUAL]


def _tasks(interface: ElementInterface) -> list[str]:
    return [t for t in interface.tasks if t != Task.PRODUCT]


def _operations(interface: ElementInterface) -> list[str]:
    """C++ of each operation."""
    d = interface.definition
    width = {Task.ENERGY: 1, Task.FIELDS: interface.points * len(d.fields)}
    texts = []
    for task in _tasks(interface):
        size = width.get(Task(task), len(d.unknowns)) if task in set(Task) else len(d.unknowns)
        matrix = task == Task.TANGENT
        second = f", K->typed_data() + e * {len(d.unknowns) ** 2}" if matrix else ""
        texts.append(
            f"static ffi::Error {task}(Array X, Array u, Array data, Array p, Result R"
            f"{', Result K' if matrix else ''})\n{{\n"
            "    return each(X, u, data, p, [&](std::size_t e, std::ptrdiff_t n, const double *X,\n"
            "        const double *u, const double *data, const double *p) {\n"
            f"        {interface.name}_{task}(n, X, u, data, p, "
            f"R->typed_data() + e * {size}{second});\n"
            "    });\n}\n"
            f"XLA_FFI_DEFINE_HANDLER_SYMBOL({interface.name}_{task}_op, {task}, ffi::Ffi::Bind()"
            f"{'.Arg<Array>()' * 4}{'.Ret<Array>()' * (1 + matrix)});\n"
        )
    return texts


def _substitutions(interface: ElementInterface, first: Sample) -> dict[str, object]:
    d, sizes = interface.definition, c_interface.sizes(interface)
    has_energy = Task.ENERGY in interface.tasks
    pairs = zip(d.parameters, first.state.parameters, strict=True)
    return {
        "name": interface.name,
        "NAME": interface.name.upper(),
        "doc": d.doc.replace("\\", "\\\\").replace('"""', "'''") or "A page.",
        "coordinates": sizes["NODES"] * sizes["DIMENSION"],
        "unknowns": sizes["UNKNOWNS"],
        "parameters": sizes["PARAMETERS"],
        "data": sizes["DATA"] + sizes["POINTS"] * sizes["POINT_DATA"],
        "data_count": sizes["DATA"],
        "point_data": bool(d.point_data),
        "points": sizes["POINTS"],
        "field_count": sizes["FIELDS"],
        "parameter_names": {a.name: a.meaning for a in d.parameters},
        "array_names": tuple(a.name for a in d.arrays),
        "array_entries": ARRAY_ENTRIES * len(d.arrays),
        "has_arrays": str(bool(d.arrays)).lower(),
        "data_names": {a.name: a.meaning for a in d.data},
        "unknown_names": tuple(d.unknowns),
        "field_names": tuple(name for name, _ in d.fields),
        "tasks": tuple(str(t) for t in _tasks(interface)),
        "limit": LIMIT,
        "difference": DIFFERENCE,
        "parameters_given": ", ".join(f"{a.name}={float(v):.3g}" for a, v in pairs),
        "derivatives": "The residual by u, p and data"
        + ("; the energy by u, twice." if has_energy else "."),
    }


def _sample_file(references: Sequence[Sample]) -> str:
    size = len(references[0].state.dofs)
    values = {
        "X": [list(map(float, s.state.coordinates)) for s in references],
        "u": [list(map(float, s.state.dofs)) for s in references],
        "data": [s.data for s in references],
        "p": parameters_of(references[0].state),
        "energy": [v for s in references for v in s.energy],
        "residual": [s.residual for s in references],
        "tangent": [[s.tangent[k : k + size] for k in range(0, size**2, size)] for s in references],
        "fields": [s.fields for s in references],
    }
    return json.dumps(values) + "\n"


def _patch_file(interface: ElementInterface) -> str:
    """Patch of cells: coordinates, numbers of unknowns, prescribed values."""
    assert interface.cell is not None
    mesh = patch_mesh.patch(interface.cell)
    number, fixed, initial = (
        patch_mesh.numbers(interface, mesh),
        patch_mesh.prescribed(interface, mesh),
        patch_mesh.starts(interface),
    )
    dofs = [[0] * len(interface.definition.unknowns) for _ in mesh.cells]
    for row, cell in zip(dofs, mesh.cells, strict=True):
        for k, f in enumerate(interface.nodal):
            for node, dof in enumerate(f.dofs):
                row[dof] = number[cell[node], k]
    values = {
        "X": [[c for n in cell for c in mesh.points[n]] for cell in mesh.cells],
        "dofs": dofs,
        "fixed": [number[h.node, h.field] for h in fixed],
        "values": [h.value for h in fixed],
        "start": [initial[k] for _, k in number],
    }
    return json.dumps(values) + "\n"
