"""A linear elastic body, and adhesion between two."""

import sympy as sp

import softehl


@softehl.page
def hooke(m):
    """Hooke's law for small strain."""
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    F = m.deformation_gradient(m.vector("u"))
    e = (F + F.T) / 2 - sp.eye(3)
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    m.minimise(lame / 2 * e.trace() ** 2 + G * (e * e).trace())


@softehl.page
def maugis(m):
    """Tension s up to the gap h, with ramps of a tenth of h; a stiff spring for g < 0."""
    s, h = m.parameters(s="tension [MPa]", h="range [mm]")
    g, ramp = m.gap, h / 10
    fall = (s * (h + ramp - g) / ramp, g < h + ramp)
    tension = sp.Piecewise((s * g / ramp, g < ramp), (s, g < h), fall, (0, True))
    m.weak(m.define("tension", tension), g)
    m.fields(tension=tension)
