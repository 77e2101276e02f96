"""Theory of the inlet: h* from the edge of the dry contact alone (docs/method.md).

Near an edge the dry pressure is p = K sqrt(s)(1 + b s) at the distance s inside. The gap at the
distance d outside is (4/3)(K / E*) d^1.5, that of a half-space with the modulus E*. Viscous and
elastic forces balance over the length l. With l as unit of length, K sqrt(l) of pressure and
K l^1.5 / E* of film thickness, the pressure P(X) and the film H(X) satisfy

    H' = -(2/pi) PV int P(S) / (X - S) dS,    P' = -exp(A P) (H - H*) / H^3,

with P -> sqrt(-X)(1 + B X) far inside, A = alpha K sqrt(l) and B = b l. There is a solution for
one value of H* only (Snoeijer, Eggers, Venner: Phys. Fluids 25, 101705, 2013); `local_inlet`
computes it. An oil that thins under shear adds one parameter: its critical stress, relative to
eta U / (K l^1.5 / E*).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, log

import numpy as np

from softehl.runtime.arrays import Array

CONSTANT = 0.51212
"""H* at A = B = 0, by `local_inlet` with 777 nodes; with 186 nodes 0.5120."""

BY_VISCOSITY, BY_CURVATURE = 0.345, -0.86
"""Derivatives of ln H* by A and by B, by differences of `local_inlet`."""

SPEED_POWER = 0.6
"""Power of eta U that h* is as."""

FACTOR = CONSTANT * 6.0**SPEED_POWER
"""Constant 1.5006 of h* = 1.5006 (eta U)^0.6 E*^0.2 K^-0.8."""


@dataclass(frozen=True)
class Edge:
    """Edge of a dry contact where a film is drawn in.

    Attributes
    ----------
    rise : float
        K^2 of the pressure in excess of that of the oil, MPa^2/mm.
    curvature : float
        b of this pressure, 1/mm.
    modulus : float
        E* of the stretched rubber, MPa.
    pocket : float
        Axial distance to the end of the section, where the gap ends, mm.
    """

    rise: float
    curvature: float
    modulus: float
    pocket: float

    def length(self, flow: float) -> float:
        """Length l = (6 eta U E*^2 / K^3)^(2/5) of the inlet, mm; flow: eta U, MPa mm."""
        return float((6.0 * flow * self.modulus**2 / self.rise**1.5) ** 0.4)

    def thickness(self, flow: float) -> float:
        """Unit K l^1.5 / E* of the film thickness, mm; flow: eta U, MPa mm."""
        return float(self.rise**0.5 * self.length(flow) ** 1.5 / self.modulus)

    def h_star(self, flow: float, alpha: float = 0.0, oil: ThinningOil | None = None) -> float:
        """Film thickness h*, mm.

        Parameters
        ----------
        flow : float
            eta |U| with the viscosity at rest at the pressure before the inlet, MPa mm.
        alpha : float
            Pressure-viscosity coefficient, 1/MPa.
        oil : ThinningOil, optional
            Oil that thins under shear, its critical stress in MPa.

        Raises
        ------
        ArithmeticError
            If the oil thins more than the local problem can be solved for.
        """
        length = self.length(flow)
        viscosity, curvature = alpha * (self.rise * length) ** 0.5, self.curvature * length
        plain = FACTOR * flow**0.6 * self.modulus**0.2 * self.rise**-0.4
        if oil is not None:
            plain *= thinned(replace(oil, critical=oil.critical * self.thickness(flow) / flow))
        return float(plain * (1.0 + BY_VISCOSITY * viscosity) * (1.0 + BY_CURVATURE * curvature))


# --- the stretched rubber -----------------------------------------------------------------------

Stiffness = Callable[[float, float], tuple[float, float]]
"""Principal logarithmic strains (along the surface, hoop) of an incompressible rubber -> difference
of the true stresses along and across the surface, and its derivative by the first strain, MPa."""


def incremental_modulus(stiffness: Stiffness, along: float, hoop: float) -> float:
    """E* of a half-space with two stretches, the third by incompressibility, MPa; 4 mu at rest.

    Small loads on a stretched half-space, in plane strain (Biot: Mechanics of incremental
    deformations, 1965; Dowaikh, Ogden: IMA J. Appl. Math. 44, 261, 1990). With the moduli alpha,
    beta, gamma of the latter, P = sqrt(alpha/gamma) and S^2 = 2 beta/gamma + 2 P:

        E* = 2 gamma (P S^2 - (1 - P)^2) / S.

    The pressure of the oil on the surface drops out.
    """
    across = 1.0 / (along * hoop)
    difference, slope = stiffness(log(along), log(hoop))
    gap = along**2 - across**2
    ratio = slope / (4.0 * across**2) if abs(gap) < 1e-6 * across**2 else difference / gap
    gamma, P = ratio * across**2, along / across
    twice_beta = slope + difference - 2.0 * ratio * along**2
    S = (twice_beta / gamma + 2.0 * P) ** 0.5
    return float(2.0 * gamma * (P * S**2 - (1.0 - P) ** 2) / S)


# --- an oil that thins under shear --------------------------------------------------------------

_Y, _WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Points and weights across the film."""


