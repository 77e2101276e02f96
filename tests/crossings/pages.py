"""Model pages and materials of the crossings: one body, written in every way that a user may."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from typing import Any

import sympy as sp

import softehl

RUBBER = {"mu": "shear modulus [MPa]", "lame": "first Lame parameter [MPa]"}


def rubber_energy(F, J, mu, lame):
    """Compressible neo-Hooke."""
    return mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2


def rubber_stress(F, J, mu, lame):
    """First Piola-Kirchhoff stress of `rubber_energy`, by hand."""
    inverse = F.adjugate().T / J
    return mu * (F - inverse) + lame * sp.log(J) * inverse


def _minimised(m):
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    m.minimise(rubber_energy(F, J, *m.parameters(**RUBBER)))


@softehl.page
def energy(m):
    """The body by its energy."""
    _minimised(m)


@softehl.page
def weak_form(m):
    """The body by its weak form."""
    u = m.vector("u")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.weak(rubber_stress(F, J, *m.parameters(**RUBBER)), F)


@softehl.page(form="whole")
def whole(m):
    """The body as straight code for the whole element."""
    _minimised(m)


@softehl.page(form="point")
def point(m):
    """The body with loops over points and nodes."""
    _minimised(m)


@softehl.page
def learned(m):
    """A network of an invariant and a curve of the volume, whose numbers are given at run time."""
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    mu, lame = m.parameters(**RUBBER)
    I1 = m.define("I1", (F.T * F).trace() * J ** sp.Rational(-2, 3) - 3)
    W = m.network("W", [I1], layers=(3,), convex=True, monotone=True)
    m.minimise(mu * W + lame * m.table("U", J, interpolation="spline", outside="linear"))


@softehl.material
def stress_law(m):
    """The body by the stress of its material."""
    J = m.define("J", m.F.det())
    m.stress(rubber_stress(m.F, J, *m.parameters(**RUBBER)))


PRESSURE = """
#include <complex.h>
/* Derivative of lame / 2 log(J)^2 by x = J, lame. */
int pressure(const double complex *x, double complex *y, double complex *dy, double complex *ddy)
{
    y[0] = x[1] * clog(x[0]) / x[0];
    return 0;
}
"""


@softehl.material
def softened(m):
    """The body softens for good where it was stretched: several parts, each with history."""
    mu, lame = m.parameters(**RUBBER)
    share, rate = m.array("share"), m.array("rate")
    top = m.point_array("top", share, "largest energy so far")
    F = m.F
    J = m.define("J", F.det())
    energy = m.define("energy", ((F.T * F).trace() - 3 - 2 * sp.log(J)) / 2)
    left = m.sum(share, rate, top, lambda s, r, top: s * sp.exp(-r * sp.Max(top, energy)))
    inverse = F.adjugate().T / J
    p = m.external("pressure", [J, lame], source=PRESSURE)
    m.stress(mu * left * (F - inverse) + p * J * inverse)
    m.history(top=m.each(top, lambda top: sp.Max(top, energy)))


@softehl.material
def energy_law(m):
    """The body by the energy of its material."""
    J = m.define("J", m.F.det())
    m.energy(rubber_energy(m.F, J, *m.parameters(**RUBBER)))


@softehl.page
def local_stretch(m):
    """The body with a local unknown at every point: J by Newton's method from ln J."""
    u = m.vector("u")
    mu, lame = m.parameters(**RUBBER)
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    log_J = m.implicit("log_J", lambda y: sp.exp(y) - J, start=J - 1)
    m.weak(mu * (F - F.adjugate().T / J) + lame * log_J * F.adjugate().T / J, F)


def _mixed(m, u, p):
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * K))


@softehl.page
def mixed(m):
    """Displacements and one pressure in each cell, an unknown of the equations."""
    u, p = m.vector("u"), m.scalar("p", order=0)
    _mixed(m, u, p)
    m.fields(p=p)


@softehl.page
def condensed(m):
    """Displacements and one pressure in each cell, which is condensed."""
    _mixed(m, m.vector("u"), m.internal("p"))


@softehl.page
def taylor_hood(m):
    """Displacements and a continuous pressure of order 1."""
    _mixed(m, m.vector("u"), m.scalar("p", order=1))


@softehl.material
def split(m):
    """Principal strains: extensions are stiffer than shortenings (a kink between them)."""
    G, L = m.parameters(G="shear modulus [MPa]", L="first Lame parameter [MPa]")
    E = (m.define("C", m.F.T * m.F) - sp.eye(3)) / 2
    extensions = m.isotropic(E, lambda x: sp.Max(x, 0))
    m.energy(G * ((E * E).trace() + (extensions**2).trace()) + L / 2 * E.trace() ** 2)


@softehl.material
def plastic(m):
    """Small-strain J2 plasticity with linear hardening and radial return."""
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    names = ("xx", "yy", "xy", "yz", "xz")
    old = m.point_data(**{f"p_{n}": "plastic strain" for n in names}, alpha="plastic strain")
    xx, yy, xy, yz, xz, alpha = old
    p = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))
    q = m.define("q", sp.sqrt(sp.Rational(3, 2) * (s * s).trace()))
    excess = m.define("excess", q - sy - H * alpha)
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H), excess > 0), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), excess > 0), (0, True)))
    m.stress(K * volume * sp.eye(3) + (1 - 2 * G * flow) * s)
    new = p + flow * s
    after = [new[0, 0], new[1, 1], new[0, 1], new[1, 2], new[0, 2], alpha + dg]
    m.history(**dict(zip([*(f"p_{n}" for n in names), "alpha"], after, strict=True)))


@softehl.page(form="point")
def weight(m):
    """A force per undeformed volume."""
    u = m.vector("u")
    w = m.parameters(**{f"w_{axis}": "force per volume [N/mm^3]" for axis in "xyz"[: len(u)]})
    m.minimise(-sum(force * v for force, v in zip(w, u, strict=True)))


@softehl.page
def product(m):
    """The body by its energy, with products by sum factorisation."""
    _minimised(m)
    m.offer(product=True)


def offering(source: Any) -> Any:
    """A page with products by sum factorisation."""

    @softehl.page
    def offered(m):
        """See the page."""
        source.write(m)
        m.offer(product=True)

    return offered
