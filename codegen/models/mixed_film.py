"""Films that rupture, move and touch: void fraction, squeeze, roughness (docs/film-physics.md).

Unknowns of a segment are displacements, pressures, and void fractions v = 1 - theta where the
pressures stand. The flux between neighbours is that of a wedge, exactly: on a subcell from one
to the other the oil has the pressure `p_cell`, linear in between, and comes with the void fraction
`v_out` of the one end at outstroke, `v_in` of the other at instroke. The film bears `p`, the
polynomial through the pressures. A table of shape functions says so. The smooth pages are the
limit of the rough ones without roughness.

Rough surfaces: functions of H = h / sigma, sigma the rms height of both together. Flow factors of
Patir and Cheng (1978, 1979) for isotropic Gaussian heights, the pressure of asperities of Greenwood
and Williamson (1966), and the mean gap where surfaces interpenetrate. Flow factors take the
effective thickness over sigma, which is positive however far that is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import rheology
from softehl.codegen.models.film import (
    bubble_model,
    conductance,
    flux,
    nodal_thickness,
    viscosity,
)

R = sp.Rational
_JOINT = 5
"""H at which the published fits of the shear flow factors end."""


def effective(H: Any) -> Any:
    """Effective thickness over sigma: H from 1/2 on, positive and once differentiable below."""
    return sp.Piecewise((H, R(1, 2) <= H), (1 / (4 - 4 * H), True))


def mean_gap(H: Any) -> Any:
    """Mean gap h_T / sigma where heights that interpenetrate leave none."""
    return H * (1 - sp.erfc(H / sp.sqrt(2)) / 2) + sp.exp(-(H**2) / 2) / sp.sqrt(2 * sp.pi)


def asperities(H: Any) -> Any:
    """Greenwood's F_3/2(H), the mean of max(s - H, 0)^(3/2) over a normal variable s.

    With s = H + y^2 the integrand is even and smooth in y, y^4 exp(-(H + y^2)^2 / 2), for which the
    trapezoidal rule converges exponentially: steps of 1/6 up to 3.5 leave 1e-14 for H > -3.
    """
    step = R(1, 6)
    squares = [(k * step) ** 2 for k in range(1, 22)]
    total = sum(s**2 * sp.exp(-((H + s) ** 2) / 2) for s in squares)
    return 2 * step * total / sp.sqrt(2 * sp.pi)


def pressure_flow(H: Any) -> Any:
    """Factor phi_p of the pressure flow."""
    return 1 - R(9, 10) * sp.exp(-R(14, 25) * H)


def shear_flow(H: Any) -> Any:
    """Factor Phi_s of the flow that a rough surface carries along in its valleys."""
    inner = _shear_flow_fit(H)
    outer = _shear_flow_fit(sp.Integer(_JOINT)) * sp.exp(-(H - _JOINT) / 4)
    return sp.Piecewise((inner, H <= _JOINT), (outer, True))


def _shear_flow_fit(H: Any) -> Any:
    return R(1899, 1000) * H ** R(49, 50) * sp.exp(-R(23, 25) * H + H**2 / 20)


def shear_stress(H: Any) -> Any:
    """Factor phi_f of the mean of eta U / h, for heights up to 3 sigma; asperities from 0.01 on."""
    z = H / 3
    cubic = (1 - z**2) ** 3
    close_form = cubic * sp.log((z + 1) / (z - 1)) + z / 15 * (66 + z**2 * (30 * z**2 - 80))
    tail = z * (132 + z * (345 + z * (-160 + z * (-405 + z * (60 + 147 * z)))))
    mixed = cubic * sp.log(300 * (z + 1)) + R(1, 60) * (-55 + tail)
    factor = R(35, 32) * z
    return sp.Piecewise((_far(z), z >= 2), (factor * close_form, z > 1), (factor * mixed, True))


def _far(z: Any) -> Any:
    """phi_f by the moments of the heights, where its closed form has lost its digits."""
    moments = [sp.Integer(1)]
    for k in range(1, 20):
        moments.append(moments[-1] * R(2 * k - 1, 2 * k + 7))
    inverse, value = 1 / z**2, sp.Integer(0)
    for moment in reversed(moments):
        value = moment + inverse * value
    return value


def shear_difference(H: Any) -> Any:
    """Factor phi_fs: what the roughness of one surface adds to phi_f."""
    outer = _shear_difference_fit(sp.Integer(_JOINT)) * sp.exp(-R(409, 500) * (H - _JOINT))
    return sp.Piecewise((_shear_difference_fit(H), H <= _JOINT), (outer, True))


def _shear_difference_fit(H: Any) -> Any:
    return R(111, 10) * H ** R(231, 100) * sp.exp(-R(119, 50) * H + R(11, 100) * H**2)


def pressure_stress(H: Any) -> Any:
    """Factor phi_fp of the shear stress that the pressure gradient causes."""
    return 1 - R(7, 5) * sp.exp(-R(33, 50) * H)


@dataclass(frozen=True)
class RoughSurfaces:
    """Effective thicknesses and factors of surfaces with a gap h, by (14) and (17).

    effective: thickness of flow and shear; content: mean gap; carried: thickness that a rod of
    unit mean speed carries along; effective_of: the first of them for another h; pressure_flow,
    couette, poiseuille: factors; asperities: their pressure over the stiffness.
    """

    effective: Any
    content: Any
    carried: Any
    effective_of: Callable[[Any], Any]
    pressure_flow: Any = 1
    couette: Any = 1
    poiseuille: Any = 1
    asperities: Any = 0

    @classmethod
    def smooth(cls, h: Any) -> RoughSurfaces:
        """Without roughness."""
        return cls(h, h, h, lambda other: other)

    @classmethod
    def rough(cls, m: Model, h: Any, sigma: Any, c: Any) -> RoughSurfaces:
        """Heights of rms sigma; c = (rod^2 - seal^2) / sigma^2 says on which surface they are."""
        H = m.define("H", h / sigma, interface=True)
        He = m.define("H_effective", effective(H), interface=True)
        gap = m.define("mean_gap", mean_gap(H))
        return cls(
            effective=m.define("h_effective", sigma * He),
            content=m.define("h_T", sigma * gap),
            carried=m.define("h_carried", sigma * (gap + c * shear_flow(He))),
            effective_of=lambda other: sigma * effective(other / sigma),
            pressure_flow=pressure_flow(He),
            couette=shear_stress(He) + c * shear_difference(He),
            poiseuille=pressure_stress(He),
            asperities=asperities(H),
        )


def conserving_segment(
    name: str = "film_conserving", law: rheology.Law = rheology.newtonian
) -> Definition:
    """Film segment that conserves mass where it ruptures, between smooth surfaces.

    As the page film, but for the void fraction in what the rod carries along, for any basis of
    pressure and void fraction, and for the axial speed w of the seal's surface: (14) with U - w.
    """
    return _segment(name, conserving_segment.__doc__ or "", law, rough=False)


def rough_segment() -> Definition:
    """Film segment between rough surfaces: flow factors, asperities, boundary friction.

    Asperities carry K F_3/2(h / sigma) and resist sliding by mu_b times that, regularised at the
    speed U_b. With the void fraction and the speed of the surface of conserving_segment.
    """
    return _segment("film_rough", rough_segment.__doc__ or "", rheology.newtonian, rough=True)


def _segment(name: str, doc: str, law: rheology.Law, *, rough: bool) -> Definition:
    m = Model(name, nodes=2, rule=_one_subcell(), doc=doc)
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    sides = m.interpolated_sides("p", "p_cell", "v_out", "v_in")
    (p, p_xi), (p_cell, p_cell_xi), (v_out, _), (v_in, _) = sides
    R_rod, U, eta_0, alpha, force_weight, shear_weight = m.parameters(
        rod_radius="radius of the rod [mm]",
        rod_speed="rod speed U, positive towards the air side [mm/s]",
        viscosity="viscosity at zero pressure [MPa s]",
        pressure_viscosity="coefficient alpha of (13) [1/MPa]",
        force_weight="factor on the nodal forces",
        shear_weight="factor on the shear traction",
    )
    flow = law(m)
    xi, *bounds = m.point()
    N = shapes.line2(xi)
    (w_nodes,) = m.rates("u_z")
    w = m.define("w", shapes.interpolate(N, w_nodes))
    z, nodal_h = [a + b for a, b in zip(X[0], u[0], strict=True)], nodal_thickness(m, X, u, R_rod)
    z_xi = m.define("z_xi", (z[1] - z[0]) / 2)
    r_xi = m.define("r_xi", (nodal_h[1] - nodal_h[0]) / 2)
    ds = m.define("ds", sp.sqrt(z_xi**2 + r_xi**2))
    h = m.define("h", shapes.interpolate(N, nodal_h), interface=True)
    V = m.define("V", U - w)
    surfaces, p_a, tau_a = _surfaces(m, h, V, rough)
    at_ends = [shapes.interpolate(shapes.line2(end), nodal_h) for end in bounds]
    mean, narrowing = _wedge(m, [surfaces.effective_of(h_end) for h_end in at_ends])
    slope = m.define("slope", p_xi / z_xi)

    def dragged(value: Any) -> Any:
        return sp.Max(value, 0) * (1 - v_out) + sp.Min(value, 0) * (1 - v_in)

    filled = m.define("filled", dragged(V))
    eta_cell = m.define("eta_cell", viscosity(eta_0, alpha, p_cell))
    pressed = surfaces.pressure_flow * narrowing**2 * conductance(mean, eta_cell)
    _, driving_cell = flow("_cell", V, mean, eta_cell, p_cell_xi / z_xi)
    q = m.define("q", flux(filled, narrowing * surfaces.carried, pressed, driving_cell))
    oil = m.define("oil", viscosity(eta_0, alpha, p))
    middle, driving = flow(
        "", V, surfaces.effective, oil, slope, lambda v: filled if v == V else dragged(v)
    )
    couette = m.define("couette", middle * surfaces.couette)
    poiseuille = m.define("poiseuille", surfaces.poiseuille * surfaces.effective / 2 * slope)
    tau = couette + tau_a - poiseuille
    load = p + p_a

    ring = m.define("ring", 2 * sp.pi * force_weight * (R_rod + h))
    m.weak_form(
        [
            (q, p_cell_xi),
            (ring * (load * r_xi - shear_weight * tau * ds), shapes.interpolate(N, u[0])),
            (-ring * load * z_xi, shapes.interpolate(N, u[1])),
        ]
    )
    m.fields(
        x=shapes.interpolate(N, z),
        dx=m.weight * z_xi,
        h=h,
        p=p,
        tau=tau,
        flux=q,
        tau_rod=couette + tau_a + poiseuille,
        eta=oil,
        h_T=surfaces.content,
        p_a=p_a,
        tau_a=tau_a,
        v_out=v_out,
        v_in=v_in,
        **rheology.more_fields(slope, driving),
    )
    m.offer(pseudo_load=True, fields_rate=True)
    return m.finish()


def _one_subcell() -> QuadratureRule:
    """Two Gauss points with the bounds of their subcell, here those of the segment."""
    line = quadrature.gauss(2, 1)
    bounds = -sp.Integer(1), sp.Integer(1)
    return QuadratureRule(3, tuple((*point, *bounds) for point in line.points), line.weights)


def _wedge(m: Model, bounds: list[Any]) -> tuple[Any, Any]:
    """Mean of the thicknesses h_1, h_2 at the ends of a subcell, and h_1 h_2 over its square.

    A flux that is the same all along a wedge asks for the mean of U/2 h^-2 - q h^-3, which are
    1 / (h_1 h_2) and mean / (h_1 h_2)^2.
    """
    h_1, h_2 = (m.define(f"h_cell_{k}", h) for k, h in enumerate(bounds, start=1))
    mean = m.define("h_cell", (h_1 + h_2) / 2)
    return mean, m.define("narrowing", h_1 * h_2 / mean**2)


def _surfaces(m: Model, h: Any, V: Any, rough: bool) -> tuple[RoughSurfaces, Any, Any]:
    """The surfaces, the pressure of their asperities, and its friction."""
    if not rough:
        return RoughSurfaces.smooth(h), sp.Integer(0), sp.Integer(0)
    sigma, c, K, mu_b, U_b = m.parameters(
        roughness="rms height sigma of both surfaces together [mm]",
        roughness_difference="(rod^2 - seal^2) / sigma^2 of the rms heights",
        asperity_stiffness="pressure K of asperities where their F_3/2 is one [MPa]",
        boundary_friction="friction coefficient of touching asperities",
        boundary_speed="speed U_b at which their friction has 0.7 of its value [mm/s]",
    )
    surfaces = RoughSurfaces.rough(m, h, sigma, c)
    p_a = m.define("p_a", K * surfaces.asperities)
    tau_a = m.define("tau_a", mu_b * p_a * V / sp.sqrt(V**2 + U_b**2))
    return surfaces, p_a, tau_a


def void_fraction() -> Definition:
    """Either the film is full or it has the cavitation pressure: Fischer and Burmeister.

    With a = (p - p_c) / p_ref and b = v / v_ref the row of v is a + b - sqrt(a^2 + b^2) = 0, which
    holds where one is zero and the other is not negative.
    """
    rule = quadrature.point_rule()
    m = Model("film_void", nodes=1, rule=rule, unroll=True, doc=void_fraction.__doc__ or "")
    p, v = m.unknown("p"), m.unknown("v")
    p_c, p_ref, v_ref = m.parameters(
        cavitation_pressure="pressure p_c of the ruptured film [MPa]",
        pressure_scale="pressure p_ref that counts as much as v_ref [MPa]",
        void_scale="void fraction v_ref",
    )
    a, b = m.define("a", (p - p_c) / p_ref), m.define("b", v / v_ref)
    tiny = sp.Rational(1, 10**30)
    root = m.define("root", sp.sqrt(a**2 + b**2 + tiny))
    # a + b - root loses all digits where a >> b > 0. `tiny` is left out in the other form of it:
    # the optimiser would know the two for the same value and keep one.
    large = 2 * a * b / (a + b + root)
    row = m.define("row", sp.Piecewise((large, a + b > 0), (a + b - root, True)))
    m.weak_form([(row, v)])
    m.offer(pseudo_load=True)
    return m.finish()


def squeeze() -> Definition:
    """What the film holds between smooth surfaces changes with time.

    d/dt [h (1 - v) dz], where the pressures stand (weights are lengths of halves of subcells): the
    rate of the content is `rate` times it and `content_rate`, of the steps before.
    """
    return _squeeze("film_squeeze", squeeze.__doc__ or "", rough=False)


def rough_squeeze() -> Definition:
    """What the film holds between rough surfaces changes with time: squeeze, with h_T for h."""
    return _squeeze("film_squeeze_rough", rough_squeeze.__doc__ or "", rough=True)


def _squeeze(name: str, doc: str, *, rough: bool) -> Definition:
    m = Model(name, nodes=2, rule=quadrature.gauss(2, 1), doc=doc)
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    (p, _), (v, _) = m.interpolated_sides("p", "v")
    R_rod, rate = m.parameters(
        rod_radius="radius of the rod [mm]", rate="coefficient of the time derivative [1/s]"
    )
    (content_rate,) = m.point_data(
        content_rate="content of the steps before, times theirs [mm^2/s]"
    )
    (xi,) = m.point()
    N = shapes.line2(xi)
    z_xi = m.define("z_xi", (X[0][1] + u[0][1] - X[0][0] - u[0][0]) / 2)
    h = m.define("h", shapes.interpolate(N, nodal_thickness(m, X, u, R_rod)), interface=True)
    h_T = h
    if rough:
        (sigma,) = m.parameters(roughness="rms height sigma of both surfaces together [mm]")
        H = m.define("H", h / sigma, interface=True)
        h_T = m.define("h_T", sigma * mean_gap(H))
    content = m.define("content", h_T * (1 - v) * z_xi)
    m.weak_form([(-(rate * content + content_rate), p)])
    m.fields(content=content, dx=m.weight * z_xi, v=v, h_T=h_T)
    return m.finish()


def rough_bubble_load() -> Definition:
    """Upwinding of the load of the pressure bubbles by the effective thickness of a rough film."""
    doc = rough_bubble_load.__doc__ or ""
    m = Model("film_upwind_rough", nodes=2, rule=quadrature.gauss(2, 1), doc=doc)
    (sigma,) = m.parameters(roughness="rms height sigma of both surfaces together [mm]")
    return bubble_model(m, lambda h: sigma * effective(h / sigma))
