"""Viscoplastic steel at small strain: von Mises, linear hardening, Perzyna's overstress."""

import sympy as sp

import softehl


@softehl.material
def viscoplastic(m):
    """Flow rate d(alpha)/dt = max(q - sy - H alpha, 0) / eta; backward Euler in closed form."""
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    eta, dt = m.parameters(eta="viscosity [MPa s]", dt="length of the time step [s]")
    names = ("xx", "yy", "zz", "xy", "yz", "xz")
    old = m.point_data(**{f"p_{n}": "plastic strain" for n in names}, alpha="equivalent strain")
    xx, yy, zz, xy, yz, xz, alpha = old
    p = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))  # if nothing flows
    q = m.define("q", sp.sqrt(sp.Rational(3, 2) * (s * s).trace()))
    excess = m.define("excess", q - sy - H * alpha)
    flows = excess > 0
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H + eta / dt), flows), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), flows), (0, True)))
    m.stress(K * volume * sp.eye(3) + (1 - 2 * G * flow) * s)
    new = p + flow * s
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    m.history(**{f"p_{n}": new[ij] for n, ij in zip(names, places, strict=True)}, alpha=alpha + dg)
    m.example(E=200000, nu=sp.Rational(3, 10), sy=250, H=2000, eta=100, dt=1)
