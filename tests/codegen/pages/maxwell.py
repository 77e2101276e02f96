"""Finite viscoelasticity: the strain of the dashpot is found inside the kernel."""

from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def maxwell() -> Definition:
    """4-node plane strain solid: neo-Hookean spring beside a Maxwell branch with strain C_v.

    dC_v/dt = (Cbar - p C_v) / tau by backward Euler, p such that det C_v = 1; C_v is history and
    begins as the unit matrix.
    """
    m = Model("maxwell", nodes=4, rule=quadrature.gauss(2, 2), doc=maxwell.__doc__)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u", "v")
    mu, kappa, mu_v, tau, dt = m.parameters(
        mu="shear modulus of the spring [MPa]",
        kappa="bulk modulus [MPa]",
        mu_v="shear modulus of the branch [MPa]",
        tau="relaxation time [s]",
        dt="time step [s]",
    )
    old = m.point_data(a_n="C_v xx before", b_n="C_v yy", c_n="C_v zz", d_n="C_v xy")
    e = kin.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    C = m.define("C", J ** sp.Rational(-2, 3) * sp.diag(F.T * F, 1))

    def matrix(v: Any) -> Any:
        return sp.Matrix([[v[0], v[3], 0], [v[3], v[1], 0], [0, 0, v[2]]])

    def evolution(s: Any) -> list[Any]:
        Cv, p = matrix(s), s[4]
        change = Cv - matrix(old) - dt / tau * (C - p * Cv)
        return [change[0, 0], change[1, 1], change[2, 2], change[0, 1], Cv.det() - 1]

    *Cv, _ = m.implicit("Cv", evolution, start=[*old, 1])
    elastic = (C * matrix(Cv).adjugate()).trace()  # tr(Cbar C_v^-1)
    W = mu / 2 * (C.trace() - 3) + kappa / 2 * (J - 1) ** 2 + mu_v / 2 * (elastic - 3)
    m.potential(m.integral("Pi", W * e.detJ), constant=Cv)

    m.fields(a=Cv[0], b=Cv[1], c=Cv[2], d=Cv[3])
    return m.finish()
