"""The states of a seal: what one is, and what a run tells of it while it runs.

Units are mm, MPa, N, s; film thicknesses are in micrometres.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import nan
from typing import Any

from softehl.cases.harness.file_content import Cells
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.row import OK, Column, Row, column
from softehl.runtime.arrays import Array
from softehl.runtime.io import number_text

COLLAPSED = "collapsed"
"""Verdict of a state on the spurious collapsed branch of a too coarse mesh: never a result."""
UNDER_RESOLVED = "under-resolved"
"""Verdict of a state whose inlet is shorter than the mesh can show: h* may be far off."""
CLIPPED = "clipped"
"""Verdict of a state whose arc ends within its film: the inlet may be cut off."""
UNCERTAIN = "uncertain"
"""Verdict of a state whose estimated error is too large, or is not known though it was wanted, or
is small where two meshes do not show it."""
ESTIMATED = "estimated"
"""Verdict of a state of which no film is computed: h* by the theory of the inlet, friction
unknown."""
OSCILLATING = "oscillating"
"""Verdict of a state whose film zigzags from node to node: h* is sound, the profile is not."""

VERDICTS = (COLLAPSED, UNDER_RESOLVED, CLIPPED, UNCERTAIN, ESTIMATED, OSCILLATING, OK)
"""Verdicts of states, the worst first."""

Section = Cells
"""A deformed section: points are (z, r)."""


@dataclass(frozen=True, eq=False)
class Profile:
    """Fields along the film, sealed side first; six arrays (n,).

    Attributes
    ----------
    x_mm : array (n,)
        Coordinate [mm].
    h_um : array (n,)
        Film thickness [um].
    p_MPa : array (n,)
        Film pressure [MPa].
    tau_MPa : array (n,)
        Shear stress on the seal [MPa].
    flux_mm2_s : array (n,)
        Flux per circumference [mm^2/s].
    tau_rod_MPa : array (n,)
        Shear stress on the rod [MPa]; its integral is the friction.
    """

    x_mm: Array
    h_um: Array
    p_MPa: Array
    tau_MPa: Array
    flux_mm2_s: Array
    tau_rod_MPa: Array


PROFILE_COLUMNS = tuple(field.name for field in fields(Profile))


@dataclass(frozen=True, kw_only=True)
class FilmRow(Row):
    """The numbers of one converged soft-EHL state: a row of `curve.csv`."""

    files = ("profile_{}.csv", "section_{}.vtu")

    sealed_pressure_MPa: float = column("MPa", "sealed pressure p_s")
    rod_speed_mm_s: float = column(
        "mm/s", "rod speed U, + = outstroke (to the air side)", head="U", number_format="+g"
    )
    h_star_um: float = column(
        "um", "film thickness h* = q / u, u = U / 2", head="h*", number_format=".4g"
    )
    h_star_error_percent: float = column(
        "%",
        "estimated error of h*, + where it is too large; of an `estimated` state the largest one, "
        "of either sign; nan where not known",
        head="error",
        number_format="+.2f",
        default=nan,
    )
    h_min_um: float = column(
        "um", "least film thickness at a node", head="h min", number_format=".4g"
    )
    p_max_MPa: float = column("MPa", "largest film pressure", head="p max", number_format=".4f")
    pressure_jump_max_MPa: float = column(
        "MPa", "largest jump of the pressure at a facet; 0 for continuous pressure"
    )
    rod_friction_N: float = column(
        "N", "friction force of the film on the rod", head="friction", number_format=".4g"
    )
    rod_friction_error_percent: float = column(
        "%",
        "estimated error of the friction, + where it is too large; nan where not known",
        default=nan,
    )
    leak_rate_mm3_s: float = column(
        "mm3/s", "leak rate 2 pi R q, + = to the air side", head="leak", number_format=".4g"
    )
    contact_start_mm: float = column(
        "mm",
        "sealed end of the contact, where h is 20 um, or twice the least h if that is more",
        head="contact",
        number_format=".2f",
    )
    contact_end_mm: float = column(
        "mm",
        "air end of the contact, where h is 20 um, or twice the least h if that is more",
        head="contact",
        number_format="+.2f",
    )
    newton_iterations: int = column(
        "", "iterations of Newton's method for this state", head="Newton"
    )
    flux_variation: float = column(
        "", "relative spread of the element-mean flux outside cavitation; 0 in exact arithmetic"
    )
    moment_N_mm: float = column("N mm", "torque that holds the mean rotation of the section")
    contact_p_max_MPa: float = column("MPa", "largest pressure of the frictionless contact")
    oscillation_index: float = column(
        "", "largest zigzag of h over the mid contact, relative; a zigzag of amplitude a has 4 a/h"
    )
    inlet_segments: float = column(
        "", "segments over which the film narrows from 10 to 1.5 times h* at its inlet"
    )
    inlet_ratio: float = column(
        "",
        "h* over sqrt(8 eta |U| / (9 p')), p' the steepest rise of the pressure in the inlet; 1 "
        "where the inlet is resolved",
        default=nan,
    )
    mean_gap_um: float = column(
        "um", "least mean gap h_T between rough surfaces; nan between smooth ones", default=nan
    )
    lambda_ratio: float = column(
        "", "that over the rms height of both surfaces; nan between smooth ones", default=nan
    )
    regime: str = column(
        "", "`boundary` (lambda < 1), `mixed` (< 3) or `full`; empty where smooth", default=""
    )
    asperity_load_percent: float = column("%", "share of asperities in the load", default=0.0)
    boundary_friction_percent: float = column(
        "%", "share of asperities in the friction on the rod", default=0.0
    )
    groove_start_mm: float = column(
        "mm", "sealed end of the groove between two contacts; nan for one contact", default=nan
    )
    groove_end_mm: float = column("mm", "air end of that groove, where h is 20 um", default=nan)
    groove_pressure_MPa: float = column(
        "MPa", "film pressure in the groove between two contacts; nan for one", default=nan
    )
    h_min_sealed_um: float = column(
        "um", "least film thickness of the contact on the sealed side; nan for one", default=nan
    )
    h_min_air_um: float = column(
        "um", "least film thickness of the contact on the air side; nan for one", default=nan
    )
    flux_mismatch_percent: float = column(
        "%",
        "largest difference between the fluxes of two contacts, or on both sides of a place where "
        "the film cavitates; 0 where mass is conserved, nan for one contact that is whole",
        default=nan,
    )
    entrance_pressure_MPa: float = column(
        "MPa", "built up before the arc, where that begins within the film; else 0", default=0.0
    )
    h_star_theory_um: float = column(
        "um", "h* by the theory of the inlet; nan where it does not hold", default=nan
    )
    inlet_over_pocket: float = column(
        "",
        "length of the inlet over the pocket of oil before it; the theory applies up to 0.1",
        default=nan,
    )
    inlet_heating_K: float = column(
        "K", "rise of the oil's temperature in the inlet; nan without heating", default=nan
    )
    film_heating_K: float = column("K", "largest rise of the temperature in the film", default=nan)
    heat_to_rod_W: float = column("W", "heat of the friction that goes into the rod", default=nan)
    heat_to_seal_W: float = column("W", "heat that goes into the seal", default=nan)
    heat_in_oil_W: float = column("W", "heat that the oil carries out of the film", default=nan)
    h_star_theory_sealed_um: float = column(
        "um",
        "h* that the theory gives the contact on the sealed side by itself; nan for one",
        default=nan,
    )
    h_star_theory_air_um: float = column(
        "um", "h* that it gives the contact on the air side; nan for one", default=nan
    )
    density: int = column(
        "", "density of the mesh of the state: above that of the run where its error was too large"
    )
    verdict: str = column(
        "",
        "`ok`, `oscillating`, `estimated`, `uncertain`, `clipped` or `under-resolved`; `collapsed` "
        "is no result",
    )

    @property
    def name(self) -> str:
        """Sealed pressure, stroke and rod speed |U|: "1MPa_out_100mm_s"."""
        speed = f"{self.stroke}_{number_text(abs(self.rod_speed_mm_s))}mm_s"
        return f"{number_text(self.sealed_pressure_MPa)}MPa_{speed}"

    @property
    def order(self) -> tuple[float, bool, float]:
        """Sealed pressure, outstroke first, falling |U|."""
        return self.sealed_pressure_MPa, self.rod_speed_mm_s < 0, -abs(self.rod_speed_mm_s)

    @property
    def usable(self) -> bool:
        """True if this is a result (a collapsed film never is)."""
        return self.verdict != COLLAPSED

    @property
    def line(self) -> str:
        """Place and film thickness."""
        point = f"p_s = {self.sealed_pressure_MPa:g} MPa, U = {self.rod_speed_mm_s:+g} mm/s"
        value = f"h* = {self.h_star_um:.4g} um" if self.usable else f"{self.verdict}: not a result"
        return f"{point}: {value}"

    def shown(self, column: Column) -> str:
        """See :class:`Row`; the error of an estimated state has no sign."""
        if self.verdict == ESTIMATED and column.name == "h_star_error_percent":
            return f"\u00b1{self.h_star_error_percent:g}"
        return super().shown(column)

    @property
    def thickness_um(self) -> float:
        """Least film thickness, um; h* of a state whose film is not computed."""
        return self.h_star_um if self.verdict == ESTIMATED else self.h_min_um

    @property
    def stroke(self) -> str:
        """ "out" or "in"."""
        return "out" if self.rod_speed_mm_s > 0 else "in"

    def within(self, tolerance: float) -> bool:
        """True if h* is ok and its error known to be at most so many per cent."""
        return self.verdict == OK and abs(self.h_star_error_percent) <= tolerance


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmState(FilmRow):
    """One converged film: its row of `curve.csv`, and its fields.

    Attributes
    ----------
    advice : str
        Remedy for a verdict that is not "ok".
    profile : Profile
        Fields along the film.
    section : Section
        Deformed section; points are (z, r).
    sensitivity : mapping, optional
        Quantity -> parameter -> d log quantity / d log parameter; None if not requested, or if
        the mesh does not resolve it.
    """

    advice: str
    profile: Profile
    section: Section
    sensitivity: Mapping[str, Mapping[str, float]] | None = None

    @property
    def sealed_pressure(self) -> float:
        """Sealed pressure p_s [MPa]."""
        return self.sealed_pressure_MPa

    @property
    def rod_speed(self) -> float:
        """Rod speed U [mm/s], + = outstroke."""
        return self.rod_speed_mm_s


@dataclass(frozen=True, eq=False)
class ContactState:
    """Frictionless contact (9)-(10) at one sealed pressure, before any film.

    Attributes
    ----------
    sealed_pressure : float
        Sealed pressure [MPa].
    x_mm : array (n,)
        Coordinate along the lubricated arc [mm], sealed side first.
    p_MPa : array (n,)
        Contact pressure [MPa].
    section : Section
        Deformed section.
    """

    sealed_pressure: float
    x_mm: Array
    p_MPa: Array
    section: Section


def contact_name(sealed_pressure: float) -> str:
    """Name of the files of a dry contact at a sealed pressure [MPa], without the suffix."""
    return f"contact_{number_text(sealed_pressure)}MPa"


def operating_point(sealed_pressure: float, stroke: str) -> dict[str, Any]:
    """Marks that tell a stage from others of its name, as in run.json."""
    return {"sealed_pressure_MPa": sealed_pressure, "stroke": stroke}


def stage_label(name: str, marks: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
    """Title and marks of a stage of a seal, see `Case.stage_label`."""
    if "sealed_pressure" not in marks:
        return name, marks
    sealed_pressure, stroke = marks["sealed_pressure"], marks["stroke"]
    title = f"{name}, p_s = {sealed_pressure:g} MPa, stroke {stroke}"
    return title, operating_point(sealed_pressure, stroke)


class Silent(Observer):
    """Observer that does nothing; base of observers of a seal in tests and scripts.

    An observer that has `film_state` or `contact_state` is told of films and contacts by it,
    otherwise by `state` and `files`.
    """

    def contact_state(self, state: ContactState) -> None:
        """Report the frictionless contact.

        Parameters
        ----------
        state : ContactState
            Contact pressure and section.
        """
        return None

    def film_state(self, state: FilmState) -> None:
        """Report a converged film at a requested speed, to be saved now.

        Parameters
        ----------
        state : FilmState
            The film.
        """
        return None
