"""Viscosity index, ASTM D2270: a high one means a viscosity that falls little with temperature.

Kinematic viscosities in cSt. Only indices of 100 and more are read: procedure B.
"""

from __future__ import annotations

from math import log10

from scipy.optimize import brentq

_H = (
    (2.0, 0.84155, 1.5521, -0.077),
    (3.8, 0.78571, 1.7929, -0.183),
    (4.4, 0.82143, 1.5679, 0.119),
    (5.0, 0.04985, 9.1613, -18.557),
    (6.4, 0.22619, 7.7369, -16.656),
    (7.0, 0.79762, -0.7321, 14.610),
    (7.7, 0.05794, 10.5156, -28.240),
    (9.0, 0.26665, 6.7015, -10.810),
    (12.0, 0.20073, 8.4658, -22.490),
    (15.0, 0.28889, 5.9741, -4.930),
    (18.0, 0.24504, 7.4160, -16.730),
    (22.0, 0.20323, 9.1267, -34.230),
    (28.0, 0.18411, 10.1015, -46.750),
)
"""From a viscosity at 100 degC on: H = d Y^2 + e Y + f, of the standard's annex."""

_LEAST, _MOST = 2.0, 40.0
"""Viscosities at 100 degC of the oils of the industry, cSt; the table goes on to 70."""

_INDICES = (100.0, 400.0)
"""Indices of procedure B that are read; polyglycols have up to 280."""


def at_40_of_100(at_100: float) -> float:
    """Viscosity at 40 degC of an oil of index 100 from that at 100 degC, 2 to 40 cSt."""
    _, d, e, f = max(row for row in _H if row[0] <= at_100)
    return d * at_100**2 + e * at_100 + f


def viscosity_index(at_40: float, at_100: float) -> float:
    """The index of an oil, 100 or more, from its two viscosities."""
    n = (log10(at_40_of_100(at_100)) - log10(at_40)) / log10(at_100)
    return float((10.0**n - 1.0) / 0.00715 + 100.0)


def at_100_of_index(at_40: float, index: float) -> float:
    """Viscosity at 100 degC of an oil of this index and viscosity at 40 degC.  ValueError."""
    low, high = _INDICES
    if not low <= index <= high:
        raise ValueError(f"a viscosity index is read from {low:g} to {high:g}, given {index:g}")
    ends = [viscosity_index(at_40, y) - index for y in (_LEAST, _MOST)]
    if ends[0] * ends[1] > 0.0:
        raise ValueError(f"there is no oil of index {index:g} and {at_40:g} cSt at 40 degC here")
    return float(brentq(lambda y: viscosity_index(at_40, y) - index, _LEAST, _MOST, xtol=1e-9))
