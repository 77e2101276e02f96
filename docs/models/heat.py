"""Heat in a bar, 2 nodes."""

from softehl import Definition, Model, element, kinematics, quadrature


def heat() -> Definition:
    """Capacity times dT/dt = d/dx (conductivity dT/dx)."""
    m = Model("heat", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    k, c = m.parameters(k="conductivity [W/(mm K)]", c="capacity [J/(mm^3 K)]")
    (rate,) = m.rates("T")
    (xi,) = m.point()
    bar = element("line2")
    e = kinematics.isoparametric(m, X, bar.gradient(xi))
    slope = m.define("slope", sum(d[0] * v for d, v in zip(e.dN, T, strict=True)))
    here = m.define("here", sum(N * v for N, v in zip(bar.shape(xi), T, strict=True)))
    heating = m.define("heating", sum(N * v for N, v in zip(bar.shape(xi), rate, strict=True)))
    m.weak_form([(k * slope * e.detJ, slope), (c * heating * e.detJ, here)])
    return m.finish()
