"""A film and its mesh: solved, the mesh made for it, carried there and solved again.

The loop ends where the mesh fits the film that is solved on it, and where the errors that are left
are small enough. These are estimated from the same film on a coarser mesh of the same spacing
(`states.estimate`); where they are too large, the film is solved on a finer one, too. So it is
where the theory of the inlet differs from it: the theory has an error of the mesh of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.arc_meshing import CYCLES, film_layout, misfit
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.film_solver import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.load_stages import StageError
from softehl.cases.seal.solve.transfer import FilmTransfer
from softehl.cases.seal.states.estimate import (
    Estimate,
    coarser_density,
    finer_density,
    reservation,
    unseen,
)
from softehl.cases.seal.states.inlet_edges import Predictions, predicted
from softehl.cases.seal.states.verdict import (
    LARGEST_ERROR,
    MOST_OFF_THEORY,
    fewest_inlet_segments,
    shows_inlet,
)
from softehl.runtime.mesh.mesh import MeshError

FITS, SHOWS = 2.2, 3.0
"""Segments that a film may ask for in the place of one, before its mesh is made anew and before it
does not count. Films that asked for at most three changed h* by 0.5 % or less on the mesh that was
made for them, one that asked for nine by 7 %. Made anew from 3 on, an X-ring of the sample takes
three times as long, and one of 13 other seals loses a state."""

FINEST = 2.5
"""Largest density on which a film is solved because of its error, over that of its case: two finer
meshes, as h* of most films is then known to 2 % (docs/validation/films-method.md)."""


@dataclass(frozen=True, eq=False)
class Adapted:
    """A film on the mesh that was made for it.

    coarser: the same on the coarser mesh of the estimate, None where it was not asked for or not
    found. fits: whether the mesh fits the film.
    """

    film: Film
    coarser: Film | None
    fits: bool = True

    @property
    def estimate(self) -> Estimate | None:
        """Of its errors, None without the coarser film."""
        if self.coarser is None:
            return None
        coarse, fine = (film.system.section.density for film in (self.coarser, self.film))
        return Estimate(self.film.numbers, self.coarser.numbers, float(coarse / fine))

    @cached_property
    def theory(self) -> Predictions | None:
        """Film by the theory of the inlet over the dry contact of its mesh."""
        film = self.film
        return predicted(film.system, film.squeeze_film.dry, film.loads.stroke, film.loads.speed)

    @property
    def off_theory(self) -> float | None:
        """Difference of the theory from h*, %; None where it does not apply."""
        theory = self.theory
        if theory is None or not theory.applies or self.film.system.parameters.rough:
            return None
        return theory.difference(self.film.numbers.h_star)

    @property
    def sure(self) -> bool:
        """True if errors and theory leave a state `ok`, as far as a mesh decides it.

        A finer mesh of the same arc does not add the oil beyond its ends.
        """
        estimate, p = self.estimate, self.film.system.parameters
        if estimate is None or not self.fits or not abs(estimate.h_star) <= LARGEST_ERROR:
            return False
        if not shows_inlet(estimate.film.inlet_ratio):
            return False
        if self.off_theory is not None and not abs(self.off_theory) <= MOST_OFF_THEORY:
            return False
        return estimate.beyond > LARGEST_ERROR or not reservation(p, estimate)


@dataclass(frozen=True, eq=False)
class Adaptation:
    """Makes meshes for films.

    p: the case. contacts, films: solve for either on them.
    """

    p: Seal
    contacts: ContactSolver
    films: FilmSolver

    def adapted(self, film: Film | NoFilm, last: Sequence[Adapted] = ()) -> Adapted | NoFilm:
        """A film on a mesh that fits it, from that on another mesh.

        last: films at other speeds. A film that ends early on a mesh is squeezed out anew on one
        that is made for the state it has reached. A film whose estimated error is too large is
        solved on finer meshes, which the estimate then compares.
        """
        film = self._settled(film)
        if isinstance(film, NoFilm):
            return film
        adapted = Adapted(film, self._coarser(film, last), self._fits(film, SHOWS))
        while not adapted.sure:
            finer = self._finer(adapted.film)
            if not isinstance(finer, Film):
                break
            adapted = Adapted(finer, adapted.film, self._fits(finer, SHOWS))
        return adapted

    def _settled(self, film: Film | NoFilm) -> Film | NoFilm:
        """The film on a mesh of its density that fits it, if there is one."""
        for _ in range(CYCLES):
            if isinstance(film, Film) and self._fits(film):
                break
            again = self._remeshed(film)
            if not isinstance(again, Film):
                break
            film = again
        return film

    def _fits(self, film: Film, maximum: float = FITS) -> bool:
        """True if a mesh fits its film; a mesh that is given is as it is.

        maximum: segments that the film may ask for in the place of one.
        """
        p = self.p
        if p.mesh != "graded":
            return True
        fewest = fewest_inlet_segments(p.reynolds, p.pressure_order, p.lobes)
        return not film.numbers.short(fewest) and self._misfit(film) <= maximum

    def _misfit(self, film: Film) -> float:
        return misfit(film.system, film.x, film.squeeze_film.scales.thickness)

    def _remeshed(self, film: Film | NoFilm) -> Film | NoFilm | None:
        """The film on the mesh that is made for it; None where there is none."""
        if film.start_state is None or self.p.mesh != "graded":
            return None
        squeeze_film, now = film.start_state
        system, thickness = squeeze_film.system, squeeze_film.scales.thickness
        layout = film_layout(system, now.x, thickness)
        counts = isinstance(film, Film) and self._fits(film, SHOWS)
        return self._carried(film, self._system(layout, system.section.density), anew=not counts)

    def _coarser(self, film: Film, last: Sequence[Adapted]) -> Film | None:
        """The film on a coarser mesh, for the estimate; None without one."""
        if not (self.p.error_estimate and self.p.mesh == "graded"):
            return None
        previous = [a.coarser for a in last if a.coarser and a.film.system is film.system]
        result: Film | NoFilm | None = None
        if previous:
            solver = self.films.on(previous[-1].system)
            result = solver.from_neighbour(previous, film.loads.speed)
            system: SealSystem | None = solver.system
        else:
            density = coarser_density(film.system.section.density)
            system = self._system(film.system.section.layout, density)
        if not isinstance(result, Film):
            result = self._carried(film, system)
        return result if isinstance(result, Film) else None

    def _finer(self, film: Film) -> Film | NoFilm | None:
        """The film on a finer mesh of the same spacing; None where no such mesh would help."""
        density = finer_density(film.system.section.density)
        estimated = self.p.error_estimate and not unseen(self.p)
        if not estimated or density > FINEST * self.p.density:
            return None
        return self._carried(film, self._system(film.system.section.layout, density))

    def _system(self, layout: Layout, density: Fraction) -> SealSystem | None:
        """The system on a mesh; None where that is too coarse for the corners of a section."""
        try:
            return build_system(self.p, layout, density)
        except MeshError:
            return None

    def _carried(
        self, result: Film | NoFilm, system: SealSystem | None, *, anew: bool = True
    ) -> Film | NoFilm | None:
        """The film on the mesh of a system; None where there is no mesh, or no contact state on it.

        It is squeezed out from the contact if none was found, or if the carried one ends. Two of
        three O-rings that take this have no `ok` at -10 mm/s without it (docs/validation). anew:
        whether that is done; not for a film whose mesh shows it already.
        """
        if system is None or result.start_state is None:
            return None
        squeeze_film, now = result.start_state
        try:
            dry = self.contacts.from_mesh(squeeze_film.system, squeeze_film.dry, system)
        except StageError:
            return None
        solver, film = self.films.on(system), squeeze_film.film
        if isinstance(result, Film):
            transfer = FilmTransfer(squeeze_film.system, system, (squeeze_film.dry, dry[1]))
            start, pressures = replace(now, x=transfer.state(now.x)), transfer.pressures(now.x)
            carried = squeeze_film.carried(system, start.x, dry[1])
            again = solver.from_film(carried, start, pressures)
            if isinstance(again, Film) or not anew:
                return again
        return solver.from_contact(film.stroke, film.speed, dry[1])
