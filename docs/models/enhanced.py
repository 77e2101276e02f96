"""An enhanced quadrilateral or hexahedron: incompatible modes, condensed."""

import sympy as sp

import softehl


@softehl.page
def enhanced(m):
    """Neo-Hooke; its gradient has what the modes 1 - xi_k^2 add, after Wilson, Simo and Rifai."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    size = len(u)
    a = sp.Matrix(size, size, m.internal("a", size**2))
    J, middle = m.jacobian, m.centroid(m.jacobian)
    added = middle.det() / J.det() * a * sp.diag(*m.parent) * middle.inv()
    F = m.define("F", m.deformation_gradient(u, "F_u") + sp.diag(added, sp.zeros(3 - size)))
    ln_J = m.define("ln_J", sp.log(F.det()))
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * ln_J) + lame / 2 * ln_J**2)
