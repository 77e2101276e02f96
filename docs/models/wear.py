"""A block that wears."""

import sympy as sp

import softehl


@softehl.page
def elastic(m):
    """Hooke's law without Poisson's effect."""
    (E,) = m.parameters(E="Young's modulus [MPa]")
    G = m.grad(m.vector("u"))
    m.minimise(E / 8 * sum(v**2 for v in G + G.T))


@softehl.page
def archard(m):
    """dw/dt = k p |v|."""
    k, e = m.parameters(k="wear [1/MPa]", e="stiffness [MPa/mm]")
    (w,) = m.point_data(w="worn depth [mm]")
    p = m.define("p", sp.Max(-e * (m.gap + w), 0))
    m.weak(-p, m.gap)
    slip = sp.sqrt(m.slip.dot(m.slip) + sp.Float(1e-24))
    worn = m.define("worn", w + k * p * slip)
    m.history(w=worn)
    m.fields(pressure=p, worn=worn)
