"""Steady heat with a conductivity of the temperature."""

import softehl


@softehl.page
def conduction(m):
    """div (k(T) grad T) = 0."""
    T = m.scalar("T")
    m.weak(m.table("k", T) * m.grad(T), m.grad(T))
