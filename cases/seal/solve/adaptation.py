"""A film and its mesh: solved, the mesh made for it, carried there and solved again.

The loop ends where the mesh fits the film that is solved on it. The errors that are left are
estimated from the same film on a coarser mesh of the same spacing (`states.estimate`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.films import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.layouts import CYCLES, film_layout, misfit
from softehl.cases.seal.solve.path import StageError
from softehl.cases.seal.solve.transfer import FilmTransfer
from softehl.cases.seal.states.estimate import coarser_density, friction_bound
from softehl.cases.seal.states.verdict import LARGEST_ERROR, FilmNumbers, fewest_inlet_segments
from softehl.runtime.mesh.mesh import MeshError

FITS, SHOWS = 2.2, 3.0
"""Segments that a film may ask for in the place of one, before its mesh is made anew and before it
does not count. Films that asked for at most three changed h* by 0.5 % or less on the mesh that was
made for them, one that asked for nine by 7 %. Made anew from 3 on, an X-ring of the sample takes
three times as long, and one of 13 other seals loses a state."""

ALIKE = 1.25
"""Ratio of the segments that two meshes have for a film, relative to their densities: what they
differ by shows the error of both only where they resolve the same things alike."""


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
    def other(self) -> FilmNumbers | None:
        """The numbers of the coarser film."""
        return self.coarser.numbers if self.coarser else None


@dataclass(frozen=True, eq=False)
class Adaptation:
    """Makes meshes for films.

    p: the case, whose density they have. contacts, films: solve for either on them.
    """

    p: Seal
    contacts: ContactSolver
    films: FilmSolver

    def adapted(self, found: Film | NoFilm, last: Sequence[Adapted] = ()) -> Adapted | NoFilm:
        """A film on a mesh that fits it, from that on another mesh.

        last: films at other speeds. A film that ends early on a mesh is squeezed out anew on one
        that is made for the state it has reached. The mesh of another film, which fits too, is left
        where its estimated error is too large.
        """
        density, given = Fraction(self.p.density), found
        found = self._settled(given, density)
        if isinstance(found, NoFilm):
            return found
        coarser = self._coarser(found, last)
        if found is given and self.p.error_estimate and not _sure(found, coarser):
            own = self._remeshed(found, density)
            if isinstance(own, Film):
                found, coarser = own, self._coarser(own, last)
        return Adapted(found, coarser, self._fits(found, density, most=SHOWS))

    def _settled(
        self, found: Film | NoFilm, density: Fraction, like: Film | None = None
    ) -> Film | NoFilm:
        """The film on a mesh of that density that fits it, if there is one; like: see `_fits`."""
        for _ in range(CYCLES):
            if isinstance(found, Film) and self._fits(found, density, like):
                break
            again = self._remeshed(found, density)
            if not isinstance(again, Film):
                break
            found = again
        return found

    def _fits(
        self, film: Film, density: Fraction, like: Film | None = None, most: float = FITS
    ) -> bool:
        """True if a mesh fits its film; a mesh that is given is as it is.

        like: the film on another mesh, which this one must resolve as well for its density. most:
        segments that it may ask for in the place of one, without that.
        """
        p = self.p
        if p.mesh != "graded":
            return True
        fewest = fewest_inlet_segments(p.reynolds, p.pressure_order, p.lobes)
        if like is not None:
            fewest = like.numbers.inlet_segments * float(density / p.density) / ALIKE
            most = ALIKE * _misfit(like, p.density)
        return not film.numbers.short(fewest) and _misfit(film, float(density)) <= most

    def _remeshed(self, found: Film | NoFilm, density: Fraction) -> Film | NoFilm | None:
        """The film on the mesh that is made for it; None where there is none."""
        if found.begun is None or self.p.mesh != "graded":
            return None
        squeeze_film, now = found.begun
        layout = film_layout(squeeze_film.system, now.x, squeeze_film.scales.thickness)
        return self._carried(found, self._system(layout, density))

    def _coarser(self, film: Film, last: Sequence[Adapted]) -> Film | None:
        """The film on a coarser mesh that fits it, too, for the estimate; None without one."""
        if not (self.p.error_estimate and self.p.mesh == "graded"):
            return None
        density = coarser_density(self.p.density)
        before = [a.coarser for a in last if a.coarser and a.film.system is film.system]
        if before:
            solver = self.films.on(before[-1].system)
            found = solver.from_neighbour(before, film.loads.speed)
            system: SealSystem | None = solver.system
        else:
            found, system = None, self._system(film.system.section.layout, density)
        if not isinstance(found, Film):
            found = self._carried(film, system)
        if isinstance(found, Film):
            found = self._settled(found, density, film)
        return found if isinstance(found, Film) else None

    def _system(self, layout: Layout, density: Fraction) -> SealSystem | None:
        """The system on a mesh; None where that is too coarse for the corners of a section."""
        try:
            return build_system(self.p, layout, density)
        except MeshError:
            return None

    def _carried(self, found: Film | NoFilm, system: SealSystem | None) -> Film | NoFilm | None:
        """The film on the mesh of a system; None where there is no mesh, or no contact state on it.

        It is squeezed out from the contact if none was found, or if the carried one ends. Two of
        three O-rings that take this have no `ok` at -10 mm/s without it (docs/validation).
        """
        if system is None or found.begun is None:
            return None
        squeeze_film, now = found.begun
        try:
            dry = self.contacts.from_mesh(squeeze_film.system, squeeze_film.dry, system)
        except StageError:
            return None
        solver, film = self.films.on(system), squeeze_film.film
        if isinstance(found, Film):
            transfer = FilmTransfer(squeeze_film.system, system, (squeeze_film.dry, dry[1]))
            start, pressures = replace(now, x=transfer.state(now.x)), transfer.pressures(now.x)
            carried = squeeze_film.carried(system, start.x, dry[1])
            again = solver.from_film(carried, start, pressures)
            if isinstance(again, Film):
                return again
        return solver.from_contact(film.stroke, film.speed, dry[1])


def _sure(film: Film, coarser: Film | None) -> bool:
    """True if the estimated errors leave a state `ok`, as far as a mesh decides it.

    Another mesh of the same arc does not add the oil beyond its ends.
    """
    if coarser is None:
        return False
    bound = friction_bound(film.system.parameters.density, film.numbers, coarser.numbers)
    left = LARGEST_ERROR - 100.0 * film.numbers.beyond
    return bound <= (left if left > 0.0 else LARGEST_ERROR)


def _misfit(film: Film, density: float) -> float:
    return misfit(film.system, film.x, film.squeeze_film.scales.thickness, density)
