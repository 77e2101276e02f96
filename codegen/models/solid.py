"""Axisymmetric 4-node hyperelastic solids, energy (3)-(6): plain, F-bar, two Taylor-expanded.

Units mm, MPa, N; nodes counterclockwise in (z, r); unknowns u_z1, u_r1, ..., u_z4, u_r4.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import energies
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

Terms = tuple[energies.Energy, energies.Energy]
"""Isochoric and volumetric term of an energy."""
PAPER = (energies.MOONEY_RIVLIN, energies.VOLUMETRIC)


def _element(name: str, doc: str, terms: Terms, unroll: bool = True) -> tuple[Model, Any, Any, Any]:
    """Arguments that the solids share: coordinates, displacements, terms of the energy."""
    m = Model(name, nodes=4, rule=quadrature.gauss(2, 2), unroll=unroll, doc=doc)
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    m.offer(pseudo_load=True)
    return m, X, u, [term.declared(m) for term in terms]


def _energy(m: Model, label: str, F: kin.Gradient, material: Any) -> Any:
    """W(F) of (3)."""
    isochoric, volumetric = material
    *bars, I3 = kin.invariants(m, label, F)
    return _isochoric(m, label, F, isochoric, bars) + volumetric(I3)


def _isochoric(m: Model, label: str, F: kin.Gradient, term: energies.EnergyTerm, bars: Any) -> Any:
    """The isochoric term; bars: I1bar and I2bar."""
    if term.of == "invariants":
        I1bar, I2bar = bars
        return term(I1bar, I2bar)
    return m.principal(f"isochoric{label}", kin.isochoric_right_cauchy_green(m, label, F), term)


def _fields(m: Model, X: Any, u: Any, N: Any, F: kin.Gradient, material: Any) -> None:
    """Deformed position, volume ratio and Cauchy stress at the quadrature points."""
    z, r = (shapes.interpolate(N, [a + b for a, b in zip(X[c], u[c], strict=True)]) for c in (0, 1))
    J, zz, rr, tt, zr = kin.cauchy(m, lambda F: _energy(m, "_of_stress", F, material), F)
    m.fields(z=z, r=r, J=J, sigma_zz=zz, sigma_rr=rr, sigma_tt=tt, sigma_zr=zr)


def plain(name: str = "solid_q4", terms: Terms = PAPER) -> Definition:
    """Displacement element, 2x2 points: Pi = integral of W(F) 2 pi R dA, (1)-(6)."""
    m, X, u, material = _element(name, plain.__doc__ or "", terms)
    xi, eta = m.point()
    e = kin.quad4(m, "", X, xi, eta)
    F = kin.gradient(m, "", e.dN, [n / e.R for n in e.N], u)
    m.potential(m.integral("Pi", 2 * sp.pi * e.R * e.detJ * _energy(m, "", F, material)))
    _fields(m, X, u, e.N, F, material)
    return m.finish()


def fbar(name: str = "solid_fbar", terms: Terms = PAPER) -> Definition:
    """F-bar element of de Souza Neto et al. (1996): Fbar = a F, a = (J0/J)^(1/3), J0 at centroid.

    P_eff = (J/J0)^(2/3) P(Fbar) is the derivative of the pseudo-potential W(a F) / a^3 with a
    frozen; the tangent differentiates a as well and is exact and unsymmetric.
    """
    m, X, u, material = _element(name, fbar.__doc__ or "", terms)
    xi, eta = m.point()
    e = kin.quad4(m, "", X, xi, eta)
    centre = kin.quad4(m, "0", X, sp.Integer(0), sp.Integer(0))
    F = kin.gradient(m, "", e.dN, [n / e.R for n in e.N], u)
    F0 = kin.gradient(m, "0", centre.dN, [n / centre.R for n in centre.N], u)
    J, J0 = m.define("J", F.J), m.define("J0", F0.J)
    a = m.define("a", (J0 / J) ** sp.Rational(1, 3))
    Fbar = F.scaled(a)
    W = _energy(m, "bar", Fbar, material)
    m.potential(m.integral("Pi", 2 * sp.pi * e.R * e.detJ * W / a**3), constant=[a])
    _fields(m, X, u, e.N, Fbar, material)
    return m.finish()


def taylor(name: str = "solid_taylor", terms: Terms = PAPER) -> Definition:
    """Under-integrated element with Taylor-expanded gradients, after Korelc and Wriggers (1997).

    The gradients of the shape functions are expanded about the centre to first order in xi and
    eta (N_a in the hoop term likewise, over the exact radius), and integrated with the Jacobian
    of the centre: their mean is then that of the exact ones, as the patch test asks.
    The isochoric energy is taken at the 2x2 points, the volumetric one at the centre only.
    """
    m, X, u, material = _element(name, taylor.__doc__ or "", terms)
    xi, eta = m.point()
    centre = kin.quad4(m, "0", X, sp.Integer(0), sp.Integer(0))
    R = m.define("R", shapes.interpolate(shapes.quad4(xi, eta), X[1]))
    dN, N = _expanded(m, X, centre, xi, eta)
    F = kin.gradient(m, "", dN, [n / R for n in N], u)
    F0 = kin.gradient(m, "0", centre.dN, [n / centre.R for n in centre.N], u)
    isochoric, volumetric = material
    *bars, _ = kin.invariants(m, "", F)
    ring = 2 * sp.pi * R * centre.detJ
    volume = 8 * sp.pi * centre.R * centre.detJ
    m.potential(
        m.integral("shear", ring * _isochoric(m, "", F, isochoric, bars))
        + volume * volumetric(m.define("I3_0", F0.J**2))
    )
    # The stress combines the point's isochoric part with the centre's volume ratio.
    shared = F.scaled(m.define("to_J0", (F0.J / F.J) ** sp.Rational(1, 3)))
    _fields(m, X, u, shapes.quad4(xi, eta), shared, material)
    return m.finish()


def _expanded(m: Model, X: Any, centre: kin.Quad4, xi: Any, eta: Any) -> tuple[Any, Any]:
    """First-order expansions about the centre of (dN_a/dZ, dN_a/dR) and of N_a."""
    signs = [a * b for a, b in shapes.QUAD_NODES]
    h = [m.define(f"h_{c}", shapes.interpolate(signs, X[c]) / 4) for c in (0, 1)]
    x0, d0 = centre.dX, centre.detJ
    # J(xi, eta) = [x_xi + eta h, x_eta + xi h]; d1, d2 are the derivatives of its determinant.
    d1 = m.define("d_xi", (x0[0][0] * h[1] - x0[1][0] * h[0]) / d0)
    d2 = m.define("d_eta", (h[0] * x0[1][1] - h[1] * x0[0][1]) / d0)
    dN, N = [], []
    for a, (p, q) in enumerate(shapes.QUAD_NODES):
        gz, gr = centre.dN[a]
        slope = sp.Rational(p * q, 4)
        z1 = m.define(f"dN_{a}z_xi", (sp.Rational(p, 4) * h[1] - slope * x0[1][0]) / d0 - gz * d1)
        z2 = m.define(f"dN_{a}z_eta", (slope * x0[1][1] - sp.Rational(q, 4) * h[1]) / d0 - gz * d2)
        r1 = m.define(f"dN_{a}r_xi", (slope * x0[0][0] - sp.Rational(p, 4) * h[0]) / d0 - gr * d1)
        r2 = m.define(f"dN_{a}r_eta", (sp.Rational(q, 4) * h[0] - slope * x0[0][1]) / d0 - gr * d2)
        dN.append(
            (
                m.define(f"dN_{a}z", gz + xi * z1 + eta * z2),
                m.define(f"dN_{a}r", gr + xi * r1 + eta * r2),
            )
        )
        N.append(m.define(f"N_{a}", (1 + p * xi + q * eta) / 4))
    return dN, N


def taylor_mean(
    name: str = "solid_taylor_mean", terms: Terms = PAPER, unroll: bool = True
) -> Definition:
    """Taylor-expanded element that passes the patch test on every quadrilateral.

    With a_0, b_a and gamma_a of the centre, u = a_0 + (b . u) X + (gamma . u) xi eta, so that dN_a
    is b_a + gamma_a grad(xi eta). As `solid_taylor` this takes grad(xi eta) and N_a / R to first
    order in xi and eta, but their zeroth terms are the exact means over the element, weighted with
    the radius (after Korelc and Wriggers 1997), the first-order ones have zero mean, and the
    weights are the true ones. Forces of a constant stress are then exact, and so is a homogeneous
    strain at every point.
    The isochoric energy is taken at the 2x2 points, the volumetric one of the mean gradient.
    """
    m, X, u, material = _element(name, taylor_mean.__doc__ or "", terms, unroll)
    e = kin.quad4(m, "", X, *m.point())
    ring = m.define("ring", e.R * e.detJ)
    volume = m.integral("volume", ring)
    (dN0, hoop0), (dN, hoop) = _about_mean(m, X, e, (ring, volume))
    F = kin.gradient(m, "", dN, hoop, u)
    F0 = kin.gradient(m, "0", dN0, hoop0, u)
    isochoric, volumetric = material
    *bars, _ = kin.invariants(m, "", F)
    energy = m.integral("shear", ring * _isochoric(m, "", F, isochoric, bars))
    m.potential(2 * sp.pi * (energy + volume * volumetric(m.define("I3_0", F0.J**2))))
    # The stress combines the point's isochoric part with the mean volume ratio.
    shared = F.scaled(m.define("to_J0", (F0.J / F.J) ** sp.Rational(1, 3)))
    _fields(m, X, u, e.N, shared, material)
    return m.finish()


def _about_mean(m: Model, X: Any, e: kin.Quad4, weights: tuple[Any, Any]) -> Any:
    """dN_a and N_a / R: their means over the element, and with the first-order terms at the point.

    weights: R detJ at the point, and its integral.
    """
    (ring, volume), (xi, eta) = weights, m.point()
    centre = kin.quad4(m, "0", X, sp.Integer(0), sp.Integer(0))

    def mean(label: str, weighted: Any) -> Any:
        return m.define(f"mean_{label}", m.integral(f"sum_{label}", weighted) / volume)

    def both(label: str, weighted: Any, first: Any) -> tuple[Any, Any]:
        at_mean = mean(label, weighted)
        return at_mean, m.define(label, at_mean + first)

    s, t = m.define("s", xi - mean("xi", ring * xi)), m.define("t", eta - mean("eta", ring * eta))
    bulge = []  # grad(xi eta)
    for c, local, central in zip("zr", _parent_slopes(e), _parent_slopes(centre), strict=True):
        first = (t * central[0] + s * central[1]) / centre.detJ
        bulge.append(both(f"bulge_{c}", e.R * (eta * local[0] + xi * local[1]), first))
    # N_a / R = (1 + p xi + q eta + p q xi eta) / (4 R); the last term has no mean
    (R_xi, R_eta), scale = centre.dX[1], 1 / (4 * centre.R)
    hoop = [
        both(f"hoop_{n}", e.detJ * x / 4, first * scale)
        for n, x, first in (
            ("1", 1, -(s * R_xi + t * R_eta) / centre.R),
            ("xi", xi, s),
            ("eta", eta, t),
        )
    ]
    return [
        _with_bulge(m, X, centre.dN, label, [g[k] for g in bulge], [h[k] for h in hoop])
        for k, label in enumerate(("_mean", "_point"))
    ]


def _parent_slopes(e: kin.Quad4) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """detJ times the derivatives of xi and eta by Z, and by R."""
    (z_xi, z_eta), (r_xi, r_eta) = e.dX
    return (r_eta, -r_xi), (-z_eta, z_xi)


def _with_bulge(m: Model, X: Any, b: Any, label: str, bulge: Any, hoop: Any) -> tuple[Any, Any]:
    """b_a + gamma_a grad(xi eta), and the hoop terms from those of 1, xi, eta."""
    signs = [p * q for p, q in shapes.QUAD_NODES]
    h_z, h_r = (shapes.interpolate(signs, x) for x in X)
    dN, N = [], []
    for a, (p, q) in enumerate(shapes.QUAD_NODES):
        gamma = (p * q - h_z * b[a][0] - h_r * b[a][1]) / 4
        terms = zip("zr", b[a], bulge, strict=True)
        dN.append([m.define(f"dN{label}_{a}{c}", g + gamma * k) for c, g, k in terms])
        N.append(m.define(f"hoop{label}_{a}", hoop[0] + p * hoop[1] + q * hoop[2]))
    return dN, N
