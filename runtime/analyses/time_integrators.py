"""Schemes in time for M a + f(u, v) = F: what they make of accelerations and velocities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.suggestions import meant

Method: TypeAlias = Literal["generalised-alpha", "newmark", "midpoint", "explicit"]
METHODS: tuple[Method, ...] = ("generalised-alpha", "newmark", "midpoint", "explicit")
DAMPED = 0.8
"""Spectral radius at infinite frequency of generalised-alpha, unless it is given: a fifth of the
amplitude of what the mesh cannot resolve is lost in each step.
"""


@dataclass(frozen=True, eq=False)
class Affine:
    """c u + rest, of the unknowns u at the end of a step: rest is (n,)."""

    c: float
    rest: Array

    def at(self, u: Array) -> Array:
        """Its value, (n,)."""
        return self.c * u + self.rest

    def mixed(self, share: float, other: Array, of_other: float) -> Affine:
        """share times this one, and of_other times a vector."""
        return Affine(share * self.c, share * self.rest + of_other * other)


@dataclass(frozen=True)
class Weighted:
    """Generalised-alpha (Chung and Hulbert 1993), in which forces at both ends of a step are
    weighted; Newmark's trapezoidal rule where both alphas are one half.

        (1 - am) M a1 + am M a0 + (1 - af) f1 + af f0 + c = 0

    Forces c of ties and contacts are one for the step: so an impact gains no energy, and with a
    radius below 1 what it leaves on the surface is damped. Equations without inertia, of supports,
    ties and contacts above all, hold at the end of the step.
    """

    am: float
    af: float

    averaged = False

    @classmethod
    def of(cls, radius: float) -> Weighted:
        """With a spectral radius at infinite frequency in [0, 1]; order 2."""
        return cls((2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0))

    @property
    def damps(self) -> bool:
        """True if fast motions lose amplitude."""
        return self.af < 0.5

    @property
    def gamma(self) -> float:
        """Newmark's."""
        return 0.5 - self.am + self.af

    @property
    def beta(self) -> float:
        """Newmark's."""
        return 0.25 * (1.0 - self.am + self.af) ** 2

    def place(self) -> float:
        """Share of the step at whose end loads count."""
        return 1.0

    def velocity(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """At the end of a step from u, v, a, (n,) each."""
        after, g = self.acceleration(dt, u, v, a), self.gamma * dt
        return Affine(g * after.c, v + (dt - g) * a + g * after.rest)

    def acceleration(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """Likewise."""
        c = 1.0 / (self.beta * dt**2)
        return Affine(c, -c * (u + dt * v) - (0.5 / self.beta - 1.0) * a)

    def inertial(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The acceleration in the equation, which is divided by 1 - af."""
        over = 1.0 / (1.0 - self.af)
        return self.acceleration(dt, u, v, a).mixed(over * (1.0 - self.am), a, over * self.am)

    def rate(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The velocity in the equation."""
        return self.velocity(dt, u, v, a)

    def before(self) -> float:
        """Factor of the forces at the beginning of the step in the equation."""
        return self.af / (1.0 - self.af)

    def weight(self) -> float:
        """Of the forces at the end."""
        return 1.0 - self.af


@dataclass(frozen=True)
class Midpoint:
    """The midpoint rule with the `discrete_gradient` of the energy along the step: energy stays."""

    averaged = True
    damps = False

    def place(self) -> float:
        """Loads are those of the middle."""
        return 0.5

    def velocity(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """At the end of a step."""
        return Affine(2.0 / dt, -2.0 / dt * u - v)

    def acceleration(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """Mean of the step."""
        return Affine(2.0 / dt**2, -2.0 / dt**2 * u - 2.0 / dt * v)

    def inertial(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The acceleration in the equation."""
        return self.acceleration(dt, u, v, a)

    def rate(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The velocity in the equation: the mean of the step."""
        return Affine(1.0 / dt, -u / dt)

    def before(self) -> float:
        """No forces of the beginning."""
        return 0.0

    def weight(self) -> float:
        """All forces are means of the step."""
        return 1.0


@dataclass(frozen=True)
class Backward:
    """Backward Euler steps, which find what belongs to an inconsistent beginning."""

    averaged = False
    damps = True

    def place(self) -> float:
        """Loads are those of the end."""
        return 1.0

    def velocity(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """At the end of a step."""
        return Affine(1.0 / dt, -u / dt)

    def acceleration(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """Likewise."""
        return Affine(1.0 / dt**2, -(u / dt + v) / dt)

    def inertial(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The acceleration in the equation."""
        return self.acceleration(dt, u, v, a)

    def rate(self, dt: float, u: Array, v: Array, a: Array) -> Affine:
        """The velocity in the equation."""
        return self.velocity(dt, u, v, a)

    def before(self) -> float:
        """No forces of the beginning."""
        return 0.0

    def weight(self) -> float:
        """All forces are those of the end."""
        return 1.0


Scheme: TypeAlias = Weighted | Midpoint | Backward


def scheme_of(method: str, radius: float | None) -> Scheme | None:
    """The implicit scheme of a name, None for "explicit".  Raises StudyError."""
    if radius is not None and method != "generalised-alpha":
        raise StudyError(f'rho_inf = {radius:g}: only method = "generalised-alpha" has it')
    if radius is not None and not 0.0 <= radius <= 1.0:
        raise StudyError(f"rho_inf = {radius:g}: allowed is 0 (damps most) to 1 (damps nothing)")
    if method == "generalised-alpha":
        return Weighted.of(DAMPED if radius is None else radius)
    if method == "newmark":
        return Weighted.of(1.0)  # with consistent accelerations it is the same
    return Midpoint() if method == "midpoint" else None


def require_method(method: object, others: tuple[str, ...]) -> None:
    """Raise StudyError for a name that is none of these, and none of ours."""
    names = (*others, *METHODS)
    if method not in names:
        words = ", ".join(f'"{name}"' for name in names)
        raise StudyError(f"method = {method!r}{meant(method, names)}: allowed are {words}")


def require_none(method: object, given: Mapping[str, object]) -> None:
    """Raise StudyError for an argument that the method does not have."""
    for name, value in given.items():
        if value is not None:
            raise StudyError(f'{name}: method = "{method}" has no such thing; leave it out')
