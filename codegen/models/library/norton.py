"""Creep by Norton's power law, with linear elasticity.

Source: Norton (1929), The Creep of Steel at High Temperatures; Odqvist (1974).
Benchmark: creep at constant stress, strain sigma / E + A sigma^n t.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def norton(m: Material) -> None:
    """Rate of the creep strain A q^n along the deviator; implicit in time."""
    E, nu, A, n, dt = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        A="factor [1/(MPa^n s)]",
        n="exponent",
        dt="step [s]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), A >= 0, n >= 1)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    v = m.point_data(**{f"c_{name}": "creep strain" for name in NAMES})
    c = sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - c))
    q = m.define("q", m.norm(list(s)) * sp.sqrt(sp.Rational(3, 2)))
    # equivalent stress after the step, from its largest value q
    now = m.implicit("now", lambda x: x + 3 * G * dt * A * x**n - q, start=q)
    ratio = m.define("ratio", sp.Piecewise((now / q, q > 0), (1, True)))
    m.stress(K * volume * sp.eye(3) + ratio * s)
    new = c + (1 - ratio) / (2 * G) * s
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.history(**{f"c_{name}": x for name, x in zip(NAMES, parts, strict=True)})
