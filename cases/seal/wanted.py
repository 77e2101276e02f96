"""What is wanted of a stroke: the films that are reported, or held for a mesh that is better.

An error is estimated from the film of a coarser mesh. Where that of the mesh in use has none, or
another film than ours, that of another mesh says as much: it has its nodes elsewhere, and agrees
only with what both of them resolve.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf, isnan
from typing import TypeAlias

from softehl.cases.harness.row import OK
from softehl.cases.seal.film_path import BuiltFilm
from softehl.cases.seal.state import CLIPPED, UNCERTAIN, FilmState, doubt
from softehl.cases.seal.verdict import FilmNumbers

Judged: TypeAlias = Callable[[FilmNumbers | None], FilmState]
"""The state of a film, its errors by the same film of a coarser mesh, None where there is none."""


def _nothing(state: FilmState) -> None:
    """Default of Wanted.draft."""


@dataclass
class Wanted:
    """What is still to be reported of a stroke, on one mesh after the other.

    report: takes a state for good. left: |U| without one, mm/s, in the order in which they are
    solved. draft: takes a state that another mesh may better. held: by |U|, such states and their
    films. last: the slowest film on the mesh in use, and its unknowns. compared: whether no state
    is final before all meshes had their turn. coarser: films by |U| of the coarser meshes, one
    after the other; the last one's are those of the mesh in use.
    """

    report: Callable[[FilmState], None]
    left: tuple[float, ...]
    draft: Callable[[FilmState], None] = _nothing
    held: dict[float, list[tuple[FilmState, Judged]]] = field(default_factory=dict)
    last: BuiltFilm | None = None
    compared: bool = False
    coarser: list[dict[float, FilmNumbers]] = field(default_factory=list)

    def begin(self, coarser: Mapping[float, FilmNumbers]) -> dict[float, FilmNumbers]:
        """Another mesh is in use, with these films of its coarser one; more may be added."""
        self.last = None
        self.coarser.append(dict(coarser))
        return self.coarser[-1]

    def found(self, speed: float, film: Judged, *, final: bool) -> None:
        """A film at |U|; it is held if another mesh may better it, unless it is final.

        The arc of another mesh ends where that of the first does: what is clipped stays so.
        """
        state = film(self.coarser[-1].get(speed) if self.coarser else None)
        if self.compared and state.verdict == UNCERTAIN:
            state = self._least_in_doubt(speed, (state, film))
        if (final and not self.compared) or state.verdict in (OK, CLIPPED):
            self._reported(state)
            return
        held = self.held.setdefault(speed, [])
        held.append((state, film))
        self.draft(self._least_in_doubt(speed, *held))

    def close(self) -> None:
        """No other mesh follows: what is held is reported."""
        for speed in self.left:
            if speed in self.held:
                self._reported(self._least_in_doubt(speed, *self.held[speed]))

    def _least_in_doubt(self, speed: float, *held: tuple[FilmState, Judged]) -> FilmState:
        """Of films at |U|; each beside those of all coarser meshes where these are compared."""
        states = [state for state, _ in held]
        for state, film in held if self.compared else ():
            others = [known[speed] for known in self.coarser if speed in known]
            states += [film(other) for other in others if state.verdict == UNCERTAIN]
        return min(states, key=_doubt)

    def _reported(self, state: FilmState) -> None:
        self.left = tuple(u for u in self.left if u != abs(state.rod_speed_mm_s))
        self.report(state)


def _doubt(state: FilmState) -> tuple[float, ...]:
    error = state.h_star_error_percent
    return *doubt(state), inf if isnan(error) else abs(error)
