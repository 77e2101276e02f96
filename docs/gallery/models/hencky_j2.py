"""J2 plasticity at large strain with Hencky's strain, a material for any body."""

import sympy as sp

import softehl


@softehl.material
def hencky_j2(m):
    """Multiplicative plasticity: von Mises, linear hardening, exponential map."""
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    names = ("c_xx", "c_yy", "c_zz", "c_xy", "c_yz", "c_xz")
    *c, alpha = m.point_data(**dict.fromkeys(names, "Cp^-1 - 1"), alpha="plastic strain")
    Cp = sp.eye(3) + sp.Matrix([[c[0], c[3], c[5]], [c[3], c[1], c[4]], [c[5], c[4], c[2]]])

    b = m.define("b", m.F * Cp * m.F.T)  # of the trial state: nothing flows
    e = m.log(b) / 2
    volume = m.define("volume", e.trace())
    s = m.define("s", e - volume / 3 * sp.eye(3))
    q = m.define("q", sp.sqrt(6) * G * m.norm(s))
    flow = m.define("flow", sp.Max(q - sy - H * alpha, 0) / (3 * G + H))
    m.energy(K / 2 * volume**2 + q**2 / (6 * G) - (3 * G + H) / 2 * flow**2)

    back = sp.Piecewise((3 * G * flow / q, flow > 0), (0, True))
    elastic = m.exp(2 * (e - m.define("back", back) * s))
    Fi = m.F.inv()
    new = Fi * elastic * Fi.T - sp.eye(3)
    entries = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.history(**dict(zip(names, entries, strict=True)), alpha=alpha + flow)
    m.fields(alpha=alpha + flow)
