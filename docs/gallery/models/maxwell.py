"""A solid with one Maxwell element, small strain, plane strain, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def maxwell() -> Definition:
    """s = 2 G dev e + q, where the overstress fades: dq/dt = 2 g d(dev e)/dt - q / tau."""
    cell = element("quad4")
    m = Model("maxwell", nodes=4, rule=cell.rule)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, g, K = m.parameters(G="long-term shear modulus [MPa]", g="of the spring", K="bulk [MPa]")
    tau, dt = m.parameters(tau="relaxation time [s]", dt="length of the step [s]")
    old = m.point_data(q_xx="overstress [MPa]", q_yy="", q_xy="", e_xx="deviator", e_yy="", e_xy="")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kinematics.deformation_gradient(m, e.dN, u) - sp.eye(2)
    strain = m.define("strain", (grad + grad.T) / 2)
    volume = strain.trace()
    dev = strain - volume / 3 * sp.eye(2)
    q_old, dev_old = (sp.Matrix([[a, c], [c, b]]) for a, b, c in (old[:3], old[3:]))
    half = m.define("half", sp.exp(-dt / (2 * tau)))
    q = m.define("q", half**2 * q_old + half * 2 * g * (dev - dev_old))
    stress = m.define("stress", K * volume * sp.eye(2) + 2 * G * dev + q)
    pairs = [(0, 0, 1), (1, 1, 1), (0, 1, 2)]
    m.weak_form([(c * stress[i, j] * e.detJ, strain[i, j]) for i, j, c in pairs])
    m.fields(s_xx=stress[0, 0], s_xy=stress[0, 1])
    m.history(q_xx=q[0, 0], q_yy=q[1, 1], q_xy=q[0, 1])
    m.history(e_xx=dev[0, 0], e_yy=dev[1, 1], e_xy=dev[0, 1])
    return m.finish()
