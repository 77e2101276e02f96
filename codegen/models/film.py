"""Lubricant film on a segment of the deformed boundary: Reynolds equation and its tractions."""

from __future__ import annotations

import sympy as sp

from codegen import quadrature, shapes
from codegen.model import Definition, Model


def reynolds_segment() -> Definition:
    """Continuous film segment (14), (21), (25)-(28) with tractions (17)-(18), any pressure order.

    The solid is on the left of the segment, the rod below it; xbar = z and h = r - R_rod on the
    deformed segment.  Cavitation by the penalty (25), viscosity by (13).
    """
    m = Model("film", nodes=2, rule=quadrature.gauss(2, 1), doc=reynolds_segment.__doc__ or "")
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
    (xi,) = m.point()
    N = shapes.line2(xi)
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    z_xi, r_xi = (m.define(f"{n}_xi", (c[1] - c[0]) / 2) for n, c in zip("zr", x, strict=True))
    ds = m.define("ds", sp.sqrt(z_xi**2 + r_xi**2))
    # Subtract the radii of the undeformed ring and rod first: h is 1e-5 of either.
    clearance = [m.define(f"clearance_{a}", R - R_rod) for a, R in enumerate(X[1])]
    nodal_h = [
        m.define(f"h_{a}", c + v) for a, (c, v) in enumerate(zip(clearance, u[1], strict=True))
    ]
    h = m.define("h", shapes.interpolate(N, nodal_h), waist=True)
    r = m.define("r", R_rod + h)
    slope = m.define("slope", p_xi / z_xi)
    eta = m.define("eta", eta_0 * sp.exp(alpha * p))
    q = m.define("q", U / 2 * h - h**3 / (12 * eta) * slope)
    couette = m.define("couette", eta * U / h)
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
    )
    return m.finish()
