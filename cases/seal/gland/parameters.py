"""Parameters of a reciprocating seal (section 5.1 and Table 1 of the paper), with their limits.

Units are mm, MPa, N, s.
"""

from typing import Any, ClassVar, Self

from pydantic import model_validator

from softehl.cases.harness.parameters import Parameters
from softehl.cases.seal.gland.contradictions import require_consistent
from softehl.cases.seal.gland.fitting import fitted
from softehl.cases.seal.gland.oils import with_oil
from softehl.cases.seal.gland.records.duty import Duty
from softehl.cases.seal.gland.records.film_model import FilmModel
from softehl.cases.seal.gland.records.free_seal import FreeSeal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.gland.records.numerics import Numerics
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.records.solid import Solid
from softehl.cases.seal.gland.rubbers.regions import with_regions
from softehl.cases.seal.gland.rubbers.rubber import with_rubber
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections.keys import MEASURES, SectionKeys
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import SurfacePair, Surfaces
from softehl.cases.seal.gland.trade.said import SaidKeys, with_limits


def _own(record: type[Parameters]) -> tuple[str, ...]:
    """Keys that a record declares itself, in order."""
    return tuple(name for name in record.__annotations__ if name in record.model_fields)


class Seal(FilmModel, Oil, Numerics, Duty, Solid, Gland, SaidKeys):
    """Everything that defines one run of a seal: an O-ring, or a seal of another section.

    Its keys are those of its records; what needs one of them takes that one. Raises
    pydantic.ValidationError also for a geometry in which the seal is not squeezed.
    """

    names = (
        *("ring", "rod", "bore", "groove_diameter", "squeeze", "groove_depth", "fill", "gland"),
        *("backup", "compound", "shore_A", "fit", "oil", "oil_density", "roelands", "said"),
    )
    headings: ClassVar = {
        "ring": (*_own(FreeSeal), *_own(SectionKeys), *MEASURES),
        "gland": _own(Gland),
        "rubber": (*dict.fromkeys(("compound", "shore_A", *Rubber.model_fields)), "materials"),
        "oil": (*_own(Oil), *ThinningKeys.model_fields),
        "motion": ("sealed_pressure", "speeds", "stroke", "travel"),
        "film": (*Surfaces.model_fields, *_own(FilmModel)),
        "mesh": ("density", "tolerance", "error_estimate", "mesh"),
        "numerics": (
            *("sensitivity", "tolerances", "pressure_order", "reynolds", "quadrature"),
            *("quadrature_points", "upwinding", "solid", "rotation", "solver", "linear", "said"),
        ),
    }
    words: ClassVar = {
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

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Diameters and width from ring, rod, squeeze and gland; rubber and oil.  ValueError."""
        values = fitted(with_limits(dict(given)))
        return with_oil(with_rubber(with_regions(values)))

    @property
    def surfaces(self) -> SurfacePair:
        """Roughness, asperities and their friction; on rigid asperities E* = 4 G of the seal."""
        stiffness = self.asperity_stiffness or 4.0 * self.surface_modulus
        return SurfacePair.of(self.roughness, stiffness, self.boundary_friction)

    @model_validator(mode="after")
    def _nothing_contradicts(self) -> Self:
        require_consistent(self)
        return self


ORing = Seal
"""The old name."""
