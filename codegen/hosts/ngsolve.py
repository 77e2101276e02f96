"""Target `ngsolve`: an integrator on the spaces of NGSolve, as a Python module."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

from softehl.codegen.abi import TargetError, Task
from softehl.codegen.elements import cells
from softehl.codegen.elements.element import Element
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.element_interface import ElementInterface, UserInput
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import Sample, samples

KINDS = {
    "line2": ("ET_SEGM", 1), "line3": ("ET_SEGM", 2),
    "tri3": ("ET_TRIG", 1), "tri6": ("ET_TRIG", 2),
    "quad4": ("ET_QUAD", 1), "quad9": ("ET_QUAD", 2),
    "tet4": ("ET_TET", 1), "tet10": ("ET_TET", 2),
    "wedge6": ("ET_PRISM", 1),
    "hex8": ("ET_HEX", 1), "hex27": ("ET_HEX", 2),
}  # fmt: skip
"""NGSolve's name of the cell, and the order of its space, for each kind of ours."""
MESHES = {
    "ET_SEGM": "Make1DMesh(5, mapping=lambda x: bent(x)[0])",
    "ET_TRIG": "MakeStructured2DMesh(quads=False, nx=3, ny=3, mapping=bent)",
    "ET_QUAD": "MakeStructured2DMesh(quads=True, nx=3, ny=3, mapping=bent)",
    "ET_TET": "MakeStructured3DMesh(hexes=False, nx=2, ny=2, nz=2, mapping=bent)",
    "ET_HEX": "MakeStructured3DMesh(hexes=True, nx=2, ny=2, nz=2, mapping=bent)",
    "ET_PRISM": "MakeStructured3DMesh(hexes=False, prism=True, nx=2, ny=2, nz=2, mapping=bent)",
}


