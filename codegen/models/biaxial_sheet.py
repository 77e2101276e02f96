"""Homogeneous stretching of an incompressible sheet: what tests of a rubber measure."""

from __future__ import annotations

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.energies import Energy
from softehl.codegen.language.model import Model


def sheet(name: str, energy: Energy) -> Definition:
    """Energy of a unit volume at principal logarithmic strains (e_1, e_2, -e_1 - e_2).

    The residual is sigma_1 - sigma_3 and sigma_2 - sigma_3 of the true stresses, the tangent what
    Drucker's criterion asks to be positive definite. Uniaxial: e_2 = -e_1 / 2; equibiaxial: e_2 =
    e_1, with sigma_1 = sigma_2; planar (pure shear): e_2 = 0; the nominal stress is sigma / lambda.
    """
    m = Model(name, nodes=1, rule=quadrature.point_rule(), unroll=True, doc=sheet.__doc__ or "")
    m.coordinates("Z", "R")
    e = [m.unknown("strain_1"), m.unknown("strain_2")]
    term = energy.declared(m)
    a, b, c = (m.define(f"stretch_{k}", sp.exp(s)) for k, s in enumerate([*e, -e[0] - e[1]]))
    if term.of == "stretches":
        m.potential(term(a, b, c))
    else:
        first = m.define("I1", a**2 + b**2 + c**2)
        second = m.define("I2", a**-2 + b**-2 + c**-2)
        m.potential(term(first, second))
    m.offer(derivatives=energy.parameter_symbols())
    return m.finish()
