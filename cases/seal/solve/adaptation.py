"""A film and its mesh: solved, the mesh made for it, carried there and solved again.

The loop ends where the mesh fits the film that is solved on it. The errors that are left are
estimated from the same film on the last mesh with fewer segments (`states.estimate`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.carried import Carrier
from softehl.cases.seal.solve.films import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.placement import film_layout, misfit
from softehl.cases.seal.states.estimate import coarser_density, system_at
from softehl.cases.seal.states.state import Observer, StageRecord
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.newton import Newton

FITS = 3.0
"""Segments that a film may ask for in the place of one. Where it asked for at most three, h*
changed by 0.5 % or less on the mesh that was made for it; where for nine, by 7 %."""

CYCLES = 6
"""Meshes of a film, at most."""


@dataclass(frozen=True, eq=False)
class Adapted:
    """A film on the mesh that was made for it.

    other: its numbers on the coarser mesh, None where it was not asked for or not found. fits:
    whether the mesh fits the film.
    """

    film: Film
    other: FilmNumbers | None
    fits: bool = True


@dataclass(frozen=True, eq=False)
class Adaptation:
    """Makes meshes for films.

    p: the case, whose density they have. newton, observer, offset: as of `FilmSolver`.
    """

    p: ORing
    newton: Newton
    observer: Observer
    offset: float
    records: list[StageRecord] = field(default_factory=list)

    def adapted(self, found: Film | NoFilm) -> Adapted | NoFilm:
        """A film on a mesh that fits it, from that on the mesh made by contact.

        Where a mesh does not bear the film all the way, it goes on on one made for it there.
        """
        film, fits = None, False
        for _ in range(CYCLES):
            if isinstance(found, Film):
                film, fits = found, self._fits(found)
            again = None if fits else self._remeshed(found)
            if again is None:
                break
            found = again
        if film is None:
            assert isinstance(found, NoFilm)
            return found
        return Adapted(film, self._coarser(film), fits)

    def _fits(self, film: Film) -> bool:
        """Whether a mesh fits its film; a mesh that is given is as it is."""
        p, thickness = film.system.parameters, film.squeezing.scales.thickness
        return p.mesh != "graded" or misfit(film.system, film.x, thickness, p.density) <= FITS

    def _remeshed(self, found: Film | NoFilm) -> Film | NoFilm | None:
        """The film on the mesh that is made for it; None where there is none."""
        if found.begun is None:
            return None
        squeezing, now = found.begun
        layout = film_layout(squeezing.system, now.x, squeezing.scales.thickness)
        try:
            return self._carried(found, build_system(self.p, layout))
        except MeshError:
            return None

    def _coarser(self, film: Film) -> FilmNumbers | None:
        """The numbers of a film on the coarser mesh of the estimate; None without one."""
        p = film.system.parameters
        if not (p.error_estimate and p.mesh == "graded"):
            return None
        try:
            system = system_at(film.system, coarser_density(p.density))
        except MeshError:
            return None  # too coarse for the corners of a section
        found = self._carried(film, system)
        return found.numbers if isinstance(found, Film) else None

    def _carried(self, found: Film | NoFilm, system: SealSystem) -> Film | NoFilm:
        assert found.begun is not None
        squeezing, now = found.begun
        carrier = Carrier(squeezing.system, system)
        start, pressures = replace(now, x=carrier.state(now.x)), carrier.pressures(now.x)
        solver = FilmSolver(system, self.newton, self.observer, self.offset, self.records)
        go_on = solver.from_film if isinstance(found, Film) else solver.from_moment
        return go_on(squeezing.carried(system, start.x), start, pressures)
