"""Time-harmonic sound: equation of Helmholtz for a real pressure.

Cells: any
Source: Ihlenburg (1998), Finite Element Analysis of Acoustic Scattering, chapter 2.
Benchmark: closed duct, pressure at its rigid end.
"""

from softehl import Fields, page


@page
def helmholtz(m: Fields) -> None:
    """div(grad p) + k^2 p = 0; sides without a condition are rigid."""
    p = m.scalar("p")
    (k,) = m.parameters(k="wave number, frequency over speed of sound [1/mm]")
    m.require(k >= 0)
    gradient = m.grad(p)
    m.minimise((gradient.dot(gradient) - k**2 * p**2) / 2)
