"""Navier-Stokes with velocity and pressure of one order, stabilised (PSPG and SUPG).

Cells: quad4, tri3, hex8, tet4
Source: Tezduyar (1992), Advances in Applied Mechanics 28, 1-44.
Benchmark: Kovasznay's flow at Re = 40; cavity with a moving lid at Re = 100.
"""

import sympy as sp

from softehl import Fields, page


@page
def pspg_supg(m: Fields) -> None:
    """rho (dv/dt + v . grad v) = div(2 eta D - p I), div v = 0, and residuals times tau."""
    v, p = m.vector("v"), m.scalar("p")
    rho, eta = m.parameters(rho="density", eta="viscosity")
    m.require(rho > 0, eta > 0)
    size = len(v)
    L = m.grad(v)[:size, :size]
    h = m.define("h", 2 * m.jacobian.det() ** sp.Rational(1, size))
    # momentum that a linear cell does not balance
    r = m.define("r", rho * (m.rate(v) + L * v) + m.grad(p))
    speed = sum(a**2 for a in v)
    tau = m.define("tau", 1 / sp.sqrt(4 * rho**2 * speed / h**2 + (12 * eta / h**2) ** 2))
    m.weak(rho * (m.rate(v) + L * v), v)
    m.weak(eta * (L + L.T) + rho * tau * r * v.T, L)
    for k in range(size):
        m.weak(-p, L[k, k])
    m.weak(-L.trace(), p)
    m.weak(-tau * r, m.grad(p))
