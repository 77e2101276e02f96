"""A linear four-node solid with four enhanced strains (Q1E4): unknowns of single elements."""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes


def enhanced() -> Definition:
    """Plane strain; the strains are those of Simo and Rifai, transformed at the centre."""
    m = Model("enhanced", nodes=4, rule=quadrature.gauss(2, 2), unroll=True)
    X, u = m.coordinates("X", "Y"), m.nodal_unknowns("u_x", "u_y")
    a = [m.unknown(f"a_{k}") for k in range(4)]
    lame, mu = m.parameters(lame="first Lame parameter", mu="shear modulus")
    xi, eta = m.point()
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(xi, eta))
    F = kinematics.deformation_gradient(m, e.dN, u)
    signs = ((-1, 1, 1, -1), (-1, -1, 1, 1))
    centre = sp.Matrix(2, 2, lambda i, j: sum(s * x for s, x in zip(signs[j], X[i], strict=True)))
    centre /= 4
    shear = (a[2] * xi + a[3] * eta) / 2
    modes = sp.Matrix([[a[0] * xi, shear], [shear, a[1] * eta]])
    back = centre.inv()
    eps = (F + F.T) / 2 - sp.eye(2) + centre.det() / e.detJ * back.T * modes * back
    W = lame / 2 * eps.trace() ** 2 + mu * (eps.T * eps).trace()
    m.potential(m.integral("Pi", W * e.detJ))
    return m.finish()
