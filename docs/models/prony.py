"""A rubber with any number of viscous branches."""

import sympy as sp

import softehl

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


def renewed(V, E, tau, dt):
    """Viscous strain after a step: dV/dt = (E - V) / tau."""
    return [(v + dt / tau * e) / (1 + dt / tau) for v, e in zip(V, E, strict=True)]


@softehl.material
def prony(m):
    """S = mu (1 - C^-1) + K J (J - 1) C^-1 + sum of 2 G (E - V)."""
    mu, K, dt = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]", dt="step [s]")
    G, tau = m.array("G", "moduli of the branches [MPa]"), m.array("tau", "their times [s]")
    V = [m.point_array(f"V_{name}", G, "viscous strain") for name in NAMES]
    C, J, E = m.define("C", m.F.T * m.F), m.define("J", m.F.det()), m.green
    now = [E[0, 0], E[1, 1], E[2, 2], E[0, 1], E[1, 2], E[0, 2]]

    def stress(G, tau, V):
        return [2 * G * (e - v) for e, v in zip(now, renewed(V, now, tau, dt), strict=True)]

    xx, yy, zz, xy, yz, xz = m.sum(G, tau, V, stress)
    new = m.each(tau, V, lambda tau, V: renewed(V, now, tau, dt))
    viscous = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inverse = C.adjugate() / J**2
    m.second_stress(mu * (sp.eye(3) - inverse) + K * J * (J - 1) * inverse + viscous)
    m.history(**{f"V_{name}": v for name, v in zip(NAMES, new, strict=True)})
