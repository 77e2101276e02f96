"""Quantities of a result that are differentiated, with their slopes by the unknowns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.equations.interpolation import shares
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.mesh import MeshError, place_text
from softehl.runtime.sensitivity.linearised_step import Linear
from softehl.runtime.sensitivity.tape import Trail
from softehl.runtime.suggestions import listed, meant


class Quantity(Protocol):
    """A number that a converged step has."""

    def value(self, trail: Trail) -> float:
        """The number."""
        ...

    def slope(self, linear: Linear) -> Array:
        """Its derivative by all unknowns, (n,)."""
        ...

    def weights(self, linear: Linear) -> Array:
        """Weights (n,) with which it counts the forces that make reactions, zero if it does not."""
        ...


@dataclass(frozen=True)
class AtPlace:
    """An unknown at a place of the undeformed mesh."""

    name: str
    place: tuple[float, ...]

    def value(self, trail: Trail) -> float:
        """See `Quantity`."""
        return float(self._shares(trail.system) @ trail.x)

    def slope(self, linear: Linear) -> Array:
        """See `Quantity`."""
        return self._shares(linear.trail.system)

    def _shares(self, system: System) -> Array:
        """Weights (n,) of all unknowns."""
        _require(self.name, system)
        place, found = np.asarray(self.place, dtype=np.float64), np.zeros(system.size)
        known = shares(system, place)
        if known is None:
            raise MeshError(f"{place_text(place)} lies outside the mesh")
        if self.name not in known:
            raise StudyError(f"no {self.name} at {place_text(place)}; there are {listed(known)}")
        numbers, weights = known[self.name]
        np.add.at(found, numbers, weights)
        return found

    def weights(self, linear: Linear) -> Array:
        """See `Quantity`."""
        return np.zeros(linear.trail.system.size)


@dataclass(frozen=True)
class Reaction:
    """The sum of reactions at a side."""

    name: str
    side: str

    def value(self, trail: Trail) -> float:
        """See `Quantity`."""
        linear = Linear(trail)
        return float(self.weights(linear) @ linear.forces())

    def slope(self, linear: Linear) -> Array:
        """See `Quantity`."""
        return linear.by_unknowns(self.weights(linear))

    def weights(self, linear: Linear) -> Array:
        """See `Quantity`."""
        system = linear.trail.system
        _require(self.name, system)
        numbers, found = system.numbering.nodal[self.name], np.zeros(system.size)
        there = numbers[system.mesh.nodes(self.side)]
        found[there[there >= 0]] = 1.0
        return found


@dataclass(frozen=True)
class Function:
    """A function of all unknowns (n,) that returns its value and its gradient (n,)."""

    function: Callable[[Array], tuple[float, Array]]

    def value(self, trail: Trail) -> float:
        """See `Quantity`."""
        return float(self.function(trail.x)[0])

    def slope(self, linear: Linear) -> Array:
        """See `Quantity`."""
        found = np.asarray(self.function(linear.trail.x)[1], dtype=np.float64)
        if found.shape != linear.trail.x.shape:
            raise StudyError(
                f"the gradient of a quantity has the shape {found.shape}, must be "
                f"{linear.trail.x.shape}"
            )
        return found

    def weights(self, linear: Linear) -> Array:
        """See `Quantity`."""
        return np.zeros(len(linear.trail.x))


def quantity(
    what: str | Callable[[Array], tuple[float, Array]],
    at: tuple[float, ...] | None,
    reaction: str | None,
) -> Quantity:
    """A quantity as it was asked for.  Raises StudyError."""
    if callable(what):
        return Function(what)
    if (at is None) == (reaction is None):
        raise StudyError(
            f"sensitivity({what!r}): give at=(x, y), a place, or reaction=..., a side: one of them"
        )
    return Reaction(what, reaction) if at is None and reaction is not None else _at(what, at)


def _at(name: str, at: tuple[float, ...] | None) -> AtPlace:
    try:
        return AtPlace(name, tuple(float(c) for c in at or ()))
    except (TypeError, ValueError):
        raise StudyError(f"at={at!r}: a place is a tuple of numbers, (48, 60)") from None


def _require(name: str, system: System) -> None:
    nodal = system.numbering.nodal
    if name not in nodal:
        raise StudyError(f"no unknown {name!r}{meant(name, nodal)}; at nodes: {listed(nodal)}")
