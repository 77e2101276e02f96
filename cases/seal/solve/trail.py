"""States on the last path of the sealed pressure, for meshes to which the loaded one cannot be
carried.

Above two or three shear moduli the section fills the corner between rod and wall, but for a pocket
as small as a few elements: what interpolation leaves there Newton's method does not correct. At
half the pressure the pocket is wide and five iterations do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.gland.parameters import ORing
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Point

Eased: TypeAlias = tuple[SealSystem, float, Array]

_EASED = (2.0, 1.2, 0.6, 0.3, 0.1)
"""Pressures from which a path is taken up again, one after the other, shear moduli."""

_LESS = 0.9
"""Of the sealed pressure: above that nothing would be gained."""

_TRIED = 3


@dataclass
class Trail:
    """States on the way to the sealed pressure, each from the last path that went through it.

    states: mesh, pressure (MPa) and unknowns (n,), pressures rising, without help from what holds
    the section in its groove.
    """

    states: list[Eased] = field(default_factory=list)

    def begin(self, pressure: float) -> None:
        """Another path that begins at a pressure, MPa: what lies beyond is forgotten."""
        self.states = [state for state in self.states if state[1] < pressure]

    def keep(self, system: SealSystem, point: Point) -> None:
        """A state of the path."""
        self.states.append((system, point.parameter, point.solution.x))

    def eased(self, p: ORing) -> list[Eased]:
        """Where to take the path of a case up again, a few states, highest pressure first.

        None with friction: what slips remembers its path.
        """
        found: list[Eased] = []
        for limit in () if p.rubs else _EASED:
            least = min(limit * p.shear_modulus, _LESS * p.sealed_pressure)
            below = [state for state in self.states if 0.0 < state[1] <= least]
            if below and (not found or below[-1][1] < found[-1][1]):
                found.append(below[-1])
        return found[:_TRIED]
