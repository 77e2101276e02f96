"""Integrators in time: backward Euler and BDF2; with inertia Newmark, generalised-alpha, midpoint.

An integrator is a value, `march(method=BDF2())`; a string is its short name. First-order ones give
du/dt = c u + rest at the end of a step. Second-order ones give the velocity and the acceleration
in M a + f(u, v) = F in the same form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any, ClassVar, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.suggestions import did_you_mean

ROUNDING = 1e-12  # of the whole time: a step is not cut to less than that before the end


@dataclass(frozen=True, eq=False)
class Affine:
    """c u + rest, of the unknowns u at the end of a step: rest is (n,)."""

    c: float
    constant: Array

    def at(self, u: Array) -> Array:
        """Its value, (n,)."""
        return self.c * u + self.constant

    def combined(self, factor: float, vector: Array, vector_factor: float) -> Affine:
        """factor times this one, plus vector_factor times a vector."""
        return Affine(factor * self.c, factor * self.constant + vector_factor * vector)


class Kinematics(Protocol):
    """Unknowns x, velocities v and accelerations a, (n,) each."""

    @property
    def x(self) -> Array: ...

    @property
    def v(self) -> Array: ...

    @property
    def a(self) -> Array: ...


@runtime_checkable
class FirstOrderIntegrator(Protocol):
    """Backward difference formula for du/dt.

    Attributes
    ----------
    name : str
        Short name.
    order : int
        Order, and number of previous states.
    """

    name: ClassVar[str]
    order: ClassVar[int]

    def weights(self, steps: Sequence[float]) -> Array:
        """Return the weights of d/dt at the newest time.

        Parameters
        ----------
        steps : sequence of float
            Lengths of the last steps, the newest first: `order` of them, or fewer at the start [s].

        Returns
        -------
        array (steps + 1,)
            Weights of the states, the newest first [1/s].
        """
        ...

    def error_fraction(self, dt: float, two_steps: float) -> float:
        """Return the local error as a fraction of a known difference.

        Parameters
        ----------
        dt : float
            Length of the step [s].
        two_steps : float
            Length of the step and the previous one together [s].

        Returns
        -------
        float
            Local error over the difference from the extrapolated previous states.
        """
        ...


@runtime_checkable
class SecondOrderIntegrator(Protocol):
    """Implicit formulas for velocities and accelerations.

    Attributes
    ----------
    name : str
        Short name.
    averages_forces : bool
        True if forces are means along the step.
    """

    name: ClassVar[str]
    averages_forces: ClassVar[bool]

    @property
    def damps(self) -> bool:
        """True if fast motions lose amplitude."""
        ...

    @property
    def load_time(self) -> float:
        """Fraction of the step at which loads are evaluated."""
        ...

    @property
    def initial_weight(self) -> float:
        """Factor of the initial forces in the equation of a step."""
        ...

    @property
    def final_weight(self) -> float:
        """Weight of the forces at the end of a step."""
        ...

    def velocity(self, dt: float, state: Kinematics) -> Affine:
        """Return the velocity at the end of a step.

        Parameters
        ----------
        dt : float
            Length of the step [s].
        state : object
            Unknowns x, velocities v and accelerations a (n,) at the beginning of the step.

        Returns
        -------
        Affine
            c and rest (n,): the velocity is c u + rest, of the unknowns u at the end.
        """
        ...

    def acceleration(self, dt: float, state: Kinematics) -> Affine:
        """Return the acceleration at the end of a step.

        Parameters
        ----------
        dt : float
            Length of the step [s].
        state : object
            Unknowns x, velocities v and accelerations a (n,) at the beginning of the step.

        Returns
        -------
        Affine
            c and rest (n,): the acceleration is c u + rest, of the unknowns u at the end.
        """
        ...

    def equation_velocity(self, dt: float, state: Kinematics) -> Affine:
        """Return the velocity in the equation of a step.

        Parameters
        ----------
        dt : float
            Length of the step [s].
        state : object
            Unknowns x, velocities v and accelerations a (n,) at the beginning of the step.

        Returns
        -------
        Affine
            c and rest (n,): the velocity is c u + rest, of the unknowns u at the end.
        """
        ...

    def equation_acceleration(self, dt: float, state: Kinematics) -> Affine:
        """Return the acceleration in the equation of a step.

        Parameters
        ----------
        dt : float
            Length of the step [s].
        state : object
            Unknowns x, velocities v and accelerations a (n,) at the beginning of the step.

        Returns
        -------
        Affine
            c and rest (n,): the acceleration is c u + rest, of the unknowns u at the end.
        """
        ...


@dataclass(frozen=True)
class Euler:
    """Backward Euler, of order 1; short name "euler"."""

    name: ClassVar[str] = "euler"
    order: ClassVar[int] = 1

    def weights(self, steps: Sequence[float]) -> Array:
        """See `FirstOrderIntegrator`."""
        return np.array([1.0, -1.0]) / steps[0]

    def error_fraction(self, dt: float, two_steps: float) -> float:
        """See `FirstOrderIntegrator`."""
        return dt / two_steps


@dataclass(frozen=True)
class BDF2:
    """Backward differences of order 2, of steps of any length; short name "bdf2".

    The first step is one of Euler.
    """

    name: ClassVar[str] = "bdf2"
    order: ClassVar[int] = 2

    def weights(self, steps: Sequence[float]) -> Array:
        """See `FirstOrderIntegrator`."""
        if len(steps) == 1:
            return Euler().weights(steps)
        dt = steps[0]
        r = dt / steps[1]
        return np.array([(1.0 + 2.0 * r) / (1.0 + r), -(1.0 + r), r**2 / (1.0 + r)]) / dt

    def error_fraction(self, dt: float, two_steps: float) -> float:
        """See `FirstOrderIntegrator`; of equal steps."""
        return 2.0 / 11.0


class _WeightedForces:
    """Newmark's formulas with forces and inertia weighted between both ends of a step.

        (1 - am) M a1 + am M a0 + (1 - af) f1 + af f0 + c = 0

    Forces c of ties and contacts are one for the step: so an impact gains no energy, and with a
    radius below 1 what it leaves on the surface is damped. Equations without inertia, of supports,
    ties and contacts above all, hold at the end of the step.
    """

    averages_forces: ClassVar[bool] = False
    load_time: ClassVar[float] = 1.0

    def _coefficients(self) -> tuple[float, float, float, float]:
        """Inertia weight am, force weight af, beta, gamma."""
        raise NotImplementedError

    @property
    def damps(self) -> bool:
        """See `SecondOrderIntegrator`."""
        return self._coefficients()[3] > 0.5

    @property
    def initial_weight(self) -> float:
        """See `SecondOrderIntegrator`; the equation is divided by 1 - af."""
        af = self._coefficients()[1]
        return af / (1.0 - af)

    @property
    def final_weight(self) -> float:
        """See `SecondOrderIntegrator`."""
        return 1.0 - self._coefficients()[1]

    def velocity(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        final, g = self.acceleration(dt, state), self._coefficients()[3] * dt
        return Affine(g * final.c, state.v + (dt - g) * state.a + g * final.constant)

    def acceleration(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        beta = self._coefficients()[2]
        c = 1.0 / (beta * dt**2)
        return Affine(c, -c * (state.x + dt * state.v) - (0.5 / beta - 1.0) * state.a)

    def equation_velocity(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return self.velocity(dt, state)

    def equation_acceleration(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`; the equation is divided by 1 - af."""
        am, af, _, _ = self._coefficients()
        scale = 1.0 / (1.0 - af)
        return self.acceleration(dt, state).combined(scale * (1.0 - am), state.a, scale * am)


