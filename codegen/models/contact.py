"""Unilateral contact with rigid obstacles, (9)-(10): cylinders, planes, a corner; friction."""

from __future__ import annotations

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def augmented_lagrangian() -> Definition:
    """Node against a rigid cylinder or plane, augmented Lagrangian of Alart and Curnier (1991).

    Where lambda + rho g <= 0 (contact) the potential is lambda g + rho g^2 / 2, elsewhere
    -lambda^2 / (2 rho), times the tributary area; `force_weight` scales the nodal force only.
    """
    m = Model(
        "contact",
        nodes=1,
        rule=quadrature.point_rule(),
        unroll=True,
        doc=augmented_lagrangian.__doc__ or "",
    )
    (z,), (r,) = m.coordinates("Z", "R")
    (u_z,), (u_r,) = m.nodal_unknowns("u_z", "u_r")
    lam = m.unknown("lambda")
    n_z, n_r, c, area, rho = m.data(
        n_z="normal of the obstacle, axial part",
        n_r="normal of the obstacle, radial part",
        c="position of the obstacle along its normal [mm]",
        area="reference tributary area of the node [mm^2]",
        rho="augmentation parameter [MPa/mm]",
    )
    offset, force_weight = m.parameters(
        offset="distance by which the obstacle is moved along its normal [mm]",
        force_weight="factor on the nodal force",
    )
    gap = m.define("gap", n_z * (z + u_z) + n_r * (r + u_r) - c - offset)
    augmented = m.define("trial", lam + rho * gap)
    touching = augmented <= 0
    force = m.define("force", sp.Piecewise((area * force_weight * augmented, touching), (0, True)))
    slack = m.define("slack", sp.Piecewise((area * gap, touching), (-area * lam / rho, True)))
    m.weak_form([(force * n_z, u_z), (force * n_r, u_r), (slack, lam)])
    m.offer(pseudo_load=True)
    return m.finish()


def coulomb() -> Definition:
    """Node against a rigid obstacle with Coulomb's friction, augmented Lagrangian.

    As `contact`, with the pressure p = max(0, -(lambda + rho g)) and a multiplier tau of the
    tangential stress (Alart and Curnier 1991): its trial value tau + rho (slip since the last step)
    is cut off at +- friction p. Sticking nodes do not move at all; the slip of a step is counted
    from the place in the step before, `u_z_old` and `u_r_old`.
    """
    m = Model(
        "contact_friction",
        nodes=1,
        rule=quadrature.point_rule(),
        unroll=True,
        doc=coulomb.__doc__ or "",
    )
    (z,), (r,) = m.coordinates("Z", "R")
    (u_z,), (u_r,) = m.nodal_unknowns("u_z", "u_r")
    lam, tau = m.unknown("lambda"), m.unknown("tau")
    n_z, n_r, c, area, rho = m.data(
        n_z="normal of the obstacle, axial part",
        n_r="normal of the obstacle, radial part",
        c="position of the obstacle along its normal [mm]",
        area="reference tributary area of the node [mm^2]",
        rho="augmentation parameter [MPa/mm]",
    )
    (z_old,), (r_old,) = m.nodal_data("u_z_old", "u_r_old", meaning="in the step before [mm]")
    offset, friction = m.parameters(
        offset="distance by which the obstacle is moved along its normal [mm]",
        friction="coefficient of friction",
    )
    gap = m.define("gap", n_z * (z + u_z) + n_r * (r + u_r) - c - offset)
    slip = m.define("slip", n_r * (u_z - z_old) - n_z * (u_r - r_old))
    pressure = m.define("pressure", sp.Max(-(lam + rho * gap), 0))
    limit = m.define("limit", friction * pressure)
    stress = m.define("stress", sp.Max(-limit, sp.Min(tau + rho * slip, limit)))
    force = [-pressure * n_z + stress * n_r, -pressure * n_r - stress * n_z]
    m.weak_form(
        [
            *((area * f, v) for f, v in zip(force, (u_z, u_r), strict=True)),
            (-area * (pressure + lam) / rho, lam),
            (area * (stress - tau) / rho, tau),
        ]
    )
    return m.finish()


def corner() -> Definition:
    """Node against a wall that ends at a gap, its corner rounded, without friction.

    The wall is the plane z = `wall` from the radius `lip` outwards; behind it, at that radius,
    begins a bore. Both meet in a fillet about (wall + fillet, lip + fillet). The gap is the signed
    distance: smooth where the fillet ends, and of the nearest surface inside the wall. Augmented
    Lagrangian as in `contact`; the curvature of the fillet is in the tangent.
    """
    m = Model(
        "contact_corner",
        nodes=1,
        rule=quadrature.point_rule(),
        unroll=True,
        doc=corner.__doc__ or "",
    )
    (z,), (r,) = m.coordinates("Z", "R")
    (u_z,), (u_r,) = m.nodal_unknowns("u_z", "u_r")
    lam = m.unknown("lambda")
    area, rho = m.data(
        area="reference tributary area of the node [mm^2]",
        rho="augmentation parameter [MPa/mm]",
    )
    wall, lip, fillet = m.parameters(
        wall="axial position of the wall, which faces -z [mm]",
        lip="radius of the edge of the wall [mm]",
        fillet="radius of the fillet [mm]",
    )
    # towards the body, from the centre of the fillet
    a = m.define("a", wall + fillet - (z + u_z))
    b = m.define("b", lip + fillet - (r + u_r))
    round_off = sp.Piecewise((sp.sqrt(a**2 + b**2), b > 0), (a, True))
    penetration = sp.Piecewise((b, b > 0), (sp.Max(a, b), True))
    gap = m.define(
        "gap", sp.Piecewise((round_off, a > 0), (penetration, True)) - fillet, interface=True
    )
    augmented = m.define("trial", lam + rho * gap)
    m.potential(area / (2 * rho) * (sp.Min(augmented, 0) ** 2 - lam**2))
    m.offer(pseudo_load=True)
    return m.finish()
