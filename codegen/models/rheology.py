"""Oils in a thin film: a Newtonian one, and those that thin under shear.

Across the film the shear stress is linear, tau(y) = tau_m - p' y with y from the middle to the
seal: momentum asks for no more. With the shear rate gamma(tau) of the oil the rod moves at
U = integral of gamma dy, which determines tau_m, and the flux is U h / 2 + integral of y gamma dy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.model import Model

Flow: TypeAlias = Callable[..., tuple[Any, Any]]
"""Shear stress tau_m in the middle of a film, and the p' of the same flux without thinning.

Of what the flow is called in the model, U, h, the viscosity at rest, p', and (part) a function that
gives of U or of a stress, which has its sign, the part that oil takes of a ruptured film: its
streamers are sheared as the full film is.
"""

Law: TypeAlias = Callable[[Model], Flow]
"""Declares the parameters of an oil in a model."""

ACROSS = 6
"""Gauss points across the film of a Carreau oil."""

_CRITICAL = "stress at which the oil thins: tau_0 of Eyring, viscosity times rate of Carreau [MPa]"
_TERMS = 11  # of a power series in Sigma^2 <= 1: the first that is left out is 1e-22


def _full(value: Any) -> Any:
    """Oil fraction of a full film."""
    return value


def newtonian(_: Model) -> Flow:
    """tau = eta gamma."""

    def flow(
        _: str, U: Any, h: Any, eta: Any, slope: Any, part: Callable[[Any], Any] = _full
    ) -> tuple[Any, Any]:
        return eta * part(U) / h, slope

    return flow


def eyring(m: Model) -> Flow:
    """tau = tau_0 asinh(eta gamma / tau_0): both integrals are closed forms (Conry 1987).

    With Sigma = h p' / (2 tau_0): eta U / (h tau_0) = sinh(tau_m / tau_0) sinh(Sigma) / Sigma, and
    the pressure drives 3 (Sigma cosh(Sigma) - sinh(Sigma)) / Sigma^3 cosh(tau_m / tau_0) times as
    much.
    """
    (tau_0,) = m.parameters(critical_stress=_CRITICAL)

    def flow(
        name: str, U: Any, h: Any, eta: Any, slope: Any, part: Callable[[Any], Any] = _full
    ) -> tuple[Any, Any]:
        S = m.define(f"Sigma{name}", h * slope / (2 * tau_0))
        mean, moment = _hyperbolic(S)
        sheared = m.define(f"sheared{name}", eta * U / (h * tau_0) / mean)
        return part(tau_0 * sp.asinh(sheared)), slope * moment * sp.sqrt(1 + sheared**2)

    return flow


def _hyperbolic(S: Any) -> tuple[Any, Any]:
    """Means over t of cosh(S t) and 3 t sinh(S t) / S, t from -1 to 1; both are 1 at S = 0."""
    mean = moment = sp.Integer(0)
    for k in reversed(range(_TERMS)):
        term = sp.Rational(1, sp.factorial(2 * k + 1))
        mean, moment = term + S**2 * mean, 3 * term / (2 * k + 3) + S**2 * moment
    small = S**2 < 1
    return (
        sp.Piecewise((mean, small), (sp.sinh(S) / S, True)),
        sp.Piecewise((moment, small), (3 * (S * sp.cosh(S) - sp.sinh(S)) / S**3, True)),
    )


def carreau(m: Model) -> Flow:
    """tau = eta gamma (c + (1 - c) (1 + (eta gamma / tau_c)^2)^((n - 1) / 2)).

    Gauss' rule stands for the integrals. tau_m and a number z at each of its points are found
    together: the rate there is x = z / (c + (1 - c) (1 + z^2)^((n - 1) / 2n)), about that of the
    stress z; all in units of tau_c. In z the equations are so nearly linear that Newton's method
    needs at most six steps from the stress of a film without p'.
    """
    tau_c, n, c = m.parameters(
        critical_stress=_CRITICAL,
        thinning_exponent="exponent n of the power law that follows",
        thinning_plateau="viscosity at the highest rates over that at rest",
    )
    rule = quadrature.gauss(ACROSS, 1)
    across = [(y, w / 2) for (y,), w in zip(rule.points, rule.weights, strict=True)]

    def thinned(square: Any, exponent: Any) -> Any:
        return c + (1 - c) * (1 + square) ** exponent

    def rate(z: Any) -> Any:
        return z / thinned(z**2, (n - 1) / (2 * n))

    def stress(x: Any) -> Any:
        return x * thinned(x**2, (n - 1) / 2)

    def flow(
        name: str, U: Any, h: Any, eta: Any, slope: Any, part: Callable[[Any], Any] = _full
    ) -> tuple[Any, Any]:
        S = m.define(f"Sigma{name}", h * slope / (2 * tau_c))
        sheared = m.define(f"sheared{name}", eta * U / (h * tau_c))
        alone = m.define(f"alone{name}", stress(sheared))

        def equations(s: Any) -> list[Any]:
            rates = [rate(z) for z in s[1:]]
            moved = sum(w * x for (_, w), x in zip(across, rates, strict=True))
            balance = [stress(x) - s[0] + S * y for (y, _), x in zip(across, rates, strict=True)]
            return [moved - sheared, *balance]

        start = [alone, *(alone - S * y for y, _ in across)]
        middle, *levels = m.implicit(f"level{name}", equations, start=start, iterations=50)
        driven = sum(w * y * rate(z) for (y, w), z in zip(across, levels, strict=True))
        return part(tau_c * middle), -6 * tau_c / h * driven

    return flow


def more_fields(slope: Any, driving: Any) -> dict[str, Any]:
    """Additional field of films of oils that thin: the p' of the same flux without thinning."""
    return {} if driving is slope else {"driving": driving}
