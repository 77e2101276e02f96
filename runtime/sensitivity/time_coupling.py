"""Values that a step takes over from the steps before it: unknowns and rates of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from softehl.runtime.arrays import Integers
from softehl.runtime.sensitivity.tape import Trail


@dataclass(frozen=True, eq=False)
class Carried:
    """Data of a block that are values of steps before.

    column: among coordinates, data and parameters. numbers: (n,) unknowns whose values they are.
    weights: of the step before, of that before it.
    """

    block: str
    column: int
    numbers: Integers
    weights: tuple[float, ...]


def carried(trail: Trail) -> Iterator[Carried]:
    """Values from steps before in the data of a step."""
    nodal = trail.system.numbering.nodal
    for block in trail.system.blocks.values():
        first = block.kernel.nodes * len(block.kernel.coordinates)
        for slots, weights in ((block.previous, (1.0,)), (block.rates, trail.step.weights)):
            for name, slot in slots.items():
                numbers = nodal[slot.name][block.nodes[:, slot.node or 0]]
                column = first + block.kernel.data.index(name)
                yield Carried(block.name, column, numbers, weights)


def remembering(trail: Trail) -> list[str]:
    """Blocks whose points have data of their own."""
    return [b.name for b in trail.system.blocks.values() if b.initial is not None]
