"""Test states of an element with reference values, for the tests in a host's folder.

The values are those of the outputs that the compiler printed, evaluated in 30 digits: printing, C
compiler, processor and the calls of the host are tested by them. Derivatives are not: the tests
compare these with differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mpmath

from softehl.codegen.abi import Task
from softehl.codegen.derive.output_entries import OutputEntry
from softehl.codegen.derive.task_outputs import outputs
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.graph.tensor_functions import MatrixKernel
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.pipeline import KernelSource

DIGITS = 30


@dataclass(frozen=True)
class Sample:
    """One state and its values; empty where the model does not offer the task.

    tangent: row by row. fields: point by point.
    """

    state: EvaluationState
    energy: list[float]
    residual: list[float]
    tangent: list[float]
    fields: list[float]

    @property
    def data(self) -> list[float]:
        """Data of the element, then those of each point."""
        return [float(v) for row in (self.state.data, *self.state.point_data) for v in row]


def renewed(interface: ElementInterface, s: Sample) -> list[float]:
    """Data of all points after a step that ends in a state."""
    width = len(interface.definition.fields)
    rows = [list(row) for row in s.state.point_data]
    for q, row in enumerate(rows):
        for k, field in enumerate(interface.renewed):
            if field is not None:
                row[k] = s.fields[width * q + field]
    return [v for row in rows for v in row]


def sample(interface: ElementInterface, kernel: KernelSource, state: EvaluationState) -> Sample:
    """The values of all tasks at one state."""
    # where the loop over the points is written out, their data stand behind those of the element
    flat = [v for row in (state.data, *state.point_data) for v in row]
    with mpmath.workdps(DIGITS):
        walk = Walk(replace(state, data=flat), {})
        size = len(state.dofs)
        residual, tangent = [0.0] * size, [0.0] * size**2
        task = Task.TANGENT if Task.TANGENT in kernel.functions else Task.RESIDUAL
        for x in _entries(interface, kernel, task):
            value = float(walk.value(x.node))
            if x.column is None:
                residual[x.row.position] = value
            else:
                tangent[x.row.position * size + x.column.position] = value
        energy = [float(walk.value(x.node)) for x in _entries(interface, kernel, Task.ENERGY)]
        nodes = [n for _, n in interface.definition.fields]
        fields = [float(walk.at(n, q)) for q in range(interface.points) for n in nodes]
    return Sample(
        state,
        energy,
        residual if task in kernel.functions else [],
        tangent if task == Task.TANGENT else [],
        fields if Task.FIELDS in kernel.functions else [],
    )


def _entries(interface: ElementInterface, kernel: KernelSource, task: str) -> list[OutputEntry]:
    """Outputs of the whole element, also of a kernel that is made of functions of a point.

    Functions of tensors are printed as routines without a value of their own: their outputs are
    those before the passes.
    """
    if task not in kernel.functions:
        return []
    function = kernel.functions[task]
    printed = function.best.entries
    below = reachable([x.node for x in printed])
    if function.printer == "points" or any(isinstance(n.payload, MatrixKernel) for n in below):
        return outputs(interface.definition, task)
    return printed


def samples(
    interface: ElementInterface, kernel: KernelSource, states: Sequence[EvaluationState]
) -> list[Sample]:
    """The values at several states."""
    return [sample(interface, kernel, s) for s in states]
