"""Poisson's equation with discontinuous fields: symmetric interior penalty."""

import sympy as sp

import softehl


@softehl.page
def poisson(m):
    """-div grad u = 2 pi^2 sin(pi x) sin(pi y)."""
    u, place = m.scalar("u"), m.position
    source = 2 * sp.pi**2 * sp.sin(sp.pi * place[0]) * sp.sin(sp.pi * place[1])
    m.minimise(m.grad(u).dot(m.grad(u)) / 2 - source * u)


@softehl.page
def facets(m):
    """gamma / (2 h) [u]^2 - {grad u} . n [u]: continuous between cells, zero on a side."""
    u = m.scalar("u")
    (gamma,) = m.parameters(gamma="penalty")
    flux = m.average(m.grad(u)).dot(m.normal)
    m.minimise(gamma / (2 * m.size) * m.jump(u) ** 2 - flux * m.jump(u))
