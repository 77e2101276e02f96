"""Map of a frozen mesh: from the measures of a section to the nodes, while parameters vary.

Ends and segments of the arc are frozen: every node of the outline keeps its part of a line or an
arc. A remeshed run differs from that by the error of its mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.key_values import number, times
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sensitivity_keys import LENGTHS, NUMBERS, PRESSURE_KEY, ROOM
from softehl.cases.seal.meshing.mesh_morphing import carried_mesh, carried_places
from softehl.cases.seal.section.layout import uniform_layout
from softehl.cases.seal.sensitivity.pseudo_loads import Inputs, rate_of
from softehl.runtime.discretisation.problem import Problem

SPEED = "U"
"""The rod speed as it is named in tables: a parameter of a film that is no key of a case."""


@dataclass(frozen=True, eq=False)
class FilmCase:
    """A film of a system: what its equations depend on besides the unknowns."""

    system: SealSystem
    film: FilmLoads

    @cached_property
    def problem(self) -> Problem:
        """Its equations."""
        return self.system.film_problem(self.film)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that are not zero."""
        p = self.system.parameters
        values = {name: getattr(p, name) for name in (*NUMBERS, PRESSURE_KEY)} | p.measures
        if not p.opens:  # without an edge its fillet decides nothing
            del values["corner_fillet"]
        return (*(name for name, v in values.items() if _varies(v)), SPEED)

    def scaled(self, name: str, by: float) -> FilmCase:
        """The film with a parameter (1 + by) times as large, on the frozen mesh."""
        film, p = self.film, self.system.parameters
        if name == SPEED:
            return replace(self, film=replace(film, speed=(1.0 + by) * film.speed))
        if name == PRESSURE_KEY:
            film = replace(film, sealed_pressure=(1.0 + by) * film.sealed_pressure)
        value = times(p.measures.get(name, getattr(p, name)), 1.0 + by)
        fixed = p.measures if name == "section_diameter" else {}
        return FilmCase(frozen(self.system, p.model_copy(update={**fixed, name: value})), film)

    def rate(self, name: str) -> Inputs:
        """The rate of its inputs by the logarithm of a parameter.

        The inputs are polynomials of the keys: of degree 4 at most in lengths (polar moment of the
        section), linear in the others. Two are not: the augmentation of contacts, on which no
        converged state depends, and arcs. So lengths have a shorter step: the nose of a D-ring that
        is hardly wider than the section moves with the root of the difference.
        """

        def inputs(by: float) -> Inputs:
            return Inputs.of(self.scaled(name, by).problem)

        if name in (*LENGTHS, *self.system.parameters.measures):
            return rate_of(inputs, step=0.1 * ROOM, degree=4)
        return rate_of(inputs, step=0.01, degree=2)


def _varies(value: Any) -> bool:
    """True if a value is a number, or numbers, other than zero."""
    numbers = value if isinstance(value, tuple) else (value,)
    return any(number(v) and v for v in numbers)


def frozen(system: SealSystem, p: Seal) -> SealSystem:
    """The system of other parameters on the same mesh, moved with the measures of its section.

    The sealed pressure ends at the nodes at which it ended.
    """
    old, new = system.section.layout, uniform_layout(p)
    previous, after = old.shape.outline, new.shape.outline
    section = system.section
    if previous.pieces == after.pieces:
        return system.moved(p, section)
    mesh = carried_mesh(section.mesh, previous, after)
    film = carried_places(np.array(old.film), previous, after)
    end_positions = (
        mesh.positions[section.lowest] - mesh.positions[0] + film[0],
        mesh.positions[section.crown],
    )
    layout = replace(
        new,
        film=(float(film[0]), float(film[1])),
        sizes=old.sizes,
        pressure_boundaries=(float(end_positions[0]), float(end_positions[1])),
    )
    return system.moved(p, replace(section, layout=layout, mesh=mesh))
