"""Membrane with wrinkles: incompressible neo-Hooke by its relaxed energy (tension field).

Cells: quad4
Source: Pipkin (1986), IMA J. Applied Mathematics 36, 85-99; Stein and Hedgepeth (1961), NASA D-813.
Benchmark: inflated sphere, pressure; stretched and bent membrane, moment over force.
"""

import sympy as sp

from softehl import Definition, Model, quadrature, shapes


def membrane() -> Definition:
    """Tension along the larger stretch where the other one would be compressed, none where both.

    A small stiffness, `slack` times that of a taut membrane, keeps wrinkles in place. The pressure
    acts on the deformed side, along g_1 x g_2: outwards if the nodes turn so.
    """
    m = Model("membrane", nodes=4, rule=quadrature.gauss(2, 2), doc="Membrane with wrinkles.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    mu, t, p, slack = m.parameters(
        mu="shear modulus [MPa]",
        t="undeformed thickness [mm]",
        p="pressure [MPa]",
        slack="stiffness of wrinkles by that of a taut membrane",
    )
    m.require(mu > 0, t > 0, slack >= 0, slack <= 1)
    start = sp.Matrix(3, 4, lambda i, a: X[i][a])
    moved = sp.Matrix(3, 4, lambda i, a: u[i][a])
    xi, eta = m.point()
    gradients = sp.Matrix(shapes.quad4_gradient(xi, eta))
    G = m.define("G", start * gradients)
    g = m.define("g", (start + moved) * gradients)
    # axes in the plane: G = (e_1, e_2) L
    l1 = m.define("l1", m.norm(list(G[:, 0])))
    e1 = m.define("e1", G[:, 0] / l1)
    along = m.define("along", e1.dot(G[:, 1]))
    l2 = m.define("l2", m.norm(list(G[:, 1] - along * e1)))
    m.measure(l1 * l2, [])
    F = g * sp.Matrix([[1 / l1, -along / (l1 * l2)], [0, 1 / l2]])
    C = m.define("C", F.T * F)
    half, det = m.define("half", C.trace() / 2), m.define("det", C.det())
    taut = mu / 2 * (2 * half + 1 / det - 3)
    radius = m.norm([(C[0, 0] - C[1, 1]) / 2, C[0, 1]])
    large = m.define("large", half + radius)  # square of the larger stretch
    wrinkled = mu / 2 * (large + 2 / sp.sqrt(large) - 3)
    tiny = sp.Rational(1, 10**9)  # the undeformed membrane counts as taut
    is_slack, is_taut = large < 1 - tiny, det > sp.sqrt(large) - tiny
    relaxed = sp.Piecewise((0, is_slack), (taut, is_taut), (wrinkled, True))
    W = (1 - slack) * relaxed + slack * taut
    m.potential(m.integral("Pi", t * W * l1 * l2))
    displacement = moved * sp.Matrix(shapes.quad4(xi, eta))
    area = m.define("area", g[:, 0].cross(g[:, 1]) / (l1 * l2))
    m.weak_form([(-p * a * l1 * l2, v) for a, v in zip(area, displacement, strict=True)])
    state = sp.Piecewise((0, is_slack), (2, is_taut), (1, True))
    m.fields(state=state, stretch=sp.sqrt(large), thickness=t / sp.sqrt(det))
    return m.finish()
