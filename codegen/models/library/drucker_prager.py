"""Plasticity of Drucker and Prager at small strain, with return to the apex.

Source: Drucker and Prager (1952); de Souza Neto et al. (2008), section 8.3.
Benchmark: yield stresses in tension and compression.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def drucker_prager(m: Material) -> None:
    """sqrt(J2) + a p <= k with the mean stress p; flow with a_flow in place of a."""
    E, nu, a, a_flow, k = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        a="friction: weight of the mean stress",
        a_flow="dilatancy: its weight in the flow",
        k="cohesion [MPa]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), a > 0, a_flow > 0, k > 0)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    v = m.point_data(**{f"p_{name}": "plastic strain" for name in NAMES})
    plastic = sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])
    e = m.strain - plastic
    p = m.define("p", K * e.trace())
    s = m.define("s", 2 * G * (e - e.trace() / 3 * sp.eye(3)))
    r = m.define("r", m.norm(list(s)) / sp.sqrt(2))
    f = m.define("f", r + a * p - k)
    cone = m.define("cone", f / (G + K * a * a_flow))  # amount of flow on the cone
    apex = m.define("beyond", r - G * cone) <= 0
    ratio = sp.Piecewise((1, f <= 0), (0, apex), (1 - G * cone / r, True))
    ratio = m.define("ratio", ratio)
    mean = sp.Piecewise((p, f <= 0), (k / a, apex), (p - K * a_flow * cone, True))
    mean = m.define("mean", mean)
    m.stress(mean * sp.eye(3) + ratio * s)
    new = plastic + (1 - ratio) / (2 * G) * s + (p - mean) / (3 * K) * sp.eye(3)
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.history(**{f"p_{name}": x for name, x in zip(NAMES, parts, strict=True)})
