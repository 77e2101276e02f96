"""Verdict on a film, from its numbers and those of the next faster one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite, nan

from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.surfaces import FULL
from softehl.cases.seal.states.heat import FilmHeat
from softehl.cases.seal.states.state import (
    CLIPPED,
    COLLAPSED,
    OSCILLATING,
    UNCERTAIN,
    UNDER_RESOLVED,
)
from softehl.runtime.discretisation.postprocessing import local_exponent

EXCESS_PRESSURE = 0.1
"""Largest credible excess of the film's maximum pressure over the contact's, relative: that of 27
films of twelve seals is at most 0.033, of an X-ring."""

LARGEST_EXPONENT = 0.85
"""Largest credible d log h* / d log U: theory and fine meshes give 0.55 to 0.65."""

FEWEST_INLET_SEGMENTS = 1.5
"""Segments that the inlet of each lobe needs: with more, h* was within 4 % of a finer mesh in all
cases tried (docs/film-resolution.md); with fewer, anything between -94 % and +59 % occurs. An
X-ring with 1.7 for its two lobes was 4 % off, its `inlet_ratio` 1.002."""

INLET_SEGMENTS_OF_LOW_ORDERS = {("fe", 1): 3.0, ("dg", 1): 5.0, ("dg", 2): 2.0}
"""Segments for low orders m_p, by treatment of the Reynolds equation: they need more."""

NEXT_RATIO = 0.15
"""Farthest from 1 that the inlet ratio of a contact may be which does not meter h*: the pressure
of the groove before it and friction depend on it. Of an X-ring 0.894 at density 2 left h* right
within 0.2 % and friction within 1.1 %, 0.736 at density 1 within 1.8 and 9 %."""

EXIT_FILMS, END_GAP = 5.0, 0.1
"""At its exit the arc is outside the film where the gap is so many h*, or so many mm."""

MOST_WEDGE = 0.2
"""Largest share of the pressure of its inlet that a film may be given where its arc begins: h* that
was 3.1 % too small without 0.14 of it was 0.8 % too large with it."""

LARGEST_ERROR = 2.0
"""Largest error, %, of a state that is `ok`: of h* and friction, of what shows the error of h*."""

MOST_OFF_THEORY = 6.0
"""Largest difference, %, of the theory of the inlet from h* of a state that is `ok`: 88 states of
eleven O-rings were within -5.5 and +3.9 % at density 2."""

STRONG_OSCILLATION = 0.2
"""Oscillation index from which on a profile is not to be taken at face value: about 5 % of h."""

FINER = "use a finer mesh (larger density)"

DOUBTFUL = f"the estimated error of h* is above {LARGEST_ERROR:g} % or not known; {FINER}"

_SHORT = (
    "the inlet is only {:.2g} segments long, it needs {:g} with this pressure_order: h* may be "
    f"wrong by tens of per cent; {FINER}"
)
_UNSEEN = (
    "h* is {:.3g} of what the steepest slope of {} inlet gives, it must be near 1: the mesh does "
    f"not show it; {FINER}"
)
_OFF_THEORY = (
    "the theory of the inlet differs by {:+.2g} % from this h*, where it is known to "
    f"{MOST_OFF_THEORY:g} %; {FINER}"
)
_UNSEALED = (
    "the sealed pressure is taken to end {}, where the ring touches nothing; try more squeeze or a "
    "narrower groove"
)
_OVERLAP = (
    "the section runs {}, which the model does not hinder; try a lower sealed_pressure, a harder "
    "rubber or a wider mouth"
)
_MISMATCH = (
    "the fluxes on both sides of a place where the film cavitates differ by {:.2g} %: the penalty "
    "lets oil in or out there, and friction is not known; "
    'use cavitation = "mass-conserving"'
)
_LIFTED = (
    "the oil lifts the contact on the {} side, which the dry seal presses on the rod with {:.3g} "
    "MPa, more than the {:.3g} MPa of the groove: a second film may exist, in which this contact "
    "seals, with another h* and friction; try another density or a list of speeds"
)
_ZIGZAG = (
    "the film oscillates from node to node (index {:.2g}): h* holds to a few per cent, the profile "
    f"does not; {FINER}"
)


@dataclass(frozen=True)
class ContactNumbers:
    """One contact of a film that has several: mm, MPa, flux per circumference in mm^2/s.

    start, end: where h is 20 um, or less over a shallow groove. p_before: pressure where its part
    of the film begins, in the groove between it and the one before. inlet_ratio: as of the film,
    nan where too little oil reaches its inlet to fill it. lifted: the pressure of the groove behind
    it is the largest of its part.
    """

    flux: float
    p_max: float
    h_min: float
    start: float
    end: float
    p_before: float
    inlet_ratio: float = 1.0
    lifted: bool = False


@dataclass(frozen=True)
class FilmNumbers:
    """Scalars of a film: mm, MPa, N, s; flux per circumference in mm^2/s, signed like U.

    flux_variation: relative, outside cavitation. jump: largest of the pressure at a facet, MPa.
    oscillation: index of `cases.seal.states.mesh_indicators.oscillation`. inlet_segments: number of
    segments over which the film narrows from ten times to one and a half times h* at its inlet.
    inlet_ratio: h* over that of the steepest slope of the pressure in the inlet, by (14) at h = 3/2
    h*. end_gap: the film thickness at the exit end of the arc. entrance: pressure that oil has
    built up before the arc begins, MPa. lacking: what the film does not have of it, relative to
    that of the inlet. mean_gap: least h_T, mm. lambda_ratio: that over sigma, nan between smooth
    surfaces. asperity_load, boundary_friction: shares of asperities. contacts: from the sealed side
    on, where there are several; h_star is then that of the first one on the way of the oil that has
    a peak of its own. fluxes: of the parts of a film that cavitates between them. drag: the part of
    the friction that is not of the slope of the pressure. beyond: friction of the oil beyond both
    ends of the arc, which it does not have, relative to it. heat: of its friction, with heating.
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
    inlet_ratio: float = 1.0
    end_gap: float = inf
    entrance: float = 0.0
    lacking: float = 0.0
    mean_gap: float = nan
    lambda_ratio: float = nan
    asperity_load: float = 0.0
    boundary_friction: float = 0.0
    contacts: tuple[ContactNumbers, ...] = ()
    fluxes: tuple[float, ...] = ()
    drag: float = nan
    beyond: float = 0.0
    heat: FilmHeat | None = None

    @property
    def mismatch(self) -> float:
        """Largest difference between the flux of a part of the film and that of h*, %.

        A part is a contact, or is whole between places where the film cavitates; 0 for one alone.
        """
        fluxes = [*(contact.flux for contact in self.contacts), *self.fluxes]
        return 100.0 * max((abs(flux / self.flux - 1.0) for flux in fluxes), default=0.0)

    @property
    def loses_oil(self) -> bool:
        """True if the fluxes of two parts of the film differ too much."""
        return self.mismatch > LARGEST_ERROR

    @property
    def zigzags(self) -> bool:
        """True if the film zigzags from node to node."""
        return self.oscillation > STRONG_OSCILLATION

    @property
    def friction_known(self) -> bool:
        """True if meshes can show the error of the friction: no oil is lost, nothing zigzags."""
        return not (self.loses_oil or self.zigzags)

    @property
    def next_ratio(self) -> float:
        """The inlet ratio farthest from 1 of other contacts whose inlets are filled; 1 if none is.

        The flux of h* passes them too: the pressure of the groove before them makes it so, and is
        far off, and friction with it, where their own flux is off by a per cent.
        """
        others = self.contacts[1:] if self.flux > 0.0 else self.contacts[:-1]
        ratios = [contact.inlet_ratio for contact in others]
        finite = [ratio for ratio in ratios if isfinite(ratio) and not isfinite(self.lambda_ratio)]
        return max(finite, key=lambda ratio: abs(ratio - 1.0), default=1.0)

    @property
    def lifted(self) -> ContactNumbers | None:
        """The first contact on the way of the oil if that lifts it; None if it holds oil back."""
        first = self.contacts[:1] if self.flux > 0.0 else self.contacts[-1:]
        return next((contact for contact in first if contact.lifted), None)

    @property
    def touching(self) -> bool:
        """True if asperities decide about the film too: its inlet is not that of (14)."""
        return self.lambda_ratio < FULL

    def short(self, fewest: float) -> bool:
        """True if the inlet has too few segments for a film that it alone decides about."""
        return self.inlet_segments < fewest and not self.touching

    @property
    def lacks(self) -> bool:
        """True if an inlet lacks too much of its pressure because the arc begins within the film.

        h* was too small by 0.22 to 0.25 of what it lacks where arcs of a ring were cut, by 0.07 to
        0.13 under lips.
        """
        return not self.lacking <= 0.01 * LARGEST_ERROR

    @property
    def enters(self) -> bool:
        """True if the film is to begin with the pressure of the wedge before its arc."""
        return self.lacks and self.lacking <= MOST_WEDGE

    @property
    def clipped(self) -> bool:
        """True if the arc ends within the film."""
        return self.lacks or self.end_gap < min(EXIT_FILMS * self.h_star, END_GAP)


