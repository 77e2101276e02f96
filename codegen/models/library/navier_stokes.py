"""Incompressible flow of a Newtonian fluid, pressure of one order less (Taylor and Hood).

Cells: quad9, tri6, hex27, tet10
Source: Taylor and Hood (1973), Computers & Fluids 1, 73-100.
Benchmark: cavity with a moving lid at Re = 100.
"""

from softehl import Fields, page


@page
def navier_stokes(m: Fields) -> None:
    """rho (dv/dt + v . grad v) = div(2 eta D - p I), div v = 0; rho = 0 is Stokes' flow."""
    v, p = m.vector("v"), m.scalar("p", order=1)
    rho, eta = m.parameters(rho="density", eta="viscosity")
    m.require(rho >= 0, eta > 0)
    size = len(v)
    L = m.grad(v)[:size, :size]
    m.weak(rho * (m.rate(v) + L * v), v)
    m.weak(eta * (L + L.T), L)
    for k in range(size):
        m.weak(-p, L[k, k])
    m.weak(-L.trace(), p)
