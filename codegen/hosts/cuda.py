"""Target `cuda`: kernels of a page of fields on a GPU, for CuPy and JAX."""

from __future__ import annotations

import inspect
import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softehl.codegen import pipeline
from softehl.codegen.emit.device import header
from softehl.codegen.emit.device.kernels import DeviceKernels
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import c_interface
from softehl.codegen.hosts.c_library import LIMIT
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import Sample, samples
from softehl.device_arrays import by_blocks, numbered, sparse_pattern

Fields = tuple[tuple[str, ...], tuple[int, ...]]


def folder(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of the folder.  Raises `TargetError` for a page that a device cannot run."""
    kernels = pipeline.device_kernels(interface.definition)
    kernel = pipeline.compile_model(interface.definition)
    element = interface.cell
    assert element is not None
    places = np.round(np.array([[float(x) for x in node] for node in element.nodes]), 9)
    first = samples(interface, kernel, states)
    d = interface.definition
    fields = _fields(kernels, places)
    substitutions: dict[str, object] = {
        "name": d.name,
        "NAME": d.name.upper(),
        "doc": d.doc.replace("\\", "\\\\").replace('"""', "'''") or "A page.",
        "elements": kernels.elements,
        "threads": kernels.threads,
        "line": kernels.q,
        "dimension": kernels.D,
        "fields": fields,
        "shape": f"(nodes, {kernels.C})" if len(fields) == 1 else "(unknowns,)",
        "nodes": d.nodes,
        "geometry": len(kernels.kept),
        "moduli": kernels.parent.size,
        "history": len(d.point_data),
        "symmetric": kernels.symmetric,
        "orders": tuple(kernels.orders),
        "own_order": kernels.n - 1,
        "unknown_names": ", ".join(c.name for c in kernels.components),
        "functions": "\n\n".join(
            inspect.getsource(f) for f in (numbered, sparse_pattern, by_blocks)
        ),
        "parameter_names": {a.name: a.meaning for a in d.parameters},
        "history_names": {a.name: a.meaning for a in d.point_data},
        "node_order": [int(k) for k in np.lexsort(places.T)],
        "limit": LIMIT,
        "parameters_given": ", ".join(
            f"{a.name}={float(v):.3g}"
            for a, v in zip(d.parameters, first[0].state.parameters, strict=True)
        ),
    }
    texts = {
        f"{d.name}.cu": kernels.text(),
        header.NAME: header.TEXT,
        header.FIBERS: header.FIBERS_TEXT,
        "samples.json": _sample_file(interface, first, fields),
    }
    for name, template in {
        f"{d.name}_cupy.py": "cuda_cupy.py.in",
        f"{d.name}_jax.py": "cuda_jax.py.in",
        f"test_{d.name}.py": "cuda_test.py.in",
        "launcher.cc": "cuda_launcher.cc",
        "Makefile": "cuda.mk",
        "NOTES.md": "cuda.md",
    }.items():
        texts[name] = c_interface.filled(c_interface.template(template), substitutions)
    return texts


CUDA = Host(element=folder)


def _fields(kernels: DeviceKernels, places: NDArray[np.float64]) -> tuple[Fields, ...]:
    """Names and nodes, x running first, of the fields of every order; of order 0 no nodes."""
    found = list[Fields]()
    for f in kernels.fields:
        names = tuple(c.name for c in kernels.components[f.first : f.last])
        of_first = [node for name, node in kernels.layout.d.dof_nodes if name == names[0]]
        nodes = np.array([node for node in of_first if node is not None], dtype=int)
        found.append((names, tuple(nodes[np.lexsort(places[nodes].T)].tolist())))
    return (*found,)


def _sample_file(
    interface: ElementInterface, references: Sequence[Sample], fields: Sequence[Fields]
) -> str:
    """Values of one element, its unknowns as `Operator` has them."""
    d = interface.definition
    numbers = {place: k for k, place in enumerate(d.dof_nodes)}
    order = list[int]()
    for names, nodes in fields:
        of_cell: list[int | None] = [*sorted(nodes)] or [None]
        order += [numbers[name, node] for node in of_cell for name in names]
    size = len(order)
    values = []
    for s in references:
        tangent = np.array(s.tangent).reshape(size, size)[np.ix_(order, order)]
        values.append(
            {
                "X": np.array(s.state.coordinates, dtype=float).reshape(d.nodes, -1).tolist(),
                "u": [float(s.state.dofs[k]) for k in order],
                "p": [float(v) for v in s.state.parameters],
                "history": [[float(v) for v in row] for row in s.state.point_data],
                "residual": [s.residual[k] for k in order],
                "tangent": tangent.tolist(),
            }
        )
    return json.dumps(values) + "\n"
