"""From a hardness Shore A to Young's modulus: two published rules, and how well they are known."""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.gland.trade.rubber_names import SHORE_D


def youngs_modulus(shore_A: float, polymer: str | None = None) -> float:
    """Young's modulus from a hardness Shore A, MPa; polymer: "PU" has a rule of its own.

    A. N. Gent, Rubber Chem. Technol. 31 (1958) 896: the durometer's pin as a punch on a half-space
    of linear elasticity, E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)); it ends at 100.

    Polyurethane: H. J. Qi, K. Joyce and M. C. Boyce, Rubber Chem. Technol. 76 (2003) 419: finite
    elements of the test at large deformations, log10 E = 0.0235 S - 0.6403, where S is the hardness
    Shore A up to 80, that in Shore D and 50 above.
    """
    if polymer == "PU":
        hard = shore_A
        if shore_A > 80.0:
            shore_d, chart = zip(*SHORE_D, strict=True)
            hard = 50.0 + float(np.interp(shore_A, chart, shore_d))
        return float(10.0 ** (0.0235 * hard - 0.6403))
    return 0.0981 * (56.0 + 7.62336 * shore_A) / (0.137505 * (254.0 - 2.54 * shore_A))


def shore_range(polymer: str | None) -> tuple[float, float]:
    """Hardnesses Shore A between which the rule of a polymer is taken."""
    return (60.0, 98.0) if polymer == "PU" else (20.0, 90.0)


def shore_band(shore_A: float, polymer: str | None = None) -> tuple[float, float]:
    """The largest error of the modulus, in per cent, below and above, by +- 5 Shore A.

    That is how rubbers are sold; the rules themselves are no better. The scale ends at 100.
    """
    upper = min(shore_A + 5.0, 100.0) if polymer == "PU" else shore_A + 5.0
    low, middle, high = (youngs_modulus(s, polymer) for s in (shore_A - 5.0, shore_A, upper))
    return 100.0 * (low / middle - 1.0), 100.0 * (high / middle - 1.0)
