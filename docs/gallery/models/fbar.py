"""Nearly incompressible rubber in plane strain, 4 nodes: as it is, and three kinds of F-bar."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def quad(name: str) -> Definition:
    """W = K / 2 (J - 1)^2 + G / 2 (I1 J^(-2/3) - 3) of F-bar, whose J is that of the centre."""
    cell = element("quad4")
    m = Model(name, nodes=4, rule=cell.rule)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    dN, X, x = sp.Matrix(cell.gradient(0, 0)), sp.Matrix(X), sp.Matrix(X) + sp.Matrix(u)
    share = {"standard": 0, "spatial": sp.Rational(1, 3)}.get(name, sp.Rational(1, 2))
    centre = (x * dN).det() / (X * dN).det() if share else 1
    scale = m.define("scale", (centre / F.det()) ** share) if share else sp.Integer(1)
    Fbar = m.define("Fbar", sp.diag(scale * F, scale if name == "spatial" else 1))
    J = m.define("J", Fbar.det())
    W = K / 2 * (J - 1) ** 2 + G / 2 * ((Fbar.T * Fbar).trace() * J ** sp.Rational(-2, 3) - 3)
    P = m.derivative("P", W, Fbar)
    pull = scale * F.det() / J * e.detJ  # Cauchy's stress of F-bar does work on the true motion
    if name in ("classical", "spatial"):
        m.weak_form([(P[i, j] * pull, F[i, j]) for i in (0, 1) for j in (0, 1)])
    else:
        m.potential(m.integral("Pi", W * e.detJ))
    m.fields(pressure=K * (1 - J))
    return m.finish()


MODELS = [quad(name) for name in ("standard", "potential", "classical", "spatial")]
