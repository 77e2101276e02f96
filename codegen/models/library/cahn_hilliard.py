"""Equation of Cahn and Hilliard of a mixture that separates.

Cells: any
Source: Cahn and Hilliard (1958), Journal of Chemical Physics 28, 258-267.
Benchmark: profile of a plane interface, tanh(x / (sqrt(2) width)).
"""

from softehl import Fields, page


@page
def cahn_hilliard(m: Fields) -> None:
    """dc/dt = mobility div(grad mu), mu = c^3 - c - width^2 div(grad c)."""
    c, mu = m.scalar("c"), m.scalar("mu")
    width, mobility = m.parameters(width="width of an interface [mm]", mobility="[mm2/s]")
    m.require(width > 0, mobility > 0)
    m.weak(m.rate(c), mu)
    m.weak(mobility * m.grad(mu), m.grad(mu))
    m.weak(mu + c - c**3, c)
    m.weak(-(width**2) * m.grad(c), m.grad(c))
    gradient = m.grad(c)
    m.fields(energy=(c**2 - 1) ** 2 / 4 + width**2 / 2 * gradient.dot(gradient))