@dataclass(frozen=True)
class GeneralisedAlpha(_WeightedForces):
    """Generalised-alpha method of order 2; short name "generalised-alpha".

    Parameters
    ----------
    rho_inf : float
        Spectral radius at infinite frequency, 0 (damps most) to 1 (damps nothing). At 0.8 a fifth
        of the amplitude of what the mesh cannot resolve is lost in each step.

    Raises
    ------
    StudyError
        The radius is not in [0, 1].

    Notes
    -----
    J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371.
    """

    name: ClassVar[str] = "generalised-alpha"
    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        """Check the radius."""
        if not 0.0 <= self.rho_inf <= 1.0:
            raise StudyError(
                f"rho_inf = {self.rho_inf:g}: allowed is 0 (damps most) to 1 (damps nothing)"
            )

    def _coefficients(self) -> tuple[float, float, float, float]:
        rho = self.rho_inf
        am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        return am, af, 0.25 * (1.0 - am + af) ** 2, 0.5 - am + af


@dataclass(frozen=True)
class Newmark(_WeightedForces):
    """Newmark's method; short name "newmark".

    Parameters
    ----------
    beta, gamma : float
        Coefficients of the acceleration at the end of a step in displacement and velocity. The
        default is the trapezoidal rule of order 2; gamma above 1/2 damps, with order 1.

    Raises
    ------
    StudyError
        beta is not positive, or gamma is below 1/2.

    Notes
    -----
    N. M. Newmark, J. Eng. Mech. Div. 85 (1959) 67.
    """

    name: ClassVar[str] = "newmark"
    beta: float = 0.25
    gamma: float = 0.5

    def __post_init__(self) -> None:
        """Check the coefficients."""
        if not self.beta > 0.0 or not np.isfinite(self.beta):
            raise StudyError(
                f"beta = {self.beta:g}: must be positive; beta = 0 is softehl.CentralDifference()"
            )
        if not self.gamma >= 0.5 or not np.isfinite(self.gamma):
            raise StudyError(
                f"gamma = {self.gamma:g}: must be at least 0.5, below it every motion grows"
            )

    def _coefficients(self) -> tuple[float, float, float, float]:
        # with consistent accelerations the mean of both ends is the trapezoidal rule
        mean = 0.5 if (self.beta, self.gamma) == (0.25, 0.5) else 0.0
        return mean, mean, self.beta, self.gamma


