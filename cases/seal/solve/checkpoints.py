"""Checkpoints: states on the last path of the sealed pressure, from which it is taken up again.

Above two or three shear moduli the section fills the corners of its groove but for pockets of a few
elements. What interpolation leaves there Newton's method does not correct on another mesh. Under
half of the pressure the pockets are wide.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.runtime.arrays import Array

_SHARE = 0.5
"""Of the sealed pressure; going back to rest at once takes 1.4 times the work."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A contact state x (n,) on the mesh of a system, under a sealed pressure, MPa."""

    system: SealSystem
    pressure: float
    x: Array


@dataclass
class Checkpoints:
    """States on the way to the sealed pressure, the pressures rising; they grow with a path."""

    states: list[Checkpoint] = field(default_factory=list)

    def begin(self, pressure: float) -> None:
        """A path that begins at a pressure, MPa, replaces what lies beyond."""
        self.states = [state for state in self.states if state.pressure < pressure]

    def keep(self, state: Checkpoint) -> None:
        """The next state of a path."""
        self.states.append(state)

    def restart(self, p: Seal) -> Checkpoint | None:
        """State at which to take up the path of a case; None where there is nothing but rest.

        With friction there is not: what slips remembers its path.
        """
        most = 0.0 if p.rubs else _SHARE * p.sealed_pressure
        below = [state for state in self.states if 0.0 < state.pressure <= most]
        return below[-1] if below else None
