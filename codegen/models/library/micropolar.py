"""Micropolar elasticity (Cosserat) in plane strain: displacements and a rotation of its own.

Cells: tri6, quad8, quad9
Source: Eringen (1966), J. Math. Mech. 15, 909-923; Mindlin (1963), Experimental Mechanics 3, 1-7.
Benchmark: hole in a wide plate under tension, stress concentration.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def micropolar(m: Fields) -> None:
    """Stiffness against strain, rotation less phi, and grad phi.

    N is 0 without coupling, and near 1 phi is the rotation of the displacements.
    """
    if m.geometry == "axisymmetric":
        raise ModelError("micropolar has no hoop strain: it is for bodies in the plane")
    u, phi = m.vector("u"), m.scalar("phi")
    E, nu, N, length = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        N="coupling number, from 0 to 1",
        length="characteristic length of bending [mm]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), N >= 0, N < 1, length > 0)
    mu, lame = E / (2 + 2 * nu), E * nu / ((1 + nu) * (1 - 2 * nu))
    coupling = mu * N**2 / (1 - N**2)
    gradient, bend = m.grad(u)[:2, :2], m.grad(phi)
    strain = (gradient + gradient.T) / 2
    turn = (gradient[1, 0] - gradient[0, 1]) / 2 - phi
    W = lame / 2 * strain.trace() ** 2 + mu * (strain**2).trace() + 2 * coupling * turn**2
    m.minimise(W + 2 * mu * length**2 * bend.dot(bend))
    stress = lame * strain.trace() * sp.eye(2) + 2 * mu * strain
    m.fields(
        sigma_xx=stress[0, 0],
        sigma_yy=stress[1, 1],
        sigma_xy=stress[0, 1] - 2 * coupling * turn,
        sigma_yx=stress[0, 1] + 2 * coupling * turn,
    )
