"""Lubricant film on the deformed boundary: Reynolds equation, tractions, upwinding, DG facets.

The continuous (21) and the discontinuous (22) treatment share the segment; the pressure unknowns
are joined at the nodes in the one, belong to one segment each in the other, which adds the facets.
Both take the upwinding of the bubbles' load, a term of its own: without it they are the paper's.
The boundary conditions (15) prescribe the end unknowns in both: dp vanishes there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import rheology

Vectors = list[list[sp.Symbol]]
"""Components, and for each its values at the nodes."""


def reynolds_segment(name: str = "film", law: rheology.Law = rheology.newtonian) -> Definition:
    """Film segment (14), (21), (25)-(28) with tractions (17)-(18), any pressure order.

    The solid is on the left of the segment, the rod below it; xbar = z and h = r - R_rod on the
    deformed segment.  Cavitation by the penalty (25), viscosity by (13).
    """
    m = Model(name, nodes=2, rule=quadrature.gauss(2, 1), doc=reynolds_segment.__doc__ or "")
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    p, p_xi = m.interpolated("p")
    R_rod, U, eta_0, alpha, eps, force_weight, shear_weight = m.parameters(
        rod_radius="radius of the rod [mm]",
        rod_speed="rod speed U, positive towards the air side [mm/s]",
        viscosity="viscosity at zero pressure [MPa s]",
        pressure_viscosity="coefficient alpha of (13) [1/MPa]",
        cavitation_penalty="penalty epsilon of (25) [mm/(MPa s)]",
        force_weight="factor on the nodal forces",
        shear_weight="factor on the shear traction",
    )
    flow = law(m)
    (xi,) = m.point()
    N = shapes.line2(xi)
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    z_xi, r_xi = (m.define(f"{n}_xi", (c[1] - c[0]) / 2) for n, c in zip("zr", x, strict=True))
    ds = m.define("ds", sp.sqrt(z_xi**2 + r_xi**2))
    nodal_h = nodal_thickness(m, X, u, R_rod)
    h = m.define("h", shapes.interpolate(N, nodal_h), interface=True)
    r = m.define("r", R_rod + h)
    slope = m.define("slope", p_xi / along(m, z_xi, r_xi))
    eta = m.define("eta", viscosity(eta_0, alpha, p))
    middle, driving = flow("", U, h, eta, slope)
    q = m.define("q", flux(U, h, conductance(h, eta), driving))
    couette = m.define("couette", middle)
    poiseuille = m.define("poiseuille", h / 2 * slope)
    tau = couette - poiseuille
    cavitation = m.define("cavitation", eps * sp.Max(-p, 0) * z_xi)

    ring = m.define("ring", 2 * sp.pi * force_weight * r)
    m.weak_form(
        [
            (q, p_xi),
            (cavitation, p),
            (ring * (p * r_xi - shear_weight * tau * ds), shapes.interpolate(N, u[0])),
            (-ring * p * z_xi, shapes.interpolate(N, u[1])),
        ]
    )
    m.fields(
        x=shapes.interpolate(N, x[0]),
        dx=m.weight * z_xi,
        h=h,
        p=p,
        tau=tau,
        flux=q,
        tau_rod=couette + poiseuille,
        eta=eta,
        **rheology.more_fields(slope, driving),
    )
    m.offer(pseudo_load=True, fields_rate=True)
    return m.finish()


def along(m: Model, z_xi: sp.Symbol, r_xi: sp.Symbol) -> sp.Symbol:
    """Half the length of a segment along the rod; its own where it stands upright.

    In a film it is z_xi but for the tenth power of its slope. A segment on a wall has no length
    along the rod, and beyond it a negative one: oil is to meet a resistance there, not an infinite
    one of either sign.
    """
    upright = r_xi**2 / (z_xi**2 + r_xi**2)
    return m.define("along", sp.sqrt(z_xi**2 + r_xi**2 * upright**4))


def viscosity(eta_0: Any, alpha: Any, p: Any) -> Any:
    """eta(p) of (13)."""
    return eta_0 * sp.exp(alpha * p)


def conductance(h: Any, eta: Any) -> Any:
    """Flow through the gap for a unit pressure gradient, per width."""
    return h**3 / (12 * eta)


def flux(U: Any, h: Any, conductance: Any, slope: Any) -> Any:
    """Volume flux of (14): half of what the rod drags along less what the pressure drives back."""
    return U / 2 * h - conductance * slope


def nodal_thickness(m: Model, X: Vectors, u: Vectors, R_rod: sp.Symbol) -> list[sp.Symbol]:
    """h at the nodes; the radii of undeformed ring and rod come first: h is 1e-5 of either."""
    clearance = [m.define(f"clearance_{a}", R - R_rod) for a, R in enumerate(X[1])]
    return [m.define(f"h_{a}", c + v) for a, (c, v) in enumerate(zip(clearance, u[1], strict=True))]


def bubble_load() -> Definition:
    """Upwinding of the load of the pressure bubbles, for any pressure order; none of m_p = 1.

    p_b is p less its linear interpolant between the ends of the segment. Of its radial load B, the
    integral of 2 pi r p_b n_r ds, (18) gives each node about a half; this term takes
    (c delta / 2) B from node 1 to node 2. delta = Pe^2 / (9 + Pe^2) and
    Pe = 3 eta_0 |ubar| dx^2 / (pi G h_m^3), h_m the mean of the nodal film thicknesses, compare the
    oil with the elasticity of the seal (docs/film-without-oscillations.md). Where the film widens
    downstream, behind its narrowest place, delta fades with the widening over h_m: full upwinding
    would turn the film back there.
    """
    m = Model("film_upwind", nodes=2, rule=quadrature.gauss(2, 1), doc=bubble_load.__doc__ or "")
    return bubble_model(m, lambda h: h)


def bubble_model(m: Model, effective: Callable[[Any], Any]) -> Definition:
    """`bubble_load` in a model of two nodes; effective: thickness that counts, of h_m."""
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    _, p_xi = m.interpolated("p")
    R_rod, U, eta_0, G, c, force_weight = m.parameters(
        rod_radius="radius of the rod [mm]",
        rod_speed="rod speed U, positive towards the air side [mm/s]",
        viscosity="viscosity at zero pressure [MPa s]",
        shear_modulus="shear modulus G of the seal, mu_1 + mu_2 of (3) [MPa]",
        upwinding="strength c, signed like U: the load goes downstream",
        force_weight="factor on the nodal forces",
    )
    (xi,) = m.point()
    z_xi = m.define("z_xi", (X[0][1] + u[0][1] - X[0][0] - u[0][0]) / 2)
    h = nodal_thickness(m, X, u, R_rod)
    h_m = m.define("h_m", (h[0] + h[1]) / 2)
    thickness = m.define("thickness", effective(h_m))
    peclet = m.define("peclet", U * z_xi**2 / (2 * sp.pi * G * conductance(thickness, eta_0)))
    widening = m.define("widening", (h[1] - h[0]) / (sp.Rational(1, 5) * thickness))
    weight = sp.Piecewise((1, U * widening <= 0), (1 / (1 + widening**2), True))
    delta = m.define("delta", weight * peclet**2 / (9 + peclet**2))
    # p_b vanishes at both ends: the integral of r p_b is that of -W p_b', with W' = r, and also
    # of -W p', where the integral of W is zero.
    W = m.define("W", (R_rod + h_m) * xi + (h[1] - h[0]) / 2 * (xi**2 / 2 - sp.Rational(1, 6)))
    moved = m.define("moved", sp.pi * force_weight * c * delta * z_xi)
    m.weak_form([(moved * W * p_xi, u[1][1] - u[1][0])])
    m.offer(pseudo_load=True)
    return m.finish()


def reynolds_facet() -> Definition:
    """Interior facet of the discontinuous Galerkin film (22)-(24), Baumann and Oden (1999).

    Adds + [p n] <dq> - [dp n] <q> with (24)'s dq: partial integration of (14) leaves - [dp n] <q>,
    and the other term must have the opposite sign for the diffusive parts to be skew. The paper
    prints both signs reversed, which is not consistent with its cell term: pressures then jump by
    several MPa. Node 2 is the facet; minus is the segment 1-2, plus is 2-3; n points from minus
    to plus on the minus side. h is continuous, dp/dxbar differs by each segment's own dxbar/dxi.
    """
    m = Model("film_facet", nodes=3, rule=quadrature.point_rule(), doc=reynolds_facet.__doc__ or "")
    X = m.coordinates("Z", "R")
    # of the radii only that of the facet matters
    u = m.nodal_unknowns("u_z", "u_r", idle=["u_r"])
    sides = m.interpolated_sides("p_minus", "p_plus")
    R_rod, U, eta_0, alpha = m.parameters(
        rod_radius="radius of the rod [mm]",
        rod_speed="rod speed U, positive towards the air side [mm/s]",
        viscosity="viscosity at zero pressure [MPa s]",
        pressure_viscosity="coefficient alpha of (13) [1/MPa]",
    )
    z = [a + b for a, b in zip(X[0], u[0], strict=True)]
    # Subtract the radii of the undeformed ring and rod first: h is 1e-5 of either.
    h = m.define("h", m.define("clearance", X[1][1] - R_rod) + u[1][1])
    mobilities, fluxes = [], []
    for k, (name, (p, p_xi)) in enumerate(zip(("minus", "plus"), sides, strict=True)):
        z_xi = m.define(f"z_xi_{name}", (z[k + 1] - z[k]) / 2)
        eta = m.define(f"eta_{name}", viscosity(eta_0, alpha, p))
        # dq of (24) for a unit xi-derivative of dp
        mobilities.append(m.define(f"mobility_{name}", -conductance(h, eta) / z_xi))
        fluxes.append(m.define(f"q_{name}", flux(U, h, -mobilities[k], p_xi)))
    (p_minus, p_minus_xi), (p_plus, p_plus_xi) = sides
    jump = m.define("jump", p_minus - p_plus)
    q = m.define("q", (fluxes[0] + fluxes[1]) / 2)
    m.weak_form(
        [
            (jump * mobilities[0] / 2, p_minus_xi),
            (jump * mobilities[1] / 2, p_plus_xi),
            (-q, p_minus),
            (q, p_plus),
        ]
    )
    m.fields(x=z[1], h=h, jump=jump, flux=q, flux_jump=fluxes[0] - fluxes[1])
    m.offer(pseudo_load=True, fields_rate=True)
    return m.finish()
