"""Stokes' flow with velocity and pressure of one order, stabilised by the pressure (PSPG).

Cells: quad4, tri3, hex8, tet4
Source: Hughes, Franca and Balestra (1986), CMAME 59, 85-99.
Benchmark: flow between plates, exact at the nodes.
"""

import sympy as sp

from softehl import Fields, page


@page
def stokes_pspg(m: Fields) -> None:
    """div(2 eta D - p I) = 0, div v = h^2 / (12 eta) div(grad p); h^size: volume of a cell."""
    v, p = m.vector("v"), m.scalar("p")
    (eta,) = m.parameters(eta="viscosity")
    m.require(eta > 0)
    size = len(v)
    L = m.grad(v)[:size, :size]
    h = m.define("h", 2 * m.jacobian.det() ** sp.Rational(1, size))
    m.weak(eta * (L + L.T), L)
    for k in range(size):
        m.weak(-p, L[k, k])
    m.weak(-L.trace(), p)
    m.weak(-(h**2) / (12 * eta) * m.grad(p), m.grad(p))