@dataclass(frozen=True)
class Midpoint:
    """Midpoint rule with the discrete gradient of the energy, which it conserves; "midpoint"."""

    name: ClassVar[str] = "midpoint"
    averages_forces: ClassVar[bool] = True
    damps: ClassVar[bool] = False
    load_time: ClassVar[float] = 0.5
    initial_weight: ClassVar[float] = 0.0
    final_weight: ClassVar[float] = 1.0

    def velocity(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return Affine(2.0 / dt, -2.0 / dt * state.x - state.v)

    def acceleration(self, dt: float, state: Kinematics) -> Affine:
        """Mean acceleration of the step."""
        return Affine(2.0 / dt**2, -2.0 / dt**2 * state.x - 2.0 / dt * state.v)

    def equation_velocity(self, dt: float, state: Kinematics) -> Affine:
        """Mean velocity of the step."""
        return Affine(1.0 / dt, -state.x / dt)

    def equation_acceleration(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return self.acceleration(dt, state)


@dataclass(frozen=True)
class BackwardEulerDynamics:
    """Backward Euler steps with inertia, which make an inconsistent initial state consistent."""

    name: ClassVar[str] = "euler"
    averages_forces: ClassVar[bool] = False
    damps: ClassVar[bool] = True
    load_time: ClassVar[float] = 1.0
    initial_weight: ClassVar[float] = 0.0
    final_weight: ClassVar[float] = 1.0

    def velocity(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return Affine(1.0 / dt, -state.x / dt)

    def acceleration(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return Affine(1.0 / dt**2, -(state.x / dt + state.v) / dt)

    def equation_velocity(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return self.velocity(dt, state)

    def equation_acceleration(self, dt: float, state: Kinematics) -> Affine:
        """See `SecondOrderIntegrator`."""
        return self.acceleration(dt, state)


@dataclass(frozen=True)
class CentralDifference:
    """Central differences with lumped masses; short name "explicit".

    Between two results there are as many stable steps as are needed (velocity Verlet).
    """

    name: ClassVar[str] = "explicit"

    def half_step(self, dt: float, v: Array, a: Array) -> Array:
        """Velocity (n,) half a step later."""
        return v + 0.5 * dt * a

    def stable_step(self, frequency_squared: float) -> float:
        """Longest stable step for the square of the highest angular frequency."""
        return float(2.0 / np.sqrt(frequency_squared))


TimeIntegrator: TypeAlias = FirstOrderIntegrator | SecondOrderIntegrator | CentralDifference
MethodName: TypeAlias = Literal[
    "euler", "bdf2", "generalised-alpha", "newmark", "midpoint", "explicit"
]
INTEGRATORS: dict[str, Callable[..., TimeIntegrator]] = {
    kind.name: kind
    for kind in (Euler, BDF2, GeneralisedAlpha, Newmark, Midpoint, CentralDifference)
}
"""Integrators by their short names."""


def integrator_of(method: object, **parameters: float | None) -> TimeIntegrator:
    """Return an integrator, or that of a short name with these parameters, None for its default.

    Raises StudyError for an unknown name, and for a parameter that the integrator does not have.
    """
    values = {name: value for name, value in parameters.items() if value is not None}
    kinds = FirstOrderIntegrator | SecondOrderIntegrator | CentralDifference
    if isinstance(method, kinds) and not isinstance(method, type):
        for name, value in values.items():
            raise StudyError(f"{name} = {value:g}: give it to the integrator, not beside {method}")
        return method
    if not isinstance(method, str) or method not in INTEGRATORS:
        names = ", ".join(f'"{name}"' for name in INTEGRATORS)
        raise StudyError(
            f"method = {method!r}{did_you_mean(method, INTEGRATORS)}: allowed are {names}, or an "
            "integrator such as softehl.BDF2()"
        )
    for name, value in values.items():
        having = [f'"{n}"' for n, kind in INTEGRATORS.items() if name in signature(kind).parameters]
        if f'"{method}"' not in having:
            raise StudyError(f"{name} = {value:g}: only method = {', '.join(having)} has it")
    return INTEGRATORS[method](**values)


def require_arguments(
    integrator: TimeIntegrator, march: Callable[..., Any], arguments: dict[str, Any]
) -> dict[str, Any]:
    """Return the arguments that are given, not None; `march` goes by this integrator.

    Raises StudyError for one that the signature of `march` does not have.
    """
    values = {name: value for name, value in arguments.items() if value is not None}
    for name in values:
        if name not in signature(march).parameters:
            raise StudyError(
                f'{name}: method = "{integrator.name}" has no such thing; leave it out'
            )
    return values


def step_before_end(remaining: float, dt: float) -> float:
    """Length of a step of about dt that leaves no sliver of the remaining time."""
    if remaining <= dt * (1.0 + 1e-9):
        return remaining
    if remaining < 2.0 * dt and remaining > dt * (1.0 + 1e-9):
        return min(dt, 0.5 * remaining)
    return dt
