"""Heat of a film by its friction, in steady state: temperatures of oil, rod and rubber.

All temperatures are rises above the oil that the seal is in. A film of thickness h makes the heat
Phi = tau_rod U - q p' in a unit of area. Averaged over its thickness, with the heat flows q_r into
the rod and q_s into the rubber,

    rho c q dT/dx + q_r + q_s = Phi,
    T = T_rod + h / k (q_r / 3 - q_s / 6),    T = T_seal + h / k (q_s / 3 - q_r / 6),

as heat that is made evenly across the film gives a parabola. The rod is a half-space that moves
(Jaeger 1942, Carslaw and Jaeger, Conduction of heat in solids, 10.7), the rubber a resistance of
the section's height towards the housing. Units are mm, MPa, N, s, K; 1 W/(m K) = 1 N/(s K).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import kve

from softehl.cases.seal.equations.inlet_theory import SPEED_POWER, newtonian_inlet
from softehl.runtime.arrays import Array

OIL = 0.13, 1.7
"""Conductivity, N/(s K), and heat capacity of a unit of volume, MPa/K, of mineral oils."""

ROD = 45.0, 3.6
"""Those of a rod of steel. Heat goes into it as the root of their product."""

RUBBER = 0.25
"""Conductivity of a filled rubber, N/(s K); 0.2 to 0.3 are usual. It takes next to no heat."""


@dataclass(frozen=True, eq=False)
class WarmFilm:
    """Temperature rises (n,), K, and heat flows (n,), MPa mm/s, of the parts of a film.

    Attributes
    ----------
    oil, rod, seal : array (n,)
        Mean over the thickness; surfaces of rod and seal.
    peak : array (n,)
        Largest across the film.
    to_rod, to_seal : array (n,)
        Heat flows out of the film.
    carried : float
        Heat that the oil carries out of the last part, MPa mm^2/s.
    """

    oil: Array
    rod: Array
    seal: Array
    peak: Array
    to_rod: Array
    to_seal: Array
    carried: float


def warm_film(
    half_space: Array, width: Array, *, h: Array, heat: Array, flux: float, height: float
) -> WarmFilm:
    """Temperatures of a film, whose parts are in the order in which the oil passes them.

    Parameters
    ----------
    half_space : array (n, n)
        The rod, by `moving_half_space` of these parts.
    width : array (n,)
        Widths of the parts, mm.
    h : array (n,)
        Thickness, mm.
    heat : array (n,)
        Heat Phi made in a unit of area, MPa mm/s.
    flux : float
        Flow of the oil, mm^2/s, >= 0.
    height : float
        Height of the section between film and housing, mm.

    Returns
    -------
    WarmFilm
        Its heat is what was made, to rounding.
    """
    k, capacity = OIL
    n, resistance = len(width), height / RUBBER
    # q_s = (T + h q_r / (6 k)) / (resistance + h / (3 k))
    leak, film = 1.0 / (resistance + h / (3.0 * k)), h / (6.0 * k)
    mean = np.diag(1.0 + film * leak)
    by_rod = half_space + np.diag(2.0 * film - film**2 * leak)
    carried = capacity * flux * (np.eye(n) - np.eye(n, k=-1))
    made = carried + np.diag(width * leak)
    by_flow = np.diag(width * (1.0 + leak * film))
    matrix = np.block([[mean, -by_rod], [made, by_flow]])
    oil, to_rod = np.split(np.linalg.solve(matrix, np.r_[np.zeros(n), heat * width]), 2)
    to_seal = leak * (oil + film * to_rod)
    rod_rise, total = half_space @ to_rod, to_rod + to_seal
    seal_rise = resistance * to_seal
    with np.errstate(divide="ignore", invalid="ignore"):
        place = to_rod / total
        inside = rod_rise + 0.5 * to_rod * place * h / k
    peak = np.where((place > 0.0) & (place < 1.0), inside, np.maximum(rod_rise, seal_rise))
    return WarmFilm(oil, rod_rise, seal_rise, peak, to_rod, to_seal, capacity * flux * oil[-1])


def moving_half_space(
    x: Array, width: Array, speed: float, rod: tuple[float, float] = ROD
) -> Array:
    """Matrix (n, n) of the rise at places x of the surface by heat flows into parts of it, K s/N.

    A line source on a half-space that moves with U towards +x gives exp(v s) K_0(v |s|) / (pi k) at
    the distance s behind it, v = U / (2 kappa). The integral of each part is exact.
    """
    k, capacity = rod
    v = 0.5 * speed * capacity / k
    behind = x[:, None] - (x - 0.5 * width)[None, :]
    ahead = x[:, None] - (x + 0.5 * width)[None, :]
    return np.asarray((_source(v * behind) - _source(v * ahead)) / (np.pi * k * v))


def _source(s: Array) -> Array:
    """Integral of exp(t) K_0(|t|) from 0 to s."""
    t = np.maximum(np.abs(s), 1e-30)
    K_0, K_1 = kve(0, t), kve(1, t)
    before = -1.0 - t * np.exp(-2.0 * t) * (K_0 - K_1)
    return np.asarray(np.where(s > 0.0, t * (K_0 + K_1) - 1.0, before))


# --- what h* sees of it -------------------------------------------------------------------------


@lru_cache(maxsize=1)
def inlet_weights() -> tuple[Array, Array]:
    """ln(h / h*) (n,) of the inlet, rising, and the share (n,) of h* that is decided within it.

    By the change of h* of the local problem with the viscosity of each of its parts.
    """
    found = newtonian_inlet()
    H = 0.5 * (found.H[1:] + found.H[:-1]) / found.H_star
    order = np.argsort(H)
    share = np.cumsum(found.by_viscosity[order]) / found.by_viscosity.sum()
    return np.log(np.maximum(H[order], 1.0)), share


def inlet_mean(h: Array, h_star: float, values: Array) -> float:
    """Mean of values (n,) over an inlet, with the weights of `inlet_weights`.

    h: (n,) thickness, mm, in the order in which the oil passes, up to the largest pressure.
    """
    narrowest = np.maximum.accumulate(np.maximum(h / h_star, 1.0)[::-1])[::-1]
    at, share = inlet_weights()
    decided = np.interp(np.log(narrowest), at, share, left=0.0, right=1.0)
    bounds = np.r_[1.0, 0.5 * (decided[1:] + decided[:-1]), 0.0]
    weights = -np.diff(bounds)
    return float(weights @ values)


def changed_film(wanted: float, used: float) -> float:
    """Relative change of h* if its oil gets another share of its viscosity."""
    return float(abs((wanted / used) ** SPEED_POWER - 1.0))
