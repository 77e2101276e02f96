"""Stored energies of isotropic hyperelastic solids, per reference volume [MPa], each written once.

An energy is the sum (3) of an isochoric term in I1bar and I2bar and a volumetric one in I3 = J^2,
which under-integrated elements take at different points. Both vanish without deformation, where
I1bar = I2bar = 3 and I3 = 1. Stresses and tangents are derived (`kinematics.cauchy`,
`Model.potential`): nothing is differentiated here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.language.model import Model


@dataclass(frozen=True)
class Energy:
    """One term: its parameters and what they mean, and its value by invariants and parameters."""

    parameters: Mapping[str, str]
    value: Callable[..., Any]

    def declared(self, m: Model) -> Callable[..., Any]:
        """The term as a function of its invariants; its parameters become parameters of `m`."""
        symbols = m.parameters(**self.parameters)
        return lambda *invariants: self.value(*invariants, *symbols)


def _mooney_rivlin(I1bar: Any, I2bar: Any, mu_1: Any, mu_2: Any) -> Any:
    return mu_1 * (I1bar - 3) / 2 + mu_2 * (I2bar - 3) / 2


def _volumetric(I3: Any, kappa: Any) -> Any:
    return kappa * ((I3 - 1) / 2 - sp.log(I3) / 2) / 2


MOONEY_RIVLIN = Energy(
    {"mu_1": "elastic parameter [MPa]", "mu_2": "elastic parameter [MPa]"}, _mooney_rivlin
)
"""First two terms of (3), isochoric."""

VOLUMETRIC = Energy({"kappa": "bulk modulus [MPa]"}, _volumetric)
"""W_v of (6)."""