@dataclass(frozen=True)
class ThinningOil:
    """Oil that thins under shear.

    Attributes
    ----------
    critical : float
        Critical stress; in the local problem over eta U / (K l^1.5 / E*).
    exponent, plateau : float or None
        n and c of Carreau's law; None for Eyring's.
    """

    critical: float
    exponent: float | None = None
    plateau: float = 0.0

    def rate(self, stress: Array) -> Array:
        """Shear rate of a stress >= 0, both over those of a Newtonian oil; relative error 1e-5."""
        ratio = stress / self.critical
        if self.exponent is None:
            return np.asarray(self.critical * np.sinh(np.minimum(ratio, 300.0)))
        rates, stresses = _carreau_curve(self.exponent, self.plateau)
        logarithm = np.interp(np.log(np.maximum(ratio, 1e-300)), stresses, rates)
        beyond = np.where(ratio < exp(stresses[0]), ratio, np.exp(logarithm))
        return np.asarray(self.critical * beyond)

    def resistance(self, H: Array, slope: Array, viscosity: Array) -> Array:
        """Viscosity (n,) that a pressure gradient P' meets in a film H that the rod shears.

        The stress tau = tau_m - 6 P' Y is linear across the film, tau_m gives the speed of the rod
        (codegen/models/rheology.py). viscosity: at rest, of the pressure.
        """
        middle, drop = viscosity / H, np.maximum(3.0 * np.abs(slope) * H, 1e-5 * viscosity / H)

        def rates(tau_m: Array) -> Array:
            tau = tau_m[:, None] - drop[:, None] * _Y
            return np.asarray(np.sign(tau) * self.rate(np.abs(tau)) / viscosity[:, None])

        low, high = np.zeros_like(middle), middle
        for _ in range(32):
            middle = 0.5 * (low + high)
            fast = rates(middle) @ _WEIGHTS > 2.0 / H
            low, high = np.where(fast, low, middle), np.where(fast, middle, high)
        return np.asarray(-2.0 / 3.0 * drop / (rates(middle) @ (_WEIGHTS * _Y)))


@lru_cache(maxsize=8)
def _carreau_curve(exponent: float, plateau: float) -> tuple[Array, Array]:
    """Logarithms of shear rates and of their stresses, in units of the critical ones."""
    rates = np.linspace(log(1e-4), log(1e12), 6001)
    square = np.exp(2.0 * rates)
    thinner = plateau + (1.0 - plateau) * (1.0 + square) ** (0.5 * (exponent - 1.0))
    return rates, rates + np.log(thinner)


@lru_cache(maxsize=256)
def thinned(oil: ThinningOil) -> float:
    """h* of an oil that thins, over that of a Newtonian one of its viscosity at rest."""
    return local_inlet(oil=oil).H_star / newtonian_inlet().H_star


@lru_cache(maxsize=1)
def newtonian_inlet() -> LocalInlet:
    """The local problem at A = B = 0."""
    return local_inlet()


# --- the local problem --------------------------------------------------------------------------


@dataclass(frozen=True)
class LocalInlet:
    """Solution of the local problem: X, P, H (n,), and H*; X < 0 is inside the contact.

    by_viscosity: (n - 1,) derivatives of ln H* by the logarithms of the viscosities between nodes.
    """

    X: Array
    P: Array
    H: Array
    H_star: float
    by_viscosity: Array


