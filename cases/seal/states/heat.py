"""Heat of a computed film: what it does to its viscosity and its friction, and where it goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from softehl.cases.seal.equations.film_heat import (
    WarmFilm,
    inlet_mean,
    moving_half_space,
    warm_film,
)
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import SealSystem
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import element_means

_SETTLED, _MOST = 1e-9, 60
"""Change of the viscosity (relative) at which temperatures are accepted; iterations, at most."""

WATT = 1e-3
"""1 N mm/s in W."""


@dataclass(frozen=True, eq=False)
class FilmHeat:
    """Heat of a film.

    Attributes
    ----------
    viscosity_ratio : float
        Viscosity that h* sees, that of the warm inlet over that of the cold oil.
    inlet, peak : float
        Rise of the temperature, K: mean of the inlet, largest in the film.
    to_rod, to_seal, carried : float
        Heat into rod and seal, and what the oil carries away, W.
    shear : array (segments,)
        Viscosity of each segment over that of the inlet, by which its shear stress changes.
    """

    viscosity_ratio: float
    inlet: float
    peak: float
    to_rod: float
    to_seal: float
    carried: float
    shear: Array

    def warmed(self, at: Mapping[str, Array]) -> dict[str, Array]:
        """The fields (segments, points) of the film with the shear stress of its own viscosity."""
        change = (self.shear[:, None] - 1.0) * _sheared(at)
        return {**at, "tau": at["tau"] + change, "tau_rod": at["tau_rod"] + change}


def film_heat(
    system: SealSystem, at: Mapping[str, Array], film: FilmLoads, inlet: slice, h_star: float
) -> FilmHeat:
    """Heat of a film with the fields at (segments, points).

    inlet: its segments from where the oil comes in to the largest pressure, in the order of the
    arc. The film is that of the viscosity of its inlet; the temperature of the other parts changes
    their shear stress alone, as h is decided in the inlet.
    """
    p, width = system.parameters, at["dx"].sum(axis=1)
    flat = np.flatnonzero(width > 1e-9 * width.sum())
    parts = flat if film.stroke == "out" else flat[::-1]
    fields = {name: element_means(at[name], at["dx"])[parts] for name in ("x", "tau_rod")}
    gap = np.maximum(element_means(at.get("h_T", at["h"]), at["dx"])[parts], 1e-12)
    sheared = element_means(_sheared(at), at["dx"])[parts]
    pushed = element_means(at["flux"] * _slope(at), at["dx"])[parts]
    other = film.rod_speed * (fields["tau_rod"] - sheared) - pushed
    law, used, shear = p.warm_viscosity, film.viscosity_ratio, np.ones(len(parts))
    way = np.copysign(1.0, film.rod_speed) * fields["x"]
    half_space = moving_half_space(way, width[parts], film.speed)

    def at_shear(shear: Array) -> WarmFilm:
        return warm_film(
            half_space,
            width[parts],
            h=gap,
            heat=other + film.rod_speed * sheared * shear,
            flux=max(0.5 * film.speed * h_star, 0.0),
            height=p.depth,
        )

    warm = at_shear(shear)
    for _ in range(_MOST):
        wanted = law(warm.oil) / used
        if float(np.abs(wanted / shear - 1.0).max()) < _SETTLED:
            break
        shear = np.sqrt(shear * wanted)
        warm = at_shear(shear)
    of_inlet = np.isin(parts, np.arange(inlet.start, inlet.stop))
    ratio = np.exp(inlet_mean(gap[of_inlet], h_star, np.log(law(warm.oil[of_inlet]))))
    shares = np.ones(len(width))
    shares[parts] = shear
    around = WATT * system.around
    return FilmHeat(
        viscosity_ratio=float(ratio),
        inlet=inlet_mean(gap[of_inlet], h_star, warm.oil[of_inlet]),
        peak=float(warm.peak.max()),
        to_rod=around * float(warm.to_rod @ width[parts]),
        to_seal=around * float(warm.to_seal @ width[parts]),
        carried=around * warm.carried,
        shear=shares,
    )


def _sheared(at: Mapping[str, Array]) -> Array:
    """Shear stress of the oil that does not come from the slope of the pressure."""
    return 0.5 * (at["tau_rod"] + at["tau"]) - at.get("tau_a", 0.0)


def _slope(at: Mapping[str, Array]) -> Array:
    """p' at the points, MPa/mm: by the balance of the film, or by differences of a rough one."""
    if not np.any(at.get("tau_a", 0.0)):
        return np.asarray((at["tau_rod"] - at["tau"]) / at["h"])
    slope = np.gradient(at["p"].ravel(), at["x"].ravel())
    return np.asarray(slope.reshape(at["p"].shape))
