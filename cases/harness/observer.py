"""What a case tells the outside while it runs, and what it hands back at the end.

A case computes; it neither prints nor writes.  Everything that leaves it goes through an
:class:`Observer` as one of the frozen records below, at the moment it exists, so that a run that is
killed keeps what it had reached.  Units are mm, MPa, N, s; film thicknesses are in micrometres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Protocol

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.solution import Status

OK = "ok"
"""Verdict of a state that may be used as a result."""
COLLAPSED = "collapsed"
"""Verdict of a state on the spurious collapsed branch of a too coarse mesh: never a result."""
UNDER_RESOLVED = "under-resolved"
"""Verdict of a state whose inlet is shorter than the mesh can show: h* may be far off."""
OSCILLATING = "oscillating"
"""Verdict of a state whose film zigzags from node to node: h* is sound, the profile is not."""


@dataclass(frozen=True, eq=False)
class Profile:
    """Fields along the film, sealed side first; five arrays of one length (n,)."""

    x_mm: Array
    h_um: Array
    p_MPa: Array
    tau_MPa: Array
    flux_mm2_s: Array


@dataclass(frozen=True, eq=False)
class Section:
    """The deformed section as four-node cells.

    points: (n, 2), deformed (z, r) in mm.  cells: (m, 4), counterclockwise node numbers.
    point_data: name -> (n,) or (n, k).  cell_data: name -> (m,) or (m, k).
    """

    points: Array
    cells: Integers
    point_data: Mapping[str, Array] = field(default_factory=dict)
    cell_data: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ContactState:
    """The frictionless contact solution (9)-(10) at one sealed pressure, before any film.

    x_mm, p_MPa: (n,), contact pressure along the lubricated arc, sealed side first.
    """

    sealed_pressure: float
    p_max_MPa: float
    contact_start_mm: float
    contact_end_mm: float
    x_mm: Array
    p_MPa: Array
    section: Section


@dataclass(frozen=True, eq=False)
class FilmState:
    """One converged soft-EHL state: a sealed pressure and a signed rod speed.

    rod_speed: U in mm/s, + = outstroke.  h_star_um: h* of (16) from the element-mean flux.
    leak_rate_mm3_s: 2 pi R_rod q.  flux_variation: relative spread of the element-mean flux outside
    cavitation (zero in exact arithmetic).  pressure_jump_max_MPa: largest at a facet, 0 for
    continuous pressure.  oscillation_index, inlet_segments: `cases.seal.results` defines them.
    moment_N_mm: torque that holds the mean rotation.  contact_p_max_MPa: the maximum of the
    frictionless contact stage.  verdict: :data:`OK`, :data:`COLLAPSED`, :data:`UNDER_RESOLVED` or
    :data:`OSCILLATING`; advice: what to do about a verdict that is not :data:`OK`.
    h_star_error_percent: `cases.seal.estimate`, + where h* is too large, nan where not known.
    """

    sealed_pressure: float
    rod_speed: float
    h_star_um: float
    h_min_um: float
    p_max_MPa: float
    pressure_jump_max_MPa: float
    rod_friction_N: float
    leak_rate_mm3_s: float
    contact_start_mm: float
    contact_end_mm: float
    newton_iterations: int
    flux_variation: float
    moment_N_mm: float
    contact_p_max_MPa: float
    oscillation_index: float
    inlet_segments: float
    density: int
    verdict: str
    advice: str
    profile: Profile
    section: Section
    h_star_error_percent: float = nan


@dataclass(frozen=True)
class StageRecord:
    """What one stage of the path cost.

    residual_histories: for each converged step the norms Newton went through.  parameters: the path
    parameter of each of those steps (load factor, weighting factor or rod speed).  factorisations:
    None where it is not known, because the run was cut short.  method: how it was solved, and why
    not faster if a faster way gave up.
    """

    name: str
    seconds: float
    factorisations: int | None
    iterations: int
    residual_histories: tuple[tuple[float, ...], ...]
    parameters: tuple[float, ...] = ()
    sealed_pressure: float | None = None
    stroke: str | None = None
    method: str = "newton"


@dataclass(frozen=True)
class Outcome:
    """What a run reached; `status` and `message` say why it is not more, if it is not.

    kernel_signatures: kernel name -> signature of the compiled kernel.
    solvers: "linear" -> the linear solver in use, "solver" -> the way that was asked for.
    """

    states: tuple[FilmState, ...]
    status: Status
    message: str
    unknowns_total: int
    unknowns_pressure: int
    kernel_signatures: Mapping[str, str]
    stages: tuple[StageRecord, ...]
    solvers: Mapping[str, str] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """Whether every requested state was reached (whatever its verdict)."""
        return self.status is Status.CONVERGED


class Observer(Protocol):
    """The listener a case reports to.  Calls come in order, from one thread."""

    def stage(self, name: str, *, sealed_pressure: float, stroke: str, steps: int | None) -> None:
        """A stage begins.  steps: how many are expected, None if the path decides."""
        return None

    def step(
        self,
        *,
        label: str,
        parameter: float,
        iterations: int,
        residuals: Sequence[float],
        fraction: float | None,
    ) -> None:
        """A step of the path converged.

        label: name of the path parameter as it is shown, for instance "U [mm/s]" or "load".
        parameter: its value.  residuals: norms of Newton's iterates.  fraction: share of the stage
        done in [0, 1], if known.
        """
        return None

    def contact_state(self, state: ContactState) -> None:
        """The contact stage is done."""
        return None

    def film_state(self, state: FilmState) -> None:
        """A requested speed converged: keep it now."""
        return None


class Silent(Observer):
    """The observer that does nothing (for tests and scripts)."""

    def stage(self, name: str, *, sealed_pressure: float, stroke: str, steps: int | None) -> None:
        """See :class:`Observer`."""

    def step(
        self,
        *,
        label: str,
        parameter: float,
        iterations: int,
        residuals: Sequence[float],
        fraction: float | None,
    ) -> None:
        """See :class:`Observer`."""

    def contact_state(self, state: ContactState) -> None:
        """See :class:`Observer`."""

    def film_state(self, state: FilmState) -> None:
        """See :class:`Observer`."""
