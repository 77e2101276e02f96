"""A case whose parameters vary while its mesh is frozen: the map from its measures to the nodes.

A mesh is laid out by angles and shares (where the arc begins and ends, how its segments are
spaced); these are frozen, so that every node is centre + radius times a constant. A remeshed run
differs from that by the error of its mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from softehl.cases.seal import materials
from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.given import number, times
from softehl.cases.seal.layout import RoundLayout, uniform_layout
from softehl.cases.seal.loads import FilmLoads
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.section import SealSection
from softehl.runtime.fem.design import Inputs, rate_of

SPEED, PRESSURE_KEY = "U", "sealed_pressure"
"""Parameters of a film that are no numbers of the case alone: the rod speed, as it is named in
tables, and the sealed pressure."""

LENGTHS = (
    *("section_diameter", "inner_diameter", "rod_diameter", "housing_diameter"),
    *("groove_width", "groove_centre"),
)
"""Keys of a case that are lengths."""

NUMBERS = (
    *LENGTHS,
    *(*materials.KEYS, "bulk_modulus"),
    *("viscosity", "pressure_viscosity", "cavitation_penalty"),
)
"""Physical and geometric keys of a case; the terms of an Ogden rubber count as one."""

_WIDE = 0.01  # relative step: what follows from a key is a polynomial of low degree


@dataclass(frozen=True, eq=False)
class FilmCase:
    """A film of a system: what its equations depend on besides the unknowns."""

    system: SealSystem
    film: FilmLoads

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that are not zero."""
        p = self.system.parameters
        values = {name: getattr(p, name) for name in (*NUMBERS, PRESSURE_KEY)}
        return (*(name for name, v in values.items() if _varies(v)), SPEED)

    def scaled(self, name: str, by: float) -> FilmCase:
        """The film with a parameter (1 + by) times as large, on the frozen mesh."""
        film, p = self.film, self.system.parameters
        if name == SPEED:
            return replace(self, film=replace(film, speed=(1.0 + by) * film.speed))
        if name == PRESSURE_KEY:
            film = replace(film, sealed_pressure=(1.0 + by) * film.sealed_pressure)
        value = times(getattr(p, name), 1.0 + by)
        return FilmCase(frozen(self.system, p.model_copy(update={name: value})), film)

    def inputs(self) -> Inputs:
        """What its equations are given."""
        return Inputs.of(self.system.film_problem(self.film))

    def rate(self, name: str) -> Inputs:
        """The rate of its inputs by the logarithm of a parameter.

        All of them are polynomials of the keys, of degree 4 at most (polar moment of the section),
        but for the augmentation of contacts, on which no converged state depends.
        """
        return rate_of(lambda by: self.scaled(name, by).inputs(), _WIDE)


def _varies(value: Any) -> bool:
    """Whether a value is a number, or numbers, other than zero."""
    numbers = value if isinstance(value, tuple) else (value,)
    return any(number(v) and v for v in numbers)


def frozen(system: SealSystem, p: ORing) -> SealSystem:
    """The system of other parameters on the same mesh, moved with the measures of its section."""
    old, new = system.section.layout, uniform_layout(p)
    assert isinstance(old, RoundLayout)
    assert isinstance(new, RoundLayout)
    disc = replace(
        old.disc,
        centre_z=new.disc.centre_z,
        centre_r=new.disc.centre_r,
        radius=new.disc.radius,
    )
    mesh = system.mesh
    unit = (mesh.points - old.disc.centre) / old.disc.radius
    points = disc.centre + disc.radius * unit
    scale = disc.radius / old.disc.radius
    places, length = scale * mesh.places, scale * mesh.length
    moved = replace(mesh, points=points, places=places, length=length)
    return system.moved(p, SealSection(RoundLayout(disc), moved, system.section.placed))
