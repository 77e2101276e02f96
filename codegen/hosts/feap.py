"""Target `feap`: a user element elmtNN, and a stand-in for FEAP that tests it."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen.abi import Task
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, column_major, patch_mesh
from softehl.codegen.hosts.abaqus_deck import degrees
from softehl.codegen.hosts.element_common import (
    arguments,
    conditions,
    history,
    notes,
    outputs,
    require,
)
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import samples

HEADERS = {
    "cdata.h": ("integer nen", "common /cdata/ nen"),
    "comblk.h": ("double precision hr(100000)", "common /comblk/ hr"),
    "elauto.h": ("double precision rmeas, rvalu(3)", "common /elauto/ rmeas, rvalu"),
    "eldata.h": ("integer nel", "common /eldata/ nel"),
    "eltran.h": ("double precision ctan(3)", "common /eltran/ ctan"),
    "hdata.h": ("integer nh1, nh2, nh3", "common /hdata/ nh1, nh2, nh3"),
    "iofile.h": ("integer ior, iow", "common /iofile/ ior, iow"),
    "strnum.h": ("integer iste", "common /strnum/ iste"),
    "tdata.h": ("double precision dt", "common /tdata/ dt"),
}
"""Members of FEAP's common blocks that the element uses."""


def element(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of a user element."""
    require(interface, "feap")
    column_major.require_name(f"{interface.name}_fields_feap", "feap")
    texts, kernel = c_interface.files(interface, single=True)
    references = samples(interface, kernel, host.with_time_step(interface, states))
    substitutions = _substitutions(interface)
    texts["elmt01.f"] = c_interface.filled(c_interface.template("feap.f"), substitutions)
    texts[f"{interface.name}_feap.c"] = c_interface.filled(
        c_interface.template("feap.c"), substitutions
    )
    texts["mock/element.f90"] = c_interface.filled(
        c_interface.template("feap_element.f90"), substitutions
    )
    for name, lines in HEADERS.items():
        texts[f"mock/{name}"] = "".join(f"      {line}\n" for line in lines)
    texts["host.f90"] = host.program(interface)
    texts["samples.txt"] = host.sample_file(interface, references)
    if interface.cell is not None:
        settings = host.settings_of(interface, references[0])
        mesh = patch_mesh.patch(interface.cell)
        texts["patch.txt"] = host.patch_file(interface, mesh, settings)
    texts["Makefile"] = c_interface.filled(c_interface.template("feap.mk"), substitutions)
    texts["NOTES.md"] = c_interface.filled(c_interface.template("feap.md"), substitutions)
    return texts


FEAP = Host(element=element)


def _substitutions(interface: ElementInterface) -> dict[str, object]:
    d = interface.definition
    numbers = degrees(interface, scalar=1 + len(interface.vector))
    position = {dof: k for k, f in enumerate(interface.nodal) for dof in f.dofs}
    order = interface.by_node()
    freedom = [numbers[position[i]] for i in order]
    at_node = [1 + (d.dof_nodes[i][1] or 0) for i in order]
    named = len(interface.nodal)
    pairs = set(zip(at_node, freedom, strict=True))
    idle = [int((n + 1, c + 1) not in pairs) for n in range(d.nodes) for c in range(named)]
    return {
        **notes(interface, numbers, "UTANgent instead of TANGent"),
        "lower": interface.name.lower(),
        "title": interface.name[:28],
        "named": named,
        "nodes": d.nodes,
        "dimension": interface.dimension,
        "fields_count": len(d.fields) if Task.FIELDS in interface.tasks else 0,
        "order": _wrapped(order),
        "at_node": _wrapped([n - 1 for n in at_node]),
        "freedom": _wrapped([k - 1 for k in freedom]),
        "at_node_1": _wrapped(at_node, " &"),
        "freedom_1": _wrapped(freedom, " &"),
        "tables": f"static const int idle[] = {{{_wrapped(idle)}}};\n"
        + c_interface.table("weights", _weights(interface)),
        "arguments": "".join(arguments(interface)),
        "conditions": "".join(conditions(interface, "0")),
        "outputs": "".join(outputs(interface)),
        "history": "".join(history(interface, "after")),
        "values": f"    {interface.name}_fields(1, X, u, data, p, fields);\n"
        if Task.FIELDS in interface.tasks
        else "",
    }


def _wrapped(values: Sequence[int], end: str = "") -> str:
    """Numbers with commas, twenty a line."""
    rows = [", ".join(map(str, values[k : k + 20])) for k in range(0, len(values), 20)]
    return f",{end}\n    ".join(rows)


def _weights(interface: ElementInterface) -> list[float]:
    """Squares of the shape functions at each point, times its weight; 1 without a cell."""
    if interface.cell is None:
        return [1.0] * (interface.points * interface.definition.nodes)
    return [
        float(N) ** 2 * row[-1] for row in interface.rule for N in interface.cell.shape(*row[:-1])
    ]
