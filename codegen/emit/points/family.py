"""One kernel of a family whose mathematics stands at a point."""

from __future__ import annotations

from dataclasses import dataclass

from softehl.codegen.abi import Task
from softehl.codegen.emit.points import assembly, function, loops
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.layout import Layout
from softehl.codegen.emit.schedule import Schedule


@dataclass(frozen=True)
class Written:
    """C text of a kernel, the number of its temporaries, and a file that pages share, if any."""

    text: str
    temporaries: int
    shared: tuple[str, str] | None


@dataclass(frozen=True)
class At:
    """Outputs at the points or at the centroid, and statements in their order."""

    outputs: Outputs
    plan: Schedule


def kernel(layout: Layout, task: str, point: At, centroid: At | None) -> Written:
    """The functions of the point and the centroid, the loops of the cell, and the batch."""
    text, temporaries = function.text(layout, task, point.outputs, point.plan)
    pieces, name, shared = [text], "", None
    if centroid is not None:
        there = layout.at_centroid()
        pieces.append(function.text(there, task, centroid.outputs, centroid.plan)[0])
    if task == Task.TANGENT:
        name, text = assembly.file(layout, point.outputs)
        shared = (f"{name.removeprefix('softehl_')}.c", text)
        pieces.insert(0, f"{assembly.declaration(name, layout, point.outputs)};\n")
    values = None if centroid is None else centroid.outputs
    pieces.append(loops.Group(layout, task, point.outputs, name, values).text())
    return Written("\n".join(pieces), temporaries, shared)
