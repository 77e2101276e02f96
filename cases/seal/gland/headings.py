"""In which order, and under which headings, the keys of a seal are listed."""

from __future__ import annotations

from softehl.cases.seal.gland.rubbers.rubber_keys import RubberKeys
from softehl.cases.seal.gland.sections.keys import SectionKeys
from softehl.cases.seal.gland.shear_thinning import ThinningKeys

_HARDNESS = ("compound", "shore_A")
_SURFACES = ("roughness", "asperity_stiffness", "boundary_friction")
_CAVITATION = ("cavitation", "cavitation_pressure", "cavitation_penalty")

SEAL = {
    "ring": ("ring", "inner_diameter", "section_diameter", *SectionKeys.model_fields),
    "gland": (
        *(
            "rod",
            "bore",
            "rod_diameter",
            "gland",
            "groove_depth",
            "squeeze",
            "groove_diameter",
            "housing_diameter",
        ),
        *("fill", "groove_width"),
        *("groove_centre", "backup", "extrusion_gap", "corner_fillet", "housing_friction"),
    ),
    "rubber": (
        *_HARDNESS,
        *(k for k in RubberKeys.model_fields if k not in _HARDNESS),
        "materials",
    ),
    "oil": (
        *("oil", "temperature", "viscosity", "pressure_viscosity", "roelands", "oil_density"),
        *ThinningKeys.model_fields,
    ),
    "motion": ("sealed_pressure", "speeds", "stroke", "travel"),
    "film": (*_SURFACES, *_CAVITATION, "shear_traction", "arc_start", "arc_end"),
    "mesh": ("density", "tolerance", "error_estimate", "mesh"),
    "numerics": (
        *("sensitivity", "tolerances", "pressure_order", "reynolds", "quadrature"),
        *("quadrature_points", "upwinding", "solid", "rotation", "solver", "linear", "said"),
    ),
}
"""Heading -> keys."""

WORDS = {
    **dict.fromkeys(
        ("piston", "cylinder", "piston_diameter", "bore_diameter"), 'write bore = "40 H8"'
    ),
    **dict.fromkeys(("pressure", "p", "p_s"), "write sealed_pressure"),
    **dict.fromkeys(("speed", "velocity", "u"), "write speeds"),
    **dict.fromkeys(("hardness", "rubber", "polymer"), 'write material = "NBR 70"'),
    **dict.fromkeys(("fluid", "lubricant", "grease"), 'write oil = "HLP 46 at 50 degC"'),
    **dict.fromkeys(("eta", "dynamic_viscosity"), "write viscosity"),
    **dict.fromkeys(("seal", "profile", "type"), 'write ring = "36x4" or section = "u_cup"'),
    **dict.fromkeys(("temp", "t"), "write temperature"),
    **dict.fromkeys(("housing", "gland_diameter"), "write housing_diameter"),
    **dict.fromkeys(("depth", "gland_depth"), "write groove_depth"),
    **dict.fromkeys(("width", "gland_width", "groove_length"), "write groove_width"),
    **dict.fromkeys(("surface", "finish", "ra", "rq"), 'write roughness = "Ra 0.2"'),
    **dict.fromkeys(("stroke_length", "length"), "write travel"),
    **dict.fromkeys(("gap", "clearance"), "write extrusion_gap"),
    **dict.fromkeys(("compression", "interference"), "write squeeze"),
}
"""Words of the trade that are no keys -> what to write."""

CYCLE = {
    **SEAL,
    "motion": (
        *("sealed_pressure", "pressures", "travel", "frequency", "shape", "ramp", "motion"),
        *("cycles", "supply", "speeds", "stroke"),
    ),
    "numerics": (*SEAL["numerics"], "time_order", "time_tolerance", "animation"),
}
"""Headings of a cycle."""

SLIDER = {
    "gap": (
        *("profile", "h0", "radius", "amplitude", "ratio", "pocket_start", "pocket_end"),
        *("start", "end"),
    ),
    "oil": ("viscosity", "pressure_viscosity", *ThinningKeys.model_fields),
    "motion": ("speeds", "start_pressure", "end_pressure"),
    "film": (*_SURFACES, *_CAVITATION, "supply"),
    "mesh": ("segments",),
    "numerics": ("pressure_order", "reynolds"),
}
"""Headings of the slider."""