def local_inlet(
    A: float = 0.0,
    B: float = 0.0,
    inside: float = 300.0,
    outside: float = 100.0,
    spacing: tuple[float, float] = (0.05, 0.06),
    oil: ThinningOil | None = None,
) -> LocalInlet:
    """Solve the local problem by Newton's method; pressures are linear between nodes.

    Parameters
    ----------
    A, B : float
        Pressure-viscosity alpha K sqrt(l) and curvature b l.
    inside, outside : float
        Ends of the mesh, in l; beyond the inner one the pressure is that of the dry contact.
    spacing : (float, float)
        Segment at X = 0, and growth with the distance.
    oil : ThinningOil, optional
        Oil that thins under shear; its resistance is that of the last iterate.

    Raises
    ------
    ArithmeticError
        If Newton's method does not converge.
    """
    X = np.r_[-_spaced(inside, *spacing)[::-1], _spaced(outside, *spacing)[1:]]
    n, dX, X_mid = len(X), np.diff(X), 0.5 * (X[1:] + X[:-1])
    kernel = 2.0 / np.pi * _hilbert(X, X_mid)
    tail = 2.0 / np.pi * (_tail(X_mid, inside) + B * _curved_tail(X_mid, inside))
    far, rise = inside**0.5 * (1.0 + B * inside), (1.0 + 3.0 * B * inside) / (2.0 * inside**0.5)
    thin = exp(-A * far) * rise
    k = np.arange(n - 1)
    dry = np.sqrt(np.maximum(-X, 0.0))
    unknowns = np.r_[dry, 4.0 / 3.0 * np.maximum(X, 0.0) ** 1.5 + CONSTANT, CONSTANT]
    last: Array | None = None
    for _ in range(60):
        P, H, H_star = unknowns[:n], unknowns[n : 2 * n], unknowns[-1]
        H_mid = 0.5 * (H[1:] + H[:-1])
        viscosity = np.exp(A * np.minimum(0.5 * (P[1:] + P[:-1]), far))
        if oil is not None:  # halfway from that of the last iterate
            met = oil.resistance(H_mid, np.diff(P) / dX, viscosity)
            viscosity = last = np.sqrt(met * (met if last is None else last))
        slope = viscosity * (H_mid - H_star) / H_mid**3
        by_H = 0.5 * viscosity * (1.0 / H_mid**3 - 3.0 * (H_mid - H_star) / H_mid**4)
        residual = np.r_[
            np.diff(H) / dX + kernel @ P + tail,
            np.diff(P) / dX + slope,
            P[-1],
            H[0] - H_star - H_star**3 * thin,
            P[0] - far,
        ]
        J = np.zeros((2 * n + 1, 2 * n + 1))
        J[: n - 1, :n] = kernel
        J[k, n + k] -= 1.0 / dX
        J[k, n + k + 1] += 1.0 / dX
        J[n - 1 + k, k] = 0.5 * A * slope - 1.0 / dX
        J[n - 1 + k, k + 1] = 0.5 * A * slope + 1.0 / dX
        J[n - 1 + k, n + k] = J[n - 1 + k, n + k + 1] = by_H
        J[n - 1 + k, -1] = -viscosity / H_mid**3
        J[2 * n - 2, n - 1] = J[2 * n - 1, n] = J[2 * n, 0] = 1.0
        J[2 * n - 1, -1] = -1.0 - 3.0 * H_star**2 * thin
        step = np.linalg.solve(J, -residual)
        falls = step[n:] < 0.0
        limit = 0.7 * np.min(-unknowns[n:][falls] / step[n:][falls], initial=np.inf)
        unknowns = unknowns + min(1.0, limit) * step
        if limit >= 1.0 and np.abs(step).max() < 1e-9:
            adjoint = np.linalg.solve(J.T, np.eye(2 * n + 1)[-1])
            by_viscosity = -adjoint[n - 1 : 2 * n - 2] * slope / unknowns[-1]
            P, H, H_star = unknowns[:n], unknowns[n : 2 * n], float(unknowns[-1])
            return LocalInlet(X, P, H, H_star, by_viscosity)
    raise ArithmeticError(f"the local problem of the inlet has no solution at A = {A:g}, B = {B:g}")


def _spaced(length: float, first: float, growth: float) -> Array:
    """Places from 0 to a length, in segments that grow."""
    nodes = [0.0]
    while nodes[-1] < length:
        nodes.append(nodes[-1] + first + growth * nodes[-1])
    return np.array(nodes) * length / nodes[-1]


def _hilbert(X: Array, at: Array) -> Array:
    """Matrix (m, n) of PV int P(S) / (x - S) dS at x, with P linear between its nodes X."""
    a, b, x = X[None, :-1], X[None, 1:], at[:, None]
    d, logarithm = b - a, np.log(np.abs((x - a) / (x - b)))
    matrix = np.zeros((len(at), len(X)))
    matrix[:, :-1] += (d + (b - x) * logarithm) / d
    matrix[:, 1:] += (-d + (x - a) * logarithm) / d
    return matrix


def _tail(x: Array, L: float) -> Array:
    """Integral of sqrt(-S) / (x - S) from minus infinity to -L, less its infinite constant."""
    y, r, root = np.sqrt(np.abs(x)), L**0.5, 2.0 * L**0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        outside = -root + 2.0 * y * (np.arctan(r / y) - 0.5 * np.pi)
        within = -root + y * np.log((r + y) / (r - y))
    return np.asarray(np.where(x > 0.0, outside, within))


def _curved_tail(x: Array, L: float) -> Array:
    """Integral of (-S)^1.5 / (x - S) from minus infinity to -L, less its infinite parts."""
    y, r = np.sqrt(np.abs(x)), L**0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        outside = np.pi * y**3 - 2.0 / 3.0 * r**3 + 2.0 * x * r - 2.0 * y**3 * np.arctan(r / y)
        within = -(2.0 / 3.0 * r**3 - x * (2.0 * r - y * np.log((r + y) / (r - y))))
    return np.asarray(np.where(x > 0.0, outside, within))
