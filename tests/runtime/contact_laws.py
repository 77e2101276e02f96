"""Laws of contact, for tests: a penalty with friction, conductance, cohesion, wear."""

from __future__ import annotations

import sympy as sp

import softehl


@softehl.page
def penalty(m):  # type: ignore[no-untyped-def]
    """Penalty on the gap and on the slip of a step, with Coulomb's friction."""
    k, mu = m.parameters(k="stiffness [MPa/mm]", mu="coefficient of friction")
    g, s = m.gap, m.slip
    p = m.define("p", sp.Max(-k * g, 0))
    square = m.define("square", k**2 * s.dot(s))
    slides = square > (mu * p) ** 2
    size = sp.sqrt(sp.Piecewise((square, slides), (1, True)))
    share = m.define("share", sp.Piecewise((mu * p / size, slides), (1, g < 0), (0, True)))
    m.weak(-p, g)
    m.weak(k * share * s, s)
    m.fields(pressure=p)


@softehl.page
def conductance(m):  # type: ignore[no-untyped-def]
    """Heat that flows by a difference of temperatures."""
    T = m.scalar("T")
    (h,) = m.parameters(h="conductance [W/mm^2/K]")
    m.minimise(h / 2 * m.jump(T) ** 2)
    m.fields(flux=h * m.jump(T))


@softehl.page
def cohesion(m):  # type: ignore[no-untyped-def]
    """Xu and Needleman's traction e s (g / d) exp(-g / d), and a penalty on penetration."""
    s, d = m.parameters(s="strength [MPa]", d="gap of the strength [mm]")
    g = m.gap
    opening = m.define("opening", sp.Max(g, 0))
    energy = s * sp.E * d * (1 - (1 + opening / d) * sp.exp(-opening / d))
    m.minimise(energy + s * sp.E / d * sp.Min(g, 0) ** 2 / 2)
    m.fields(pressure=-s * sp.E * (opening * sp.exp(-opening / d) + sp.Min(g, 0)) / d)


@softehl.page
def archard(m):  # type: ignore[no-untyped-def]
    """Wear of the first side: its depth grows by the pressure times the slip."""
    k, e = m.parameters(k="wear [1/MPa]", e="stiffness [MPa/mm]")
    (w,) = m.point_data(w="worn depth [mm]")
    s = m.slip
    p = m.define("p", sp.Max(-e * (m.gap + w), 0))
    grown = m.define("grown", w + k * p * sp.sqrt(s.dot(s) + sp.Float(1e-24)))
    m.weak(-p, m.gap)
    m.history(w=grown)
    m.fields(pressure=p, worn=grown)
