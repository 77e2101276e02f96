"""Parameters of a reciprocating seal (section 5.1 and Table 1 of the paper), with their limits.

Units are mm, MPa, N, s.
"""

from typing import Any, ClassVar, Self

from pydantic import model_validator

from softehl.cases.harness.parameters import Parameters
from softehl.cases.seal.gland.fit_geometry import fitted
from softehl.cases.seal.gland.oils import Viscosity, relative_viscosity, with_oil
from softehl.cases.seal.gland.records import (
    Duty,
    FilmModel,
    FreeSeal,
    Gland,
    Numerics,
    Oil,
    Solid,
)
from softehl.cases.seal.gland.rubbers.regions import with_regions
from softehl.cases.seal.gland.rubbers.rubber import with_rubber
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections.section_keys import MEASURES, SectionKeys
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import SurfacePair, Surfaces
from softehl.cases.seal.gland.trade.parse_terms import SaidKeys, with_limits
from softehl.cases.seal.gland.validation import require_consistent


def _declared_keys(record: type[Parameters]) -> tuple[str, ...]:
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
        *("modulus_table", "modulus_rule", "swelling", "compression_set"),
    )
    headings: ClassVar = {
        "ring": (*_declared_keys(FreeSeal), *_declared_keys(SectionKeys), *MEASURES),
        "gland": _declared_keys(Gland),
        "rubber": (*dict.fromkeys(("compound", "shore_A", *Rubber.model_fields)), "materials"),
        "oil": (*_declared_keys(Oil), *ThinningKeys.model_fields),
        "motion": ("sealed_pressure", "speeds", "stroke", "travel", "service"),
        "film": (*Surfaces.model_fields, *_declared_keys(FilmModel)),
        "mesh": ("density", "tolerance", "error_estimate", "mesh"),
        "numerics": (
            *("sensitivity", "tolerances", "pressure_order", "reynolds", "quadrature"),
            *("quadrature_points", "upwinding", "solid", "rotation", "solver", "linear", "said"),
        ),
    }
    hints: ClassVar = {
        word: f"write {hint}"
        for hint, named_keys in {
            'bore = "40 H8"': ("piston", "cylinder", "piston_diameter", "bore_diameter"),
            "sealed_pressure": ("pressure", "p", "p_s"),
            "speeds": ("speed", "velocity", "u"),
            'material = "NBR 70"': ("hardness", "rubber", "polymer"),
            'oil = "HLP 46 at 50 degC"': ("fluid", "lubricant", "grease"),
            "viscosity": ("eta", "dynamic_viscosity"),
            'ring = "36x4" or section = "u_cup"': ("seal", "profile", "type"),
            "temperature": ("temp", "t"),
            "housing_diameter": ("housing", "gland_diameter"),
            "groove_depth": ("depth", "gland_depth"),
            "groove_width": ("width", "gland_width", "groove_length"),
            'roughness = "Ra 0.2"': ("surface", "finish", "ra", "rq"),
            "travel": ("stroke_length", "length"),
            'service = "1e6 cycles", "2000 h" or "500 km"': (
                *("cycles", "service_hours", "hours", "service_km", "lifetime", "duty"),
            ),
            "low speeds and a roughness; the force to start after a rest is not modelled": (
                *("breakaway", "breakaway_force", "rest", "rest_time", "dwell", "stiction"),
            ),
            "extrusion_gap": ("gap", "clearance"),
            "boundary_friction with a roughness, or housing_friction": (
                *("friction", "mu_friction", "friction_coefficient", "cof"),
            ),
            "squeeze": ("compression", "interference"),
            'material = "neo-hooke" and mu, a third of Young\'s modulus': (
                *("youngs_modulus", "young", "young_modulus", "e", "e_modulus", "elastic_modulus"),
                "elasticity",
            ),
            'material = "neo-hooke" and mu': ("shear_modulus", "g"),
            "bulk_modulus, 2 mu (1 + nu) / (3 - 6 nu)": ("nu", "poisson", "poissons_ratio"),
        }.items()
        for word in named_keys
    }

    @classmethod
    def completed(cls, specified: dict[str, Any]) -> dict[str, Any]:
        """Diameters and width from ring, rod, squeeze and gland; rubber and oil.  ValueError."""
        values = with_oil(fitted(with_limits(dict(specified))))  # an oil may name the temperature
        return with_rubber(with_regions(values))

    @property
    def surfaces(self) -> SurfacePair:
        """Roughness, asperities and their friction; on rigid asperities E* = 4 G of the seal."""
        stiffness = self.asperity_stiffness or 4.0 * self.surface_modulus
        return SurfacePair.of(self.roughness, stiffness, self.boundary_friction)

    @property
    def warm_viscosity(self) -> Viscosity:
        """Viscosity by the rise of the temperature, over that of the cold oil, with heating."""
        assert self.viscosity_slope is not None
        usual = 40.0 if self.temperature is None else self.temperature
        return relative_viscosity(self.viscosity_slope, usual)

    @property
    def predictable(self) -> bool:
        """True if the theory of the inlet holds: a closed gap, a graded mesh."""
        return not self.opens and self.mesh == "graded"

    @property
    def estimable(self) -> bool:
        """True if the theory answers above all films: that of one round lobe, whose pocket shrinks
        by a law.
        """
        return self.round and self.predictable

    @model_validator(mode="after")
    def _nothing_contradicts(self) -> Self:
        require_consistent(self)
        return self


ORing = Seal
"""The old name."""
