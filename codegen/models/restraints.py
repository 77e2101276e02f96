"""Supports of a ring that nothing else holds: mean rotation, mean axial place, a weak spring."""

from __future__ import annotations

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def mean_rotation() -> Definition:
    """Constraint on the mean rotation of the section, with the moment as its multiplier.

    Potential M / I * integral of (X x u - angle |X|^2) dA, X from the centre of the section, I
    its polar moment: the moment M [N mm per radian of rotation] is work-conjugate to `angle`.
    """
    m = Model(
        "mean_rotation",
        nodes=4,
        rule=quadrature.gauss(2, 2),
        unroll=True,
        doc=mean_rotation.__doc__ or "",
    )
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    moment = m.unknown("moment")
    centre_z, centre_r, inertia, angle = m.parameters(
        centre_z="centre of the section, axial [mm]",
        centre_r="centre of the section, radial [mm]",
        polar_moment="polar moment of the section about its centre [mm^4]",
        angle="prescribed mean rotation, from z towards r [rad]",
    )
    xi, eta = m.point()
    e = kin.quad4(m, "", X, xi, eta)
    z = m.define("z", shapes.interpolate(e.N, X[0]) - centre_z)
    r = m.define("r", shapes.interpolate(e.N, X[1]) - centre_r)
    spin = z * shapes.interpolate(e.N, u[1]) - r * shapes.interpolate(e.N, u[0])
    density = moment / inertia * e.detJ * (spin - angle * (z**2 + r**2))
    m.potential(m.integral("constraint", density))
    m.offer(pseudo_load=True)
    return m.finish()


def mean_axial() -> Definition:
    """Constraint on the mean axial displacement of the section, with the force as its multiplier.

    Potential N / A * integral of (u_z - place) dA, A the area of the section: the force N [N] is
    work-conjugate to `place`, and acts on the section with the opposite sign.
    """
    m = Model(
        "mean_axial",
        nodes=4,
        rule=quadrature.gauss(2, 2),
        unroll=True,
        doc=mean_axial.__doc__ or "",
    )
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r", idle=["u_r"])
    force = m.unknown("force")
    area, target = m.parameters(
        area="area of the section [mm^2]",
        place="prescribed mean axial displacement [mm]",
    )
    xi, eta = m.point()
    e = kin.quad4(m, "", X, xi, eta)
    density = force / area * e.detJ * (shapes.interpolate(e.N, u[0]) - target)
    m.potential(m.integral("constraint", density))
    m.offer(pseudo_load=True)
    return m.finish()


def axial_spring() -> Definition:
    """Elastic bedding against axial motion: potential stiffness / 2 * integral of u_z^2 dA."""
    m = Model(
        "axial_spring",
        nodes=4,
        rule=quadrature.gauss(2, 2),
        unroll=True,
        doc=axial_spring.__doc__ or "",
    )
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r", idle=["u_r"])
    (stiffness,) = m.parameters(stiffness="bedding stiffness [N/mm^3]")
    xi, eta = m.point()
    e = kin.quad4(m, "", X, xi, eta)
    u_z = m.define("u_z", shapes.interpolate(e.N, u[0]), interface=True)
    m.potential(m.integral("bedding", stiffness / 2 * e.detJ * u_z**2))
    return m.finish()
