"""What is wanted of a stroke: the films that are reported, or held for a mesh that is better.

An error is estimated from the film of a coarser mesh. Where that of the mesh in use has none, or
another film than ours, that of another mesh says as much: it has its nodes elsewhere, and agrees
only with what both of them resolve. Where all of them say nothing, or too much, a finer mesh does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf, isnan
from typing import Protocol

from softehl.cases.harness.row import OK
from softehl.cases.seal.solve.film_path import BuiltFilm
from softehl.cases.seal.states.state import CLIPPED, UNCERTAIN, FilmState, doubt
from softehl.cases.seal.states.verdict import FilmNumbers


class Judged(Protocol):
    """What is said of a film."""

    def __call__(self, other: FilmNumbers | None, *, finer: bool = False) -> FilmState:
        """Its state, its errors by the same film of a coarser mesh or a finer one, if there is."""


@dataclass(frozen=True)
class Found:
    """A film that was found. finer: the same on a finer mesh, if it is found there."""

    judged: Judged
    finer: Callable[[], FilmNumbers | None] = lambda: None


def _nothing(state: FilmState) -> None:
    """Default of Wanted.draft."""


@dataclass
class Wanted:
    """What is still to be reported of a stroke, on one mesh after the other.

    report: takes a state for good. left: |U| without one, mm/s, in the order in which they are
    solved. draft: takes a state that another mesh may better. held: by |U|, such states and their
    films. last: the slowest film on the mesh in use, and its unknowns. compared: whether no state
    is final before all meshes had their turn, the finer ones that estimate errors included.
    coarser: films by |U| of the coarser meshes, one after the other; the last one's are those of
    the mesh in use.
    """

    report: Callable[[FilmState], None]
    left: tuple[float, ...]
    draft: Callable[[FilmState], None] = _nothing
    held: dict[float, list[tuple[FilmState, Found]]] = field(default_factory=dict)
    last: BuiltFilm | None = None
    compared: bool = False
    coarser: list[dict[float, FilmNumbers]] = field(default_factory=list)

    def begin(self, coarser: Mapping[float, FilmNumbers]) -> dict[float, FilmNumbers]:
        """Another mesh is in use, with these films of its coarser one; more may be added."""
        self.last = None
        self.coarser.append(dict(coarser))
        return self.coarser[-1]

    def found(self, speed: float, film: Found, *, final: bool) -> None:
        """A film at |U|; it is held if another mesh may better it, unless it is final.

        The arc of another mesh ends where that of the first does: what is clipped stays so.
        """
        state = film.judged(self.coarser[-1].get(speed) if self.coarser else None)
        if self.compared and state.verdict == UNCERTAIN:
            state = self._least_in_doubt(speed, (state, film))
        if (final and not self.compared) or state.verdict in (OK, CLIPPED):
            self._reported(state)
            return
        held = self.held.setdefault(speed, [])
        held.append((state, film))
        self.draft(self._least_in_doubt(speed, *held))

    def compare_with_finer(self) -> None:
        """Ask finer meshes, once each, about films that the coarser ones leave in doubt."""
        for speed in [u for u in self.left if u in self.held]:
            held = self.held[speed]
            for number, (state, film) in enumerate(held):
                if state.verdict != UNCERTAIN:
                    continue
                other = film.finer()
                state = film.judged(other, finer=True) if other else state
                held[number] = state, Found(film.judged)
                if state.verdict == OK:
                    self._reported(state)
                    break

    def close(self) -> None:
        """No other mesh follows: what is held is reported."""
        if self.compared:
            self.compare_with_finer()
        for speed in self.left:
            if speed in self.held:
                self._reported(self._least_in_doubt(speed, *self.held[speed]))

    def _least_in_doubt(self, speed: float, *held: tuple[FilmState, Found]) -> FilmState:
        """Of films at |U|; each beside those of all coarser meshes where these are compared."""
        states = [state for state, _ in held]
        for state, film in held if self.compared else ():
            others = [known[speed] for known in self.coarser if speed in known]
            states += [film.judged(other) for other in others if state.verdict == UNCERTAIN]
        return min(states, key=_doubt)

    def _reported(self, state: FilmState) -> None:
        self.left = tuple(u for u in self.left if u != abs(state.rod_speed_mm_s))
        self.report(state)


def _doubt(state: FilmState) -> tuple[float, ...]:
    error = state.h_star_error_percent
    return *doubt(state), inf if isnan(error) else abs(error)
