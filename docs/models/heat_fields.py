"""Heat on any cell."""

import softehl


@softehl.page
def heat(m):
    """Capacity times dT/dt = div (conductivity grad T)."""
    T = m.scalar("T")
    k, c = m.parameters(k="conductivity [W/(mm K)]", c="capacity [J/(mm^3 K)]")
    m.weak(k * m.grad(T), m.grad(T))
    m.weak(c * m.rate(T), T)
