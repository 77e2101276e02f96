"""Stored energies of isotropic hyperelastic solids, per reference volume [MPa], each written once.

An energy is the sum (3) of an isochoric term and a volumetric one in I3 = J^2, which
under-integrated elements take at different points. Both vanish without deformation. The isochoric
one is a function of I1bar and I2bar (3 without deformation) or of the principal stretches of the
isochoric motion (1 without), whose product is 1. Stresses and tangents are derived
(`kinematics.cauchy`, `Model.potential`): nothing is differentiated here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import sympy as sp

from softehl.codegen.language.model import Model


@dataclass(frozen=True)
class EnergyTerm:
    """Energy of a model as a function of the variables `of`."""

    of: Literal["invariants", "stretches"]
    value: Callable[..., Any]

    def __call__(self, *variables: Any) -> Any:
        """The value at invariants or stretches."""
        return self.value(*variables)


@dataclass(frozen=True)
class Energy:
    """Strain energy term: parameters with their meaning, value by variables and parameters."""

    parameters: Mapping[str, str]
    value: Callable[..., Any]
    of: Literal["invariants", "stretches"] = "invariants"

    def declared(self, m: Model) -> EnergyTerm:
        """The term in a model, whose parameters become parameters of `m`."""
        symbols = m.parameters(**self.parameters)
        return EnergyTerm(self.of, lambda *variables: self.value(*variables, *symbols))

    def parameter_symbols(self) -> list[sp.Symbol]:
        """The symbols that `declared` makes of its parameters."""
        return [sp.Symbol(name, real=True) for name in self.parameters]


def _mooney_rivlin(I1bar: Any, I2bar: Any, mu_1: Any, mu_2: Any) -> Any:
    return mu_1 * (I1bar - 3) / 2 + mu_2 * (I2bar - 3) / 2


def _yeoh(I1bar: Any, _: Any, *c: Any) -> Any:
    return sum(c_i * (I1bar - 3) ** (i + 1) for i, c_i in enumerate(c))


def _arruda_boyce(I1bar: Any, _: Any, mu: Any, lambda_m: Any) -> Any:
    return mu * sum(
        sp.Rational(p, q) * (I1bar**i - 3**i) / lambda_m ** (2 * i - 2)
        for i, (p, q) in enumerate(_INVERSE_LANGEVIN, 1)
    )


def _gent(I1bar: Any, _: Any, mu: Any, J_m: Any) -> Any:
    return -mu * J_m / 2 * sp.log(1 - (I1bar - 3) / J_m)


def _ogden(a: Any, b: Any, c: Any, *pairs: Any) -> Any:
    terms: Sequence[tuple[Any, Any]] = list(zip(pairs[::2], pairs[1::2], strict=True))
    return sum(mu / alpha * (a**alpha + b**alpha + c**alpha - 3) for mu, alpha in terms)


def _volumetric(I3: Any, kappa: Any) -> Any:
    return kappa * ((I3 - 1) / 2 - sp.log(I3) / 2) / 2


_INVERSE_LANGEVIN = ((1, 2), (1, 20), (11, 1050), (19, 7000), (519, 673750))
"""First five terms of the energy of a chain with an inverse Langevin function."""

MOONEY_RIVLIN = Energy(
    {"mu_1": "elastic parameter [MPa]", "mu_2": "elastic parameter [MPa]"}, _mooney_rivlin
)
"""First two terms of (3), isochoric; with mu_2 = 0 the neo-Hookean solid."""

YEOH = Energy({f"c_{i}": f"coefficient of (I1bar - 3)^{i} [MPa]" for i in (1, 2, 3)}, _yeoh)
"""O. H. Yeoh, Rubber Chem. Technol. 66 (1993) 754: a cubic in I1bar - 3."""

ARRUDA_BOYCE = Energy(
    {"mu": "modulus of the chains [MPa]", "lambda_m": "stretch at which the chains lock"},
    _arruda_boyce,
)
"""E. M. Arruda, M. C. Boyce, J. Mech. Phys. Solids 41 (1993) 389: eight chains, five terms."""

GENT = Energy(
    {"mu": "shear modulus [MPa]", "J_m": "limit of I1bar - 3 where the chains lock"}, _gent
)
"""A. N. Gent, Rubber Chem. Technol. 69 (1996) 59; I1bar - 3 < J_m."""

OGDEN = Energy(
    {
        name: meaning
        for p in (1, 2, 3)
        for name, meaning in (
            (f"mu_{p}", f"modulus of term {p} [MPa]"),
            (f"alpha_{p}", f"exponent of term {p}"),
        )
    },
    _ogden,
    of="stretches",
)
"""R. W. Ogden, Proc. R. Soc. A 326 (1972) 565: mu_p / alpha_p times the sum of lambda^alpha_p - 1.

A term with mu_p = 0 is none; its exponent must not be 0.
"""

VOLUMETRIC = Energy({"kappa": "bulk modulus [MPa]"}, _volumetric)
"""W_v of (6)."""
