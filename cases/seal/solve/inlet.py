"""The scales of a film at the edge of the dry contact where it is drawn in.

The dry pressure begins like a square root there, p = K sqrt(distance): the inlet draws the film in
just outside one edge, the exit dip lies just inside the other. Viscous and elastic forces balance,
K / sqrt(l) = eta U / h^2 with h = K l^(3/2) / E. This gives the length l = (eta U E^2 / K^3)^(2/5)
at every speed (Snoeijer, Eggers, Venner: Phys. Fluids 25, 101705, 2013).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.contacts import ContactEdge, contact_edges
from softehl.runtime.arrays import Array

MULTIPLE = 1.75
"""About h* in `film_thickness`, whatever the ring."""

POWER = 0.6
"""Power of U that h is as, and that 1 / T is as, with the l above."""


@dataclass(frozen=True)
class InletScales:
    """Time T (s) in which a rod passes the inlet of a film, and its thickness h_r (mm) there."""

    time: float
    thickness: float

    @classmethod
    def of(cls, system: SealSystem, stroke: Stroke, speed: float, x: Array) -> InletScales | None:
        """By the edge of the contact x (n,) where a stroke draws its oil in; None without one."""
        edge, p = inlet_edge(system, stroke, x), system.parameters
        if edge is None:
            return None
        time = inlet_length(p, edge.rise, speed) / speed
        return cls(time, MULTIPLE * film_thickness(p, [edge], speed))

    def at(self, ratio: float) -> InletScales:
        """Scales at another speed, which is so many times ours."""
        return InletScales(self.time / ratio**POWER, self.thickness * ratio**POWER)


def inlet_length(p: Seal, rise: float, speed: float) -> float:
    """Length l (mm) of the inlet at an edge of this K^2 at |U|, see above.

    Between rough surfaces at least that over which h = K l^(3/2) / E rises by sigma.
    """
    flow, E = p.viscosity * speed, 3.0 * p.surface_modulus
    asperities = (p.surfaces.sigma * E / rise**0.5) ** (2.0 / 3.0)
    return float(max((flow * E**2 / rise**1.5) ** 0.4, asperities))


def film_thickness(p: Seal, edges: Sequence[ContactEdge], speed: float) -> float:
    """About half of h* (mm) at |U|, K l^(3/2) / E with the l above."""
    flow, E = p.viscosity * speed, 3.0 * p.surface_modulus
    return max((flow**POWER * E**0.2 * edge.rise**-0.4 for edge in edges), default=0.0)


def inlet_edge(system: SealSystem, stroke: Stroke, x: Array) -> ContactEdge | None:
    """The edge of the contact x (n,) where a stroke draws its film in; None without one."""
    edges = contact_edges(system, x)
    edge = edges[0 if stroke == "out" else -1] if edges else None
    return edge if edge and 0.0 < edge.rise < inf else None
