"""Whether a film on the path of falling speed can be trusted, from its numbers alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

from softehl.cases.harness.row import OK
from softehl.cases.seal.state import COLLAPSED, OSCILLATING, UNDER_RESOLVED
from softehl.runtime.fem.postprocess import local_exponent

EXCESS_PRESSURE = 0.1
"""Largest credible excess of the film's maximum pressure over the contact's, relative."""

LARGEST_EXPONENT = 0.85
"""Largest credible d log h* / d log U: theory and fine meshes give 0.55 to 0.65."""

FEWEST_INLET_SEGMENTS = 1.5
"""Segments that the inlet needs: with more, h* was within 4 % of a finer mesh in all cases tried
(docs/film-resolution.md); with fewer, anything between -94 % and +59 % occurs."""

INLET_SEGMENTS_OF_LOW_ORDERS = {("fe", 1): 3.0, ("dg", 1): 5.0, ("dg", 2): 2.0}
"""The same for low orders m_p, by treatment of the Reynolds equation: they need more."""

STRONG_OSCILLATION = 0.2
"""Oscillation index from which on a profile is not to be taken at face value: about 5 % of h."""

FINER_MESH = "the film collapsed on this mesh; use a finer mesh (larger density)"


@dataclass(frozen=True)
class FilmNumbers:
    """Scalars of a film: mm, MPa, N, s; flux per circumference in mm^2/s, signed like U.

    flux_variation: relative, outside cavitation. jump: largest of the pressure at a facet, MPa.
    oscillation: index of `cases.seal.results.oscillation`. inlet_segments: number of segments
    over which the film narrows from ten times to one and a half times h* at its inlet.
    """

    speed: float
    flux: float
    h_star: float
    h_min: float
    p_max: float
    friction: float
    flux_variation: float
    jump: float
    oscillation: float
    inlet_segments: float


def fewest_inlet_segments(reynolds: str, m_p: int) -> float:
    """Segments that the inlet needs with pressures of order m_p, "fe" or "dg"."""
    return INLET_SEGMENTS_OF_LOW_ORDERS.get((reynolds, m_p), FEWEST_INLET_SEGMENTS)


@dataclass(frozen=True)
class Verdict:
    """Whether the films met so far on a path of falling speed can be trusted.

    reference: maximum contact pressure without film, MPa. last: the latest film. collapsed: what
    gave a spurious collapsed film away, if anything did: a pressure well above the contact's, a
    friction that rises while the speed falls, or a thickness that falls too fast. A path that
    has once collapsed does not recover; too few segments in the inlet or an oscillating film
    are judged for each film alone. fewest: segments that the inlet needs.
    """

    reference: float
    last: FilmNumbers | None = None
    collapsed: str = ""
    fewest: float = FEWEST_INLET_SEGMENTS

    def after(self, film: FilmNumbers) -> Verdict:
        """The verdict that includes one more film; `collapsed` says what gave it away."""
        reason = self.collapsed or self._suspicion(film)
        return replace(self, last=film, collapsed=reason)

    @property
    def word(self) -> str:
        """OK, COLLAPSED, UNDER_RESOLVED or OSCILLATING, whichever is worst."""
        if self.collapsed:
            return COLLAPSED
        if self.last is None:
            return OK
        if self.last.inlet_segments < self.fewest:
            return UNDER_RESOLVED
        return OSCILLATING if self.last.oscillation > STRONG_OSCILLATION else OK

    @property
    def advice(self) -> str:
        """What to do, empty for OK."""
        word, last = self.word, self.last
        if word == COLLAPSED:
            return f"{FINER_MESH}: {self.collapsed}"
        if last is None or word == OK:
            return ""
        if word == UNDER_RESOLVED:
            return (
                f"the inlet is only {last.inlet_segments:.2g} segments long, it needs "
                f"{self.fewest:g} with this pressure_order: h* may be wrong by tens of per cent; "
                "use a finer mesh (larger density)"
            )
        return (
            f"the film oscillates from node to node (index {last.oscillation:.2g}): h* holds to "
            "a few per cent, the profile does not; use a finer mesh (larger density)"
        )

    def _suspicion(self, film: FilmNumbers) -> str:
        excess = film.p_max - self.reference
        if excess > EXCESS_PRESSURE * self.reference:
            return f"the maximum pressure is {excess:.2f} MPa above that of frictionless contact"
        if self.last is None or not film.speed < self.last.speed:
            return ""
        if abs(film.friction) > abs(self.last.friction):
            return "the friction on the rod rises while the speed falls"
        if film.h_star <= 0.0 or self._exponent(film) > LARGEST_EXPONENT:
            return "its thickness falls too fast with the speed"
        return ""

    def _exponent(self, film: FilmNumbers) -> float:
        if self.last is None or self.last.h_star <= 0.0:
            return inf
        return local_exponent(self.last.speed, self.last.h_star, film.speed, film.h_star)