def fewest_inlet_segments(reynolds: str, m_p: int, lobes: int = 1) -> float:
    """Segments that the inlet needs with pressures of order m_p, "fe" or "dg"."""
    minimum = FEWEST_INLET_SEGMENTS * min(lobes, 2)
    return max(INLET_SEGMENTS_OF_LOW_ORDERS.get((reynolds, m_p), minimum), minimum)


def shows_inlet(ratio: float) -> bool:
    """True if the mesh of a film with this `inlet_ratio` shows its inlet.

    It was 0.995 to 1.002 where an inlet is resolved, 0.83 to 0.957 where h* was 10 % wrong.
    """
    return abs(ratio - 1.0) <= 0.01 * LARGEST_ERROR


@dataclass(frozen=True)
class Verdict:
    """Verdict on a film over a dry contact.

    reference: maximum contact pressure without film, MPa. last: the film. collapsed: what gave it
    away as a spurious collapsed one, if anything did: a pressure well above the contact's, a drag
    that rises while the speed falls, or a thickness that falls too fast. fewest: segments that the
    inlet needs. judge_slopes: whether the slope of an inlet is judged. error: estimated error of
    h*, %, None where none is wanted. rough: between rough surfaces friction may rise while the
    speed falls, and h may be negative. unsealed: where the sealed pressure ends although nothing is
    touched there. references: maximum contact pressures of each contact, from the sealed side on.
    overlap: what the section runs into: itself, or the rod beyond its film. reservation: why it is
    not `ok` although nothing that another mesh may better stands against it. theory: difference of
    the theory of the inlet from h*, %, None where it does not apply.
    """

    reference: float
    last: FilmNumbers | None = None
    collapsed: str = ""
    fewest: float = FEWEST_INLET_SEGMENTS
    judge_slopes: bool = False
    error: float | None = None
    rough: bool = False
    unsealed: str = ""
    references: tuple[float, ...] = ()
    overlap: str = ""
    reservation: str = ""
    theory: float | None = None

    def after(self, film: FilmNumbers) -> Verdict:
        """The verdict on a film, `last` being that of the same stroke at a higher speed, if any."""
        return replace(self, last=film, collapsed=self._suspicion(film))

    @property
    def word(self) -> str:
        """OK or what is worst: COLLAPSED, UNDER_RESOLVED, CLIPPED, UNCERTAIN, OSCILLATING."""
        return next((word for word, _ in self._reservations()), OK)

    @property
    def advice(self) -> str:
        """Advice; empty for OK."""
        return next((advice for _, advice in self._reservations()), "")

    def _reservations(self) -> Iterator[tuple[str, str]]:
        """Verdicts that stand against the last film, worst first, each with its advice."""
        if self.collapsed:
            yield COLLAPSED, f"the film collapsed on this mesh; {FINER}: {self.collapsed}"
        film = self.last
        if film is None:
            return
        if film.short(self.fewest):
            yield UNDER_RESOLVED, _SHORT.format(film.inlet_segments, self.fewest)
        if film.clipped:
            yield CLIPPED, _cut(film)
        if self.judge_slopes and not shows_inlet(film.inlet_ratio):
            yield UNDER_RESOLVED, _UNSEEN.format(film.inlet_ratio, "its")
        if self.judge_slopes and abs(film.next_ratio - 1.0) > NEXT_RATIO:
            yield UNDER_RESOLVED, _UNSEEN.format(film.next_ratio, "the next contact's")
        if self.unsealed:
            yield UNCERTAIN, _UNSEALED.format(self.unsealed)
        if self.overlap:
            yield UNCERTAIN, _OVERLAP.format(self.overlap)
        if self._lifted:
            yield UNCERTAIN, self._lifted
        if film.loses_oil:
            yield UNCERTAIN, _MISMATCH.format(film.mismatch)
        if self.error is not None and not abs(self.error) <= LARGEST_ERROR:
            yield UNCERTAIN, DOUBTFUL
        if self.theory is not None and not abs(self.theory) <= MOST_OFF_THEORY:
            yield UNCERTAIN, _OFF_THEORY.format(self.theory)
        if film.zigzags:
            yield OSCILLATING, _ZIGZAG.format(film.oscillation)
        if self.reservation:
            yield UNCERTAIN, self.reservation

    @property
    def _lifted(self) -> str:
        """Advice for a film that lifts a contact which may seal as well; empty for others.

        Oil cannot enter a dry contact whose pressure is above its own.
        """
        film = self.last
        if film is None or film.lifted is None or len(film.contacts) != len(self.references):
            return ""
        out = film.flux > 0.0
        dry, groove = self.references[0 if out else -1], film.contacts[1 if out else -1].p_before
        return _LIFTED.format("sealed" if out else "air", dry, groove) if dry > groove else ""

    def _resolves_inlets(self, film: FilmNumbers) -> bool:
        """True if the mesh shows the inlets of a film: it has not collapsed on it.

        A thick film moves load from one contact to another: at 7 um an X-ring had 11 % more
        pressure under one lobe, with the same h* at density 4.
        """
        inlets = shows_inlet(film.inlet_ratio) and abs(film.next_ratio - 1.0) <= NEXT_RATIO
        return self.judge_slopes and inlets and not film.short(self.fewest)

    def _suspicion(self, film: FilmNumbers) -> str:
        last, peaks = self.last, [(film.p_max, self.reference)]
        if film.h_min <= 0.0 and not self.rough:
            return f"its least thickness is {1e3 * film.h_min:.2g} um"
        if len(film.contacts) == len(self.references) > 1:
            peaks_by_contact = [contact.p_max for contact in film.contacts]
            peaks = list(zip(peaks_by_contact, self.references, strict=True))
        for peak, reference in [] if self._resolves_inlets(film) else peaks:
            if peak - reference > EXCESS_PRESSURE * reference:
                excess = f"{peak - reference:.2f} MPa above that of frictionless contact"
                return f"the maximum pressure is {excess}"
        if self.rough or last is None or not film.speed < last.speed:
            return ""
        if abs(film.drag) > abs(last.drag):
            return "the drag on the rod rises while the speed falls"
        if not min(last.speed, last.h_star, film.speed, film.h_star) > 0.0:
            return "its thickness falls too fast with the speed"
        if local_exponent(last.speed, last.h_star, film.speed, film.h_star) > LARGEST_EXPONENT:
            return "its thickness falls too fast with the speed"
        return ""


def _cut(film: FilmNumbers) -> str:
    """Advice for a film whose arc ends within it."""
    if film.lacks:
        where = f"the arc cuts off {100.0 * film.lacking:.2g} % of the inlet's pressure"
    else:
        where = f"the arc ends where the film is only {1e3 * film.end_gap:.3g} um thick"
    return (
        f"{where}; leave arc_start and arc_end out, or move them outwards; where they are left "
        "out, the section has no room for so thick a film"
    )
