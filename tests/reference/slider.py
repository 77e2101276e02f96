"""The linear wedge slider in closed form, with and without Barus' law.

With h = h1 + s x, s = (h2 - h1) / L, constant viscosity and p(0) = p(L) = 0 the constant flux is
q = 2 ubar h1 h2 / (h1 + h2), and integrating dp/dx = 12 eta (ubar / h^2 - q / h^3) gives
p = (12 eta / s) [ubar (1/h1 - 1/h) - q/2 (1/h1^2 - 1/h^2)].  With Barus' law (13) the same
formula holds for the reduced pressure (1 - exp(-alpha p)) / alpha and eta = eta_0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ROD = 25.0


@dataclass(frozen=True)
class Slider:
    """A wedge of length L (mm) with gaps h1, h2 (mm) over a rod of speed U (mm/s)."""

    h1: float = 0.012
    h2: float = 0.005
    length: float = 1.5
    speed: float = 400.0
    viscosity: float = 6.59e-8
    alpha: float = 0.0
    penalty: float = 0.0

    @property
    def flux(self) -> float:
        """q, mm^2/s."""
        return self.speed * self.h1 * self.h2 / (self.h1 + self.h2)

    def gap(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.h1 + (self.h2 - self.h1) * x / self.length)

    def reduced(self, x: np.ndarray) -> np.ndarray:
        """Pressure (MPa) of the oil without Barus' law."""
        h, slope = self.gap(x), (self.h2 - self.h1) / self.length
        couette = self.speed / 2 * (1 / self.h1 - 1 / h)
        return 12 * self.viscosity / slope * (couette - self.flux / 2 * (1 / self.h1**2 - 1 / h**2))

    def pressure(self, x: np.ndarray) -> np.ndarray:
        """Pressure in MPa."""
        if self.alpha == 0:
            return self.reduced(x)
        return -np.log1p(-self.alpha * self.reduced(x)) / self.alpha

    def load(self) -> float:
        """Integral of p over x, N/mm, by a Gauss rule beyond rounding."""
        points, weights = np.polynomial.legendre.leggauss(60)
        x = self.length * (1 + points) / 2
        return float(self.length / 2 * weights @ self.pressure(x))
