"""One kernel of a family whose mathematics stands at a point."""

from __future__ import annotations

from dataclasses import dataclass

from softehl.codegen.abi import Task
from softehl.codegen.emit.points import assembly, function, loops
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.layout import Layout
from softehl.codegen.emit.points.pairs import Parent
from softehl.codegen.emit.schedule import Schedule


@dataclass(frozen=True)
class Written:
    """C text of a kernel, the number of its temporaries, and a file that pages share, if any."""

    text: str
    temporaries: int
    shared: tuple[str, str] | None


def kernel(layout: Layout, task: str, outputs: Outputs, plan: Schedule) -> Written:
    """The function of the point, the loops of the cell around it, and the batch."""
    point, temporaries = function.text(layout, task, outputs, plan)
    pieces, name, shared = [point], "", None
    if task == Task.TANGENT:
        name, text = assembly.file(layout, outputs)
        shared = (f"{name.removeprefix('softehl_')}.c", text)
        pieces.insert(0, f"{assembly.declaration(name, Parent(layout, outputs).size)};\n")
    pieces.append(loops.Group(layout, task, outputs, name).text())
    return Written("\n".join(pieces), temporaries, shared)
