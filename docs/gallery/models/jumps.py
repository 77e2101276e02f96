"""Poisson's equation with fields that jump between cells: symmetric interior penalty."""

import sympy as sp

import softehl


@softehl.page
def cells(m):
    """-div grad u = 8 pi^2 sin(2 pi x) sin(2 pi y)."""
    u, (x, y, *_) = m.scalar("u"), m.position
    source = 8 * sp.pi**2 * sp.sin(2 * sp.pi * x) * sp.sin(2 * sp.pi * y)
    m.minimise(m.grad(u).dot(m.grad(u)) / 2 - source * u)


@softehl.page
def facets(m):
    """Continuous between cells and zero on a side, by a penalty."""
    u = m.scalar("u")
    (gamma,) = m.parameters(gamma="penalty")
    flux = m.average(m.grad(u)).dot(m.normal)
    m.minimise(gamma / (2 * m.size) * m.jump(u) ** 2 - flux * m.jump(u))
