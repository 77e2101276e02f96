"""Nearly incompressible rubber in plane strain, 4 nodes: as it is, and four kinds of F-bar."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def quad(name: str) -> Definition:
    """W = G / 2 (I1 - 3 - 2 ln J) + lame / 2 (ln J)^2 of F-bar, whose J is that of the centre."""
    cell = element("quad4")
    m = Model(name, nodes=4, rule=quadrature.gauss(3, 2))
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, lame = m.parameters(G="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    D, X, x = sp.Matrix(cell.gradient(0, 0)), sp.Matrix(X), sp.Matrix(X) + sp.Matrix(u)
    share = {"standard": 0, "spatial": sp.Rational(1, 3)}.get(name, sp.Rational(1, 2))
    centre = (x * D).det() / (X * D).det() if share else 1
    scale = m.define("scale", (centre / F.det()) ** share) if share else sp.Integer(1)
    Fbar = m.define("Fbar", sp.diag(scale * F, scale if name == "spatial" else 1))
    J = m.define("J", Fbar.det())
    W = G / 2 * ((Fbar.T * Fbar).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2
    P = m.derivative("P", W, Fbar)
    plane = [(i, j) for i in (0, 1) for j in (0, 1)]
    if name in ("classical", "spatial"):  # Cauchy's stress of F-bar does work on the true motion
        m.weak_form([(P[i, j] * scale * F.det() / J * e.detJ, F[i, j]) for i, j in plane])
    elif name == "transposed":  # d ln J = F^-T : dF with the transpose forgotten, and F-bar for F
        dN, start = sp.Matrix(e.dN), (X * D).inv()
        wrong = D * start * (x * D * start).inv().T - dN * (scale * F).inv().T
        half = m.define("half", sum(P[i, j] * F[i, j] for i, j in plane) / 2)
        terms = [(P[i, j], F[i, j]) for i, j in plane]
        terms += [(half * wrong[a, i], u[i][a]) for a in range(4) for i in (0, 1)]
        m.weak_form([(scale * factor * e.detJ, varied) for factor, varied in terms])
    else:
        m.potential(m.integral("Pi", W * e.detJ))
    m.fields(pressure=-(P * Fbar.T).trace() / (3 * J))
    return m.finish()


MODELS = [quad(name) for name in ("standard", "potential", "classical", "spatial", "transposed")]
