"""Cook's membrane of compressible rubber, in plane strain and in three dimensions."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def rubber(kind: str) -> Definition:
    """W = mu / 2 (I1 J^(-2/3) - 3) + kappa / 4 (J^2 - 1 - 2 ln J)."""
    cell = element(kind)
    m = Model(f"cook_{kind}", nodes=len(cell.nodes), rule=cell.rule)
    X = m.coordinates(*"XYZ"[: cell.dimension])
    u = m.nodal_unknowns(*("u_x", "u_y", "u_z")[: cell.dimension])
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace() + 3 - cell.dimension
    W = mu / 2 * (I1 * J ** sp.Rational(-2, 3) - 3) + kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    m.potential(m.integral("Pi", W * e.detJ))
    m.fields(sigma_xx=(m.derivative("P", W, F) * F.T)[0, 0] / J)
    return m.finish()


MODELS = [rubber("quad4"), rubber("hex8")]
