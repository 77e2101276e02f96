"""Materials that come with softehl: `Study.add("body", material="neo_hooke", mu=0.4, kappa=0.9)`.

Rubbers are the energies of `language.energies`, with the volumetric term of all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from softehl.codegen.language.energies import (
    ARRUDA_BOYCE,
    GENT,
    MOONEY_RIVLIN,
    OGDEN,
    VOLUMETRIC,
    YEOH,
    Energy,
)
from softehl.codegen.language.material import Law, Material

_NEO_HOOKE = Energy({"mu": "shear modulus [MPa]"}, lambda I1, _, mu: mu / 2 * (I1 - 3))
_POSITIVE = ("mu", "J_m", "lambda_m", "kappa")


def _linear(m: Material, strain: Any) -> None:
    """lame / 2 (tr strain)^2 + G strain : strain."""
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio, below 0.5")
    m.require(E > 0, nu > -1, nu < 0.5)
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    m.energy(lame / 2 * strain.trace() ** 2 + G * (strain.T * strain).trace())


def _hooke(m: Material) -> None:
    _linear(m, m.strain)


def _saint_venant(m: Material) -> None:
    _linear(m, m.green)


def _of(energy: Energy) -> Callable[[Material], None]:
    return lambda m: _isochoric(m, energy)


def _isochoric(m: Material, energy: Energy) -> None:
    """The energy at C / J^(2/3), and kappa / 4 (J^2 - 1 - 2 ln J)."""
    term = energy.declared(m.model)
    J = m.define("J", m.F.det(method="berkowitz"))
    C = m.define("C", J ** sp.Rational(-2, 3) * m.F.T * m.F)
    if term.of == "stretches":
        W = m.model.principal(f"{m.name}_W", C, term.value)
    else:
        I1 = m.define("I1", C.trace())
        W = term(I1, m.define("I2", (I1**2 - (C * C).trace()) / 2))
    m.energy(W + VOLUMETRIC.declared(m.model)(J**2))
    parameters = (*energy.parameter_symbols(), *VOLUMETRIC.parameter_symbols())
    m.require(*(symbol > 0 for symbol in parameters if str(symbol) in _POSITIVE))


LAWS = {
    law.name: law
    for law in (
        Law("hooke", "Linear elasticity at small strain.", _hooke),
        Law("saint_venant", "Linear between Green's strain and its stress.", _saint_venant),
        Law("neo_hooke", "mu / 2 (I1bar - 3).", _of(_NEO_HOOKE)),
        Law("mooney_rivlin", "mu_1 / 2 (I1bar - 3) + mu_2 / 2 (I2bar - 3).", _of(MOONEY_RIVLIN)),
        Law("yeoh", "A cubic in I1bar - 3.", _of(YEOH)),
        Law("gent", "Chains that lock.", _of(GENT)),
        Law("arruda_boyce", "Eight chains, five terms.", _of(ARRUDA_BOYCE)),
        Law("ogden", "Three terms in principal stretches.", _of(OGDEN)),
    )
}
"""Laws by name."""


def law(name: str) -> Law:
    """The law of a name; capitals, hyphens and spaces do not count.  Raises ValueError."""
    letters = "".join(filter(str.isalpha, name.lower()))
    match = next((LAWS[key] for key in LAWS if key.replace("_", "") == letters), None)
    if match is None:
        raise ValueError(
            f"no material is called {name!r}; allowed: {', '.join(LAWS)}, a law of "
            "the library (softehl elements lists them), or a file, my_law.py"
        )
    return match
