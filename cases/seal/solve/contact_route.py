"""First stage: the mesh of a section and its contact state, by the cheapest route that succeeds.

A path from rest is followed on a coarse mesh, unless another run has left a state to start from;
finer and graded meshes start from a coarser or a uniform one and are corrected by Newton's method.
Where a route fails the next one begins on a finer mesh, the last of them on the mesh itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.contact import (
    against_wall,
    along,
    held_place,
    lean_stage,
    let_go_stage,
    squeeze_stage,
    wedged,
)
from softehl.cases.seal.solve.contact_store import ContactStore, stored_contact
from softehl.cases.seal.solve.grading import PASSES, graded_layout, placed_layout
from softehl.cases.seal.solve.loading import Loading, State
from softehl.cases.seal.solve.path import Followed, PathSettings, Stage, StageFailed
from softehl.cases.seal.solve.refinement import finer
from softehl.cases.seal.solve.trail import Trail
from softehl.cases.seal.states.contact_results import unsealed
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton

_CUTS = (1.0, 0.25, 0.0625)  # of the first step of the squeeze, one after the other

COARSE = 1
"""Density on which a path from rest is followed first: it is cheap there."""

SEALS = 3
"""How often a mesh is made anew because the sealed pressure ends where nothing touches."""

GUIDE = 2
"""Least density of a mesh whose contact shows where another one is to be fine."""


@dataclass(frozen=True)
class ContactRoute:
    """Routes to a contact state.

    follow: solves a stage from a start. newton: corrector of stored states. contacts: states of
    uniform meshes that runs leave for each other. trail: what is kept of the last path.
    """

    settings: PathSettings
    follow: Callable[[Stage, Array], Followed]
    newton: Newton = field(default_factory=Newton)
    contacts: ContactStore = field(default_factory=ContactStore)
    trail: Trail = field(default_factory=Trail)

    def contact(self, p: ORing) -> State | StageFailed:
        """The system of a case, uniform or graded, and its unknowns in contact under p_s."""
        graded = p.mesh != "file" and (p.mesh == "graded" or p.given_arc is None)
        return self._graded(p) if graded else self._uniform(p)

    def _uniform(self, p: ORing) -> State | StageFailed:
        """From coarser meshes; on the mesh itself if that is asked for or the others fail."""
        if p.solver == "auto":
            coarser = list(_doublings(1, p.density // 2))
            stored = self.contacts.densities(p, (*coarser, p.density))
            ways = [(d, self._stored) for d in stored] + [(d, self._loaded) for d in coarser]
            for coarsest, begin in ways:
                system = build_system(_at(p, coarsest))
                state = self._refined(system, begin(system), p.density)
                if not isinstance(state, StageFailed):
                    return state
        system = build_system(p)
        return self._refined(system, self._loaded(system), p.density)

    def _stored(self, system: SealSystem) -> Followed:
        """Unknowns of a section in contact, from a stored state."""
        stage = stored_contact(system, self.settings, self.newton)
        return self.follow(stage, self.contacts.read(system))

    def _loaded(self, system: SealSystem) -> Followed:
        """Unknowns of a section in contact, from rest: squeezed, then loaded by p_s."""
        x = self._squeezed(system)
        if held_place(system.parameters) is None and not isinstance(x, StageFailed):
            x = self._pressed(system, x)
        if not isinstance(x, StageFailed):
            self.contacts.keep(system, x)
        return x

    def _squeezed(self, system: SealSystem) -> Followed:
        """Unknowns of a squeezed section without pressure; a failed start is tried closer."""
        for cut in _CUTS:
            stage = squeeze_stage(system, self.settings, cut)
            x = self.follow(self._quicker(system, stage), system.at_rest())
            if not isinstance(x, StageFailed) or x.branch.points:
                break
        return x

    def _pressed(self, system: SealSystem, x: Array) -> Followed:
        """From the squeezed to the loaded section, by way of the wall unless both walls hold it."""
        p_s, force = system.parameters.sealed_pressure, 0.0
        if p_s > 0.0 and not wedged(system, x):
            y, place = against_wall(system, x)
            stage = lean_stage(system, self.settings, place)
            leaning = self.follow(self._quicker(system, stage), y)
            if isinstance(leaning, StageFailed):
                return leaning
            x, force = leaning, system.axial_force(leaning)
        if system.parameters.rubs:
            free = self.follow(let_go_stage(system, self.settings, x), x)
            if isinstance(free, StageFailed):
                return free
            x = free
        return self.loading.followed(system, x, force=force)

    @property
    def loading(self) -> Loading:
        """Carries contact states from mesh to mesh."""
        return Loading(self.settings, self.follow, self.newton, self.trail)

    def _quicker(self, system: SealSystem, stage: Stage) -> Stage:
        """A stage whose steps are corrected by what is quickest."""
        return replace(stage, corrector=along(system, self.newton))

    def _graded(self, p: ORing) -> State | StageFailed:
        """Graded at a low density, from the uniform mesh of that density, then refined."""
        if p.given_arc is None:
            return self._placed(p)
        for guide in _doublings(min(GUIDE, p.density), p.density // 2):
            graded = self._regraded(_at(p, guide))
            if not isinstance(graded, StageFailed):
                graded = self._refined(*graded, p.density)
            if not isinstance(graded, StageFailed):
                return graded
        return self._regraded(p)

    def _placed(self, p: ORing) -> State | StageFailed:
        """On an arc that the contact places, from the coarsest guide that leads there."""
        density = min(GUIDE, p.density)
        state: State | StageFailed
        # what sticks keeps the rotation of the mesh on which it began to
        for guide in _doublings(density if p.rubs else COARSE, density):
            state = self._guided(p, guide)
            if not isinstance(state, StageFailed) and guide < density:
                state = self._finer(state, density)
            if not isinstance(state, StageFailed):
                state = self._sealed(_at(p, density), state)
            if not isinstance(state, StageFailed):
                state = self._refined(*state, p.density)
            if not isinstance(state, StageFailed):
                break
        return state

    def _sealed(self, p: ORing, state: State) -> State | StageFailed:
        """On the last of the graded meshes; on more where pressure ends outside the contact."""
        found: State | StageFailed = state
        for number in range(PASSES, PASSES + SEALS):
            if isinstance(found, StageFailed):
                break
            found = self._on(placed_layout(*found, p), p, found, number)
            if isinstance(found, StageFailed) or not unsealed(*found):
                break
        return found

    def _finer(self, state: State, density: int) -> State:
        """A contact state at `density` where it can be carried to it, else as it is.

        All that it is for is the next mesh: a path of its own would cost as much as one on that.
        """
        found = self._refined(*state, density, alone=True)
        return state if isinstance(found, StageFailed) else found

    def _guided(self, p: ORing, density: int) -> State | StageFailed:
        """Seen on a wide uniform arc of low density, then on all but the last of graded meshes."""
        guide = build_system(_at(p.model_copy(update={"mesh": "uniform"}), density))
        x = self._kept(guide)
        state = x if isinstance(x, StageFailed) else (guide, x)
        for number in range(1, PASSES):
            if not isinstance(state, StageFailed):
                layout = placed_layout(*state, p, most=0)
                state = self._on(layout, _at(p, density), state, number)
        return state

    def _on(self, layout: Layout, p: ORing, before: State, number: int) -> State | StageFailed:
        """On a graded mesh: carried to it, or else by the path from rest, coarse or as it is."""
        new = build_system(p, layout)
        state = self.loading.carried(*before, new, f"contact on graded mesh {number}")
        for density in _doublings(COARSE, p.density):
            if isinstance(state, StageFailed):
                coarse = build_system(_at(p, density), layout)
                state = self._refined(coarse, self._loaded(coarse), p.density)
        return state

    def _kept(self, system: SealSystem) -> Followed:
        """Unknowns of a section in contact, from a stored state if there is a good one."""
        if self.contacts.densities(system.parameters, (system.parameters.density,)):
            x = self._stored(system)
            if not isinstance(x, StageFailed):
                return x
        return self._loaded(system)

    def _regraded(self, p: ORing) -> State | StageFailed:
        """On meshes graded in turn, each by the contact on the one before."""
        state = self._uniform(p.model_copy(update={"mesh": "uniform", "solver": "auto"}))
        for number in range(1, PASSES + 1):
            if isinstance(state, StageFailed):
                break
            graded = build_system(p, graded_layout(*state))
            name = f"contact on graded mesh {number}"
            state = self.loading.carried(*state, graded, name)
        return state

    def _refined(
        self, system: SealSystem, x: Followed, density: int, *, alone: bool = False
    ) -> State | StageFailed:
        """From a contact state to that of the same mesh at `density`, doubling by doubling.

        alone: see `Loading.carried`.
        """
        state = x if isinstance(x, StageFailed) else (system, x)
        while not isinstance(state, StageFailed) and state[0].parameters.density < density:
            coarse = state[0]
            state = self.loading.carried(
                *state, build_system(finer(coarse.parameters), coarse.section.layout), alone=alone
            )
            if not isinstance(state, StageFailed) and coarse.parameters.mesh != "graded":
                self.contacts.keep(*state)
        return state


def _doublings(first: int, last: int) -> Iterator[int]:
    """first, 2 first, ... up to last."""
    while first <= last:
        yield first
        first *= 2


def _at(p: ORing, density: int) -> ORing:
    return p.model_copy(update={"density": density})
