"""A film that can be solved again at another value of a key, on the mesh that it has."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.sensitivity.quantities import quantities
from softehl.cases.seal.sensitivity.variation import FilmCase
from softehl.cases.seal.solve.films import NoFilm
from softehl.cases.seal.solve.method import DryContact
from softehl.cases.seal.solve.path import StageFailed
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array
from softehl.runtime.fem.design import Tangent
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.sensitivity import direct


@dataclass(frozen=True, eq=False)
class HeldFilm:
    """A converged film x (n,) of a case with one stroke and one speed."""

    case: FilmCase
    x: Array
    newton: Newton

    @classmethod
    def of(cls, p: Seal) -> HeldFilm | None:
        """The film of a case; None where it is not reached."""
        assert p.stroke != "both"
        contact = DryContact.of(p, Silent())
        if isinstance(contact, StageFailed):
            return None
        found = contact.adapted(p.stroke, p.speeds[0])
        if isinstance(found, NoFilm):
            return None
        film = found.film
        return cls(FilmCase(film.system, film.loads), film.x, contact.newton)

    def change(self, quantity: str, key: str, factor: float) -> float | None:
        """A quantity over its value here, where a key is `factor` times as large; None if that film
        is not reached from this one.
        """
        moved = self.case.scaled(key, factor - 1.0)
        # a hundredth of a millimetre is many films: the start has to follow the key
        start = self.x + math.log(factor) * self._slope(key)
        solution = self.newton.solve(moved.system.film_problem(moved.film), start)
        if not solution.converged:
            return None
        return _value(moved, solution.x, quantity) / _value(self.case, self.x, quantity)

    def _slope(self, key: str) -> Array:
        """Rate (n,) of the film by the logarithm of a key."""
        tangent = Tangent.at(self.case.system.film_problem(self.case.film), self.x)
        load = tangent.load(self.case.rate(key))
        return direct(self.newton.linear, tangent.reduced, load[:, None])[:, 0]


def _value(case: FilmCase, x: Array, quantity: str) -> float:
    return quantities(case, case.system.film_problem(case.film), x)[quantity].value
