"""A rubber that creeps: a neo-Hookean spring beside one in series with a dashpot."""

import sympy as sp

import softehl


@softehl.material
def creeping(m):
    """S = mu (1 - C^-1) + K J (J - 1) C^-1 + 2 G (E - V) with dV/dt = (E - V) / tau."""
    mu, K, G, tau, dt = m.parameters(
        mu="shear modulus [MPa]",
        K="bulk modulus [MPa]",
        G="modulus of the spring in series [MPa]",
        tau="time of relaxation [s]",
        dt="length of the time step [s]",
    )
    names = ("xx", "yy", "zz", "xy", "yz", "xz")
    V = m.point_data(**{f"V_{name}": "viscous strain" for name in names})
    E = m.green
    C = m.define("C", m.F.T * m.F)
    J = m.define("J", m.F.det())
    inverse = C.adjugate() / J**2
    now = [E[0, 0], E[1, 1], E[2, 2], E[0, 1], E[1, 2], E[0, 2]]
    new = m.implicit(
        "V",
        lambda v: [a - b - dt / tau * (e - a) for a, b, e in zip(v, V, now, strict=True)],
        start=list(V),
    )
    xx, yy, zz, xy, yz, xz = new
    viscous = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    one = sp.eye(3)
    m.second_stress(mu * (one - inverse) + K * J * (J - 1) * inverse + 2 * G * (E - viscous))
    m.history(**{f"V_{name}": v for name, v in zip(names, new, strict=True)})
