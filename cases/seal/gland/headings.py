"""In which order, and under which headings, the keys of a seal are listed."""

from __future__ import annotations

from softehl.cases.harness.parameters import Parameters
from softehl.cases.seal.gland.records.film_model import FilmModel
from softehl.cases.seal.gland.records.free_seal import FreeSeal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections.keys import SectionKeys
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import Surfaces
from softehl.cases.seal.gland.varied import MEASURES

_HARDNESS = ("compound", "shore_A")


def own(record: type[Parameters]) -> tuple[str, ...]:
    """Keys that a record declares itself, in order."""
    return tuple(name for name in record.__annotations__ if name in record.model_fields)


SEAL = {
    "ring": (*own(FreeSeal), *own(SectionKeys), *MEASURES),
    "gland": own(Gland),
    "rubber": (
        *_HARDNESS,
        *(k for k in Rubber.model_fields if k not in _HARDNESS),
        "materials",
    ),
    "oil": (*own(Oil), *ThinningKeys.model_fields),
    "motion": ("sealed_pressure", "speeds", "stroke", "travel"),
    "film": (*Surfaces.model_fields, *own(FilmModel)),
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
    "film": (
        *Surfaces.model_fields,
        *("cavitation", "cavitation_pressure", "cavitation_penalty", "supply"),
    ),
    "mesh": ("segments",),
    "numerics": ("pressure_order", "reynolds"),
}
"""Headings of the slider."""
