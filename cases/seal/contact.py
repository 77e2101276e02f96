"""First stage: the mesh of a section and its contact state, by whichever way leads there cheaply.

A path from rest is walked on a coarse mesh, unless another run has left a state to start from;
finer and graded meshes start from a coarser or a uniform one and are corrected by Newton's method.
Where a way does not lead to the end, the next one begins on a finer mesh, the last of them on the
mesh itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from softehl.cases.seal.contact_store import ContactStore, stored_contact
from softehl.cases.seal.grading import PASSES, graded_disc
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.path import PathSettings, load_stage, squeeze_stage
from softehl.cases.seal.refinement import carried_contact, finer
from softehl.cases.seal.section import OringSection, build_section
from softehl.cases.seal.stage import Stage
from softehl.cases.seal.stopped import Stopped
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton

State = tuple[OringSection, Array]

GUIDE = 2
"""Least density of the uniform mesh whose contact shows where a graded one is to be fine."""


@dataclass(frozen=True)
class ContactRoute:
    """Ways to a contact state.

    walk: solves a stage from a start or raises Stopped. newton: corrector of stored states.
    contacts: states of uniform meshes that runs leave for each other.
    """

    settings: PathSettings
    walk: Callable[[Stage, Array], Array]
    newton: Newton = field(default_factory=Newton)
    contacts: ContactStore = field(default_factory=ContactStore)

    def contact(self, p: ORing) -> State:
        """The section of a case, uniform or graded, and its unknowns in contact under p_s.

        Raises Stopped where no way leads there.
        """
        return self._graded(p) if p.mesh == "graded" else self._uniform(p)

    def _uniform(self, p: ORing) -> State:
        """By way of coarser meshes; on the mesh itself if that is asked for or the ways fail."""
        if p.solver == "auto":
            coarser = list(_doublings(1, p.density // 2))
            stored = self.contacts.densities(p, (*coarser, p.density))
            ways = [(d, self._stored) for d in stored] + [(d, self._loaded) for d in coarser]
            for coarsest, begin in ways:
                with suppress(Stopped):
                    section = build_section(_at(p, coarsest))
                    return self._refined(section, begin(section), p.density)
        section = build_section(p)
        return section, self._loaded(section)

    def _stored(self, section: OringSection) -> Array:
        """Unknowns of a section in contact, from a stored state."""
        stage = stored_contact(section, self.settings, self.newton)
        return self.walk(stage, self.contacts.read(section))

    def _loaded(self, section: OringSection) -> Array:
        """Unknowns of a section in contact, from rest: squeezed, then loaded by p_s."""
        p_s = section.parameters.sealed_pressure
        x = self.walk(squeeze_stage(section, self.settings), section.at_rest())
        x = self.walk(load_stage(section, self.settings, p_s), x) if p_s > 0.0 else x
        self.contacts.keep(section, x)
        return x

    def _graded(self, p: ORing) -> State:
        """Graded at a low density, from the uniform mesh of that density, then refined."""
        for guide in _doublings(min(GUIDE, p.density), p.density // 2):
            with suppress(Stopped):
                return self._refined(*self._regraded(_at(p, guide)), p.density)
        return self._regraded(p)

    def _regraded(self, p: ORing) -> State:
        section, x = self._uniform(p.model_copy(update={"mesh": "uniform", "solver": "auto"}))
        for number in range(1, PASSES + 1):
            graded = build_section(p, graded_disc(section, x))
            name = f"contact on graded mesh {number}"
            x = self.walk(*carried_contact(section, graded, self.settings, x, name))
            section = graded
        return section, x

    def _refined(self, section: OringSection, x: Array, density: int) -> State:
        """From a contact state to that of the same mesh at `density`, doubling by doubling."""
        while section.parameters.density < density:
            coarse = section
            section = build_section(finer(coarse.parameters), coarse.disc)
            x = self.walk(*carried_contact(coarse, section, self.settings, x))
            if section.parameters.mesh == "uniform":
                self.contacts.keep(section, x)
        return section, x


def _doublings(first: int, last: int) -> Iterator[int]:
    """first, 2 first, ... up to last."""
    while first <= last:
        yield first
        first *= 2


def _at(p: ORing, density: int) -> ORing:
    return p.model_copy(update={"density": density})