def module(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of the integrator."""
    kind = _kind(interface)
    texts, kernel = c_interface.files(interface, single=True)
    texts = _many(interface) | texts
    substitutions = _substitutions(interface, kind, samples(interface, kernel, states)[0])
    texts["ngsolve.cpp"] = c_interface.filled(c_interface.template("ngsolve.cpp"), substitutions)
    texts["form.hpp"] = c_interface.filled(c_interface.template("ngsolve_form.hpp"), substitutions)
    texts[f"test_{interface.name}.py"] = c_interface.filled(
        c_interface.template("ngsolve_test.py.in"), substitutions
    )
    texts["Makefile"] = c_interface.filled(c_interface.template("ngsolve.mk"), substitutions)
    texts["NOTES.md"] = c_interface.filled(c_interface.template("ngsolve.md"), substitutions)
    return texts


NGSOLVE = Host(element=module)


def _many(interface: ElementInterface) -> dict[str, str]:
    """The tangent again, for many cells at a time, under another name."""
    d = interface.definition
    again = ElementInterface(replace(d, name=f"{d.name}_many", tasks=(Task.TANGENT,)))
    return c_interface.files(again)[0]


def _kind(interface: ElementInterface) -> Element:
    """The cell of the model.  Raises `TargetError`."""
    interface.require("ngsolve", Task.TANGENT)
    kind = interface.cell
    if kind is None or kind.name not in KINDS:
        raise TargetError(
            f"{interface.name} has {interface.definition.nodes} nodes in {interface.dimension} "
            f"coordinates: target ngsolve has spaces for {', '.join(KINDS)}"
        )
    missing = {
        "unknowns of the element alone": interface.free,
        "data of points": [a.name for a in interface.state],
        "values of a step in time": [
            s for s in (*interface.parameters, *interface.data) if not isinstance(s, UserInput)
        ],
    }
    for what, present in missing.items():
        if present:
            raise TargetError(f"{interface.name} has {what}, which target ngsolve cannot hold")
    corners = len(cells.linear(kind).nodes)
    partial = [f.name for f in interface.nodal if len(f.dofs) not in (corners, len(kind.nodes))]
    if partial:
        raise TargetError(
            f"{interface.name}: {partial[0]} is neither at all nodes nor at all corners, as spaces "
            "of target ngsolve are"
        )
    return kind


def _parent(kind: Element) -> list[list[float]]:
    """Places of the nodes in NGSolve's parent cell, between 0 and 1."""
    scaled = {"tri": 0, "tet": 0, "wedge": 1}.get(kind.name.rstrip("0123456789"), 3)
    rows = []
    for node in kind.nodes:
        first = len(node) - scaled if scaled < 3 else 0
        rows.append([float((1 + c) / 2 if k >= first else c) for k, c in enumerate(node)])
    return rows


def _mirrored(row: Sequence[float]) -> list[float]:
    return [1 - row[0]] if len(row) == 1 else [row[1], row[0], *row[2:]]


def _space(interface: ElementInterface, order: int) -> str:
    """The space as a line of Python."""
    full = interface.definition.nodes
    parts = []
    for count, group in groupby(interface.nodal, lambda f: len(f.dofs)):
        names = list(group)
        degree = order if count == full else 1
        while names:
            vector = len(names) >= interface.dimension > 1
            parts.append(f"ng.{'VectorH1' if vector else 'H1'}(mesh, order={degree})")
            names = names[interface.dimension if vector else 1 :]
    return " * ".join(parts)


def _substitutions(interface: ElementInterface, kind: Element, first: Sample) -> dict[str, object]:
    d, (name, order) = interface.definition, KINDS[kind.name]
    parent = _parent(kind)
    pairs = zip(interface.inputs, host.settings_of(interface, first), strict=True)
    settings = {a.name: v for a, v in pairs}
    has_energy, has_residual = (t in interface.tasks for t in (Task.ENERGY, Task.RESIDUAL))
    return {
        "name": interface.name,
        "NAME": interface.name.upper(),
        "kind": name,
        "cell": kind.name,
        "names": len(interface.nodal),
        "unknowns": ", ".join(f.name for f in interface.nodal),
        "nodes": ",\n".join(_braces(parent)),
        "mirrored": ", ".join(str(_index(parent, _mirrored(r))) for r in parent),
        "counts": ", ".join(str(len(f.dofs)) for f in interface.nodal),
        "places": ",\n".join(f"    {{{', '.join(map(str, f.dofs))}}}" for f in interface.nodal),
        "symmetric": "true" if interface.symmetric else "false",
        "symmetry": ", symmetric=True" if interface.symmetric else "",
        "residual": f"{interface.name}_residual(1, e.X, e.u, e.data, e.p, R);"
        if has_residual
        else f"double K[U * U];\n        {interface.name}_tangent(1, e.X, e.u, e.data, e.p, R, K);",
        "energy": f"const Element e = Read(fel, trafo, &elx, lh);\n        double value;\n"
        f"        {interface.name}_energy(1, e.X, e.u, e.data, e.p, &value);\n        return value;"
        if has_energy
        else f'throw Exception("{interface.name} has no energy");',
        "parameters": ", ".join(f'"{a.name}"' for a in d.parameters),
        "constants": ", ".join(f'"{a.name}"' for a in d.data),
        "arguments": ", ".join(f"{k}={v:.3g}" for k, v in settings.items()),
        **_of_test(interface, kind, first),
        "settings": settings,
        "space": _space(interface, order),
        "mesh": MESHES[name],
        "order": order,
    }


def _of_test(interface: ElementInterface, kind: Element, first: Sample) -> dict[str, Any]:
    d, corner = interface.definition, cells.linear(kind)
    weights = [[float(N) for N in corner.shape(*node)] for node in kind.nodes]
    image = [tuple(_mirrored([float(c) for c in p])) for p in corner.nodes]
    corners = [tuple(float(c) for c in p) for p in corner.nodes]
    mirror = [corners.index(p) for p in image] if interface.dimension > 1 else [1, 0]
    edges = [_neighbour(corners, k) for k in range(interface.dimension)]
    return {
        "dimension": interface.dimension,
        "nodes_count": d.nodes,
        "unknowns_count": len(d.unknowns),
        "corners": weights,
        "place_lists": [list(f.dofs) for f in interface.nodal],
        "mirror": mirror,
        "jacobian": f"np.array([X[k] - X[0] for k in {edges}])[:, :DIM]",
        "rest": patch_mesh.starts(interface),
        "size": 0.02,
        "parameter_values": [float(v) for v in first.state.parameters],
        "data_values": [float(v) for v in first.state.data],
    }


def _neighbour(points: Sequence[tuple[float, ...]], direction: int) -> int:
    """The corner that lies from the first one along a direction."""
    return next(
        n
        for n, p in enumerate(points)
        if p[direction] > points[0][direction]
        and all(a == b for k, (a, b) in enumerate(zip(p, points[0], strict=True)) if k != direction)
    )


def _index(points: Sequence[Sequence[float]], point: Sequence[float]) -> int:
    """Index of the node at a point."""
    return next(
        n
        for n, p in enumerate(points)
        if all(abs(a - b) < 1e-9 for a, b in zip(p, point, strict=True))
    )


def _braces(rows: Sequence[Sequence[float]]) -> list[str]:
    """Rows of C, filled to three coordinates."""
    return [f"    {{{', '.join(repr(float(c)) for c in [*row, 0, 0][:3])}}}" for row in rows]
