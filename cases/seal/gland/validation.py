"""Validation of the parameters of a seal: contradictions between keys."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.seal.gland.catalogue import ring_for
from softehl.cases.seal.gland.records import Discretisation, Gland, Solid
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections.section_keys import is_mesh
from softehl.cases.seal.gland.sensitivity_keys import ROOM
from softehl.cases.seal.gland.tolerances import read_tolerances

if TYPE_CHECKING:
    from softehl.cases.seal.gland.parameters import Seal

_MOST = 6.0
"""Largest p_s / mu of a film that must be computed: runs above it take minutes."""


def require_consistent(p: Seal) -> None:
    """ValueError for the first contradiction: what was given, what is allowed, what to do."""
    for check in _CHECKS:
        check(p)


def _mesh_is_there(p: Solid) -> None:
    if p.mesh != "file":
        return
    if not is_mesh(p.outline):
        raise ValueError(
            'mesh = "file" takes the mesh of a file: give outline = "seal.msh" too, or leave '
            "mesh out"
        )
    if p.cap_thickness is not None:
        raise ValueError("cap_thickness: the mesh of a file has its own regions; leave it out")
    regions = p.file_mesh.regions
    cells = [n for name in p.materials for n in regions.get(name, np.empty(0)).tolist()]
    if len(cells) > len(set(cells)):
        names = " and ".join(p.materials)
        raise ValueError(f"materials: {names} have elements in common; an element has one")


def _rubber_has_an_element(p: Solid) -> None:
    rubbers: tuple[Rubber, ...] = (p, *p.materials.values())
    for rubber in rubbers:
        if p.solid != "taylor_mean" and rubber.energy != "mooney_rivlin":
            raise ValueError(
                f'material = "{rubber.material}" and solid = "{p.solid}": other elements '
                'than "taylor_mean" have "mooney-rivlin" and "neo-hooke" alone; leave solid out'
            )


def _sensitivity_has_a_meaning(p: Seal) -> None:
    read_tolerances(p)
    if p.tolerances and not p.sensitivity:
        raise ValueError(
            "tolerances need the sensitivities of the run; set sensitivity = true (--sensitivity)"
        )
    if p.sensitivity and p.rubs:
        raise ValueError(
            f"sensitivity = true with housing_friction = {p.housing_friction:g}: with "
            "friction a state depends on how it was reached, and has no derivative by its "
            "parameters alone; set housing_friction = 0"
        )


def _discretisation_is_rich_enough(p: Discretisation) -> None:
    points, order = p.quadrature_points, p.pressure_order
    if points is not None and points < order:
        raise ValueError(
            f"quadrature_points = {points} cannot hold {order + 1} pressures of a segment "
            f"(pressure_order = {order}); give at least {order}, or leave it out"
        )
    if p.tolerance is not None and not (p.error_estimate and p.mesh == "graded"):
        raise ValueError(
            f"tolerance = {p.tolerance:g} needs an estimate of the error; "
            'set error_estimate = true and mesh = "graded"'
        )
    if p.tolerance is not None and order < 3:  # the error is not well below what meshes differ by
        raise ValueError(
            f"tolerance = {p.tolerance:g}: meshes do not show the error of pressure_order = "
            f"{order}; use an order of at least 3"
        )


def _film_has_its_model(p: Seal) -> None:
    asks = {"roughness": p.rough, "cavitation_pressure": p.cavitation_pressure < 0.0}
    p.require_model(conserving=p.conserving, dg=p.reynolds == "dg", asks=asks)
    if (p.arc_start is None) != (p.arc_end is None):
        raise ValueError("arc_start and arc_end: give both, or none to have them found")


def _heating_has_its_oil(p: Seal) -> None:
    if not p.heating:
        return
    if p.sensitivity:
        raise ValueError(
            "heating = true with sensitivity = true: sensitivities are those of a film of one "
            "temperature; leave one of them out"
        )
    if p.viscosity_slope is None:
        raise ValueError(
            "heating = true needs the viscosity of the oil over temperature: give an oil and its "
            'temperature, as in oil = "ISO VG 46" and temperature = "40 degC", or viscosity_slope'
        )


def _air_side_is_closed_or_open(p: Gland) -> None:
    gap, depth = p.extrusion_gap, p.depth
    if p.backup and gap:
        raise ValueError(
            f"backup = true and extrusion_gap = {gap:g} contradict each other: a back-up ring "
            "closes the gap; leave one of them out"
        )
    if p.backup is False and not gap:
        raise ValueError(
            "backup = false leaves a gap whose width is not given: add extrusion_gap, 0.02 to "
            "0.1 mm is usual, or leave backup out"
        )
    if gap and gap + p.corner_fillet > 0.5 * depth:
        raise ValueError(
            f"extrusion_gap = {gap:g} and corner_fillet = {p.corner_fillet:g} mm leave too "
            f"little of a wall that is {depth:g} mm high; both together at most half of it"
        )
    if gap and p.rubs:
        raise ValueError(
            f"extrusion_gap = {gap:g} and housing_friction = {p.housing_friction:g}: the "
            "edge of the gap has no friction; give one of them"
        )


def _section_is_one(p: Seal) -> None:
    _ = p.sizes
    if p.round:
        if p.materials:
            raise ValueError(
                'materials and cap_thickness: not for section = "round"; leave them out'
            )
        return
    _ = p.free_section
    has = ", ".join(p.regions) or "no regions; cap_thickness makes one"
    for name in p.materials:
        if name not in p.regions:
            raise ValueError(f"materials.{name}: the section has {has}")
    if p.arc_start is not None or p.opens:
        name = "extrusion_gap" if p.arc_start is None else "arc_start and arc_end"
        raise ValueError(f'{name}: for section = "round" only; leave it out')
    if p.sensitivity and (p.outline is not None or p.cap_thickness is not None):
        raise ValueError(
            "sensitivity = true: not of an outline of a file, which has no dimensions, and not "
            "of a section with a cap; leave it out"
        )
    if p.sensitivity:
        _require_free_dimensions(p)


def _require_free_dimensions(p: Seal) -> None:
    """Raise ValueError where a dimension of the section is at its limit, and has no derivative."""
    for name, value in {"section_diameter": p.section_diameter, **p.measures}.items():
        for by in (1.0 - ROOM, 1.0 + ROOM):
            try:
                _ = p.model_copy(update={**p.measures, name: by * value}).free_section
            except ValueError as error:
                raise ValueError(
                    f"sensitivity = true: {name} = {value:g} mm must be free to change by 1 %, "
                    f"but {by * value:g} mm is refused: {error}; move it away from this limit"
                ) from error


def _seal_is_squeezed(p: Gland) -> None:
    if p.rod_diameter * p.inner_diameter < 0.0 or p.rod_diameter * p.housing_diameter < 0.0:
        raise ValueError(
            f"rod_diameter = {p.rod_diameter:g}, housing_diameter = {p.housing_diameter:g} and "
            f"inner_diameter = {p.inner_diameter:g} mm have different signs; those of a piston "
            "seal are negative: give bore and ring instead"
        )
    between, keys = "rod and housing", "rod_diameter, housing_diameter"
    if p.piston:
        between, keys = "bore and ground of the groove", "bore, groove_diameter"
    if not 0.5 * p.section_diameter < p.depth < p.section_diameter:
        way = 'give groove_depth or squeeze, or gland = "dynamic" gives a groove'
        if p.section == "u_cup" and not p.ring:
            slides = abs(p.rod_diameter)
            groove = slides + (-10.0 if p.piston else 10.0)
            way = f'name the U-cup by its groove, as in ring = "U-cup {slides:g}x{groove:g}x8"'
        raise ValueError(
            f"the gap between {between} is {p.depth:g} mm ({keys}); "
            f"to squeeze the seal it must be between a half and one section_diameter, "
            f"{0.5 * p.section_diameter:g} to {p.section_diameter:g} mm; {way}"
        )


def _ring_fits_the_rod(p: Gland) -> None:
    stretch = p.rod_diameter / p.inner_diameter - 1.0
    if -0.1 <= stretch <= 0.2:
        return
    message = (
        f"rod_diameter = {p.rod_diameter:g} mm stretches inner_diameter = {p.inner_diameter:g} mm "
        f"by {100 * stretch:.3g} %"
    )
    if p.piston:
        message = (
            f"bore = {-p.rod_diameter:g} mm is {100 * abs(stretch):.3g} % "
            f"{'larger' if stretch > 0.0 else 'smaller'} than the ring outside, "
            f"{-p.inner_diameter:g} mm"
        )
    fits = -(p.rod_diameter + 2.0 * p.section_diameter) if p.piston else p.rod_diameter / 1.02
    other = ring_for(p.ring, fits) if p.ring else None
    hint = f'; of its section ring = "{other}" fits' if other else ""
    raise ValueError(f"{message}; allowed are -10 to 20 %{hint}")


def _section_is_between_the_walls(p: Gland) -> None:
    if p.groove_width < p.axial_width:
        what = "section_diameter" if p.round else "the width of the section"
        raise ValueError(
            f"groove_width = {p.groove_width:g} mm; it must be at least "
            f"{what}, {p.axial_width:g} mm"
        )
    limit = 0.5 * (p.groove_width - p.axial_width)
    if abs(p.groove_centre) > limit + 1e-9 * p.groove_width:
        what = "round section" if p.round else "section"
        raise ValueError(
            f"groove_centre = {p.groove_centre:g} mm; the {what} must lie between "
            f"the walls, {-limit:g} to {limit:g} mm"
        )


def require_films(p: Seal, pressure: float) -> None:
    """ValueError if no film is found at a sealed pressure, MPa."""
    ratio = p.load_ratio(pressure)
    if ratio > _MOST:
        raise ValueError(
            f"sealed_pressure = {pressure:g} MPa is {ratio:.2g} times the shear modulus "
            f"of the rubber; films are found up to {_MOST:g} times (docs/limits.md); take a harder "
            "rubber or a lower pressure"
        )


def _pressure_is_within_reach(p: Seal) -> None:
    if not p.estimable:
        require_films(p, p.sealed_pressure)


_CHECKS = (
    _mesh_is_there,
    _rubber_has_an_element,
    _discretisation_is_rich_enough,
    _film_has_its_model,
    _heating_has_its_oil,
    _air_side_is_closed_or_open,
    _section_is_one,
    _seal_is_squeezed,
    _ring_fits_the_rod,
    _section_is_between_the_walls,
    _sensitivity_has_a_meaning,
    _pressure_is_within_reach,
)
