"""Heat in bodies, and across their contact."""

import softehl


@softehl.page
def conduction(m):
    """Fourier's law."""
    T = m.scalar("T")
    (k,) = m.parameters(k="conductivity [W/mm/K]")
    m.minimise(k / 2 * m.grad(T).dot(m.grad(T)))


@softehl.page
def conductance(m):
    """A flux h (T - T') across the contact."""
    T = m.scalar("T")
    (h,) = m.parameters(h="conductance [W/mm^2/K]")
    m.minimise(h / 2 * m.jump(T) ** 2)
    m.fields(flux=h * m.jump(T))
