"""Parameters of the reciprocating O-ring (section 5.1 and Table 1 of the paper), with their limits.

A parameter set is data: frozen, checked on construction, of strict types (an integer is accepted
where a real number is meant, nothing else is converted).  Units are mm, MPa, N, s.
"""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

DENSITIES = (1, 2, 4, 8, 16)
"""Mesh densities of the paper, coarsest first."""

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
# strict again on the item: the list itself is lax so that a TOML array becomes a tuple
Speed = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]


class ORing(BaseModel):
    """Everything that defines one run of the O-ring case.

    Raises pydantic.ValidationError where a value is of the wrong type, out of its range or not
    finite, for an unknown key, and for a geometry in which the seal is not squeezed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    density: Literal[1, 2, 4, 8, 16] = Field(
        default=2,
        description="mesh density d: 27 d segments on the lubricated arc; 1, 2, 4, 8 or 16",
    )
    mesh: Literal["graded", "uniform"] = Field(
        default="graded",
        description='segments of the arc; "graded" (fine at the contact edges) or "uniform"',
    )
    pressure_order: int = Field(
        default=4, ge=1, le=64, description="order m_p of the film pressure on a segment; 1 to 64"
    )
    reynolds: Literal["fe", "dg"] = Field(
        default="fe",
        description='treatment of the Reynolds equation; "fe" (continuous pressure) or "dg"',
    )
    quadrature: Literal["gauss", "lobatto"] = Field(
        default="gauss", description='quadrature rule of the film; "gauss" or "lobatto"'
    )
    quadrature_points: int | None = Field(
        default=None,
        ge=2,
        le=128,
        description="points of the film rule; 2 to 128, left out = automatic",
    )
    upwinding: NonNegative = Field(
        default=1.0,
        description="strength c of the bubble-load upwinding; >= 0, 0 = the paper's scheme",
    )
    error_estimate: bool = Field(
        default=True,
        description="whether the error of h* is estimated, on a graded mesh; true or false",
    )
    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="largest estimated error of h* [%], reached by finer meshes; left out = any",
    )
    solid: Literal["fbar", "taylor", "q4"] = Field(
        default="taylor", description='solid element; "fbar", "taylor" or "q4"'
    )
    sealed_pressure: NonNegative = Field(default=1.0, description="sealed pressure p_s [MPa]; >= 0")
    stroke: Literal["out", "in", "both"] = Field(
        default="both", description='direction of the rod; "out" (to the air side), "in" or "both"'
    )
    speeds: tuple[Speed, ...] = Field(
        default=(1600.0, 800.0, 400.0, 200.0, 100.0),
        min_length=1,
        strict=False,
        description="rod speeds |U| [mm/s]; a list of different numbers > 0, in any order",
    )
    pressure_viscosity: NonNegative = Field(
        default=0.02, description="pressure-viscosity coefficient alpha of (13) [1/MPa]; >= 0"
    )
    shear_traction: bool = Field(
        default=True, description="whether the shear stress (17) acts on the seal; true or false"
    )
    rotation: Literal["fixed", "free"] = Field(
        default="fixed",
        description='mean rotation of the section; "fixed" (held at zero) or "free"',
    )
    solver: Literal["auto", "monolithic"] = Field(
        default="auto",
        description='way to the solution; "auto" (fast, checks itself) or "monolithic" (reference)',
    )
    linear: Literal["auto", "superlu", "pardiso"] = Field(
        default="auto",
        description='linear solver; "superlu", "pardiso" or "auto" (pardiso where installed)',
    )

    inner_diameter: Positive = Field(
        default=50.39, description="inner diameter of the seal D_inner [mm]; > 0"
    )
    section_diameter: Positive = Field(
        default=3.53, description="diameter of the section D_seal [mm]; > 0"
    )
    rod_diameter: Positive = Field(default=50.0, description="rod diameter D_rod [mm]; > 0")
    housing_diameter: Positive = Field(
        default=56.30, description="inner diameter of the housing D_housing [mm]; > 0"
    )
    mu_1: Positive = Field(
        default=3.04, description="Mooney-Rivlin parameter mu_1 of (3) [MPa]; > 0"
    )
    mu_2: NonNegative = Field(
        default=0.62, description="Mooney-Rivlin parameter mu_2 of (3) [MPa]; >= 0"
    )
    bulk_modulus: Positive = Field(
        default=500.0, description="bulk modulus kappa of (6) [MPa]; > 0"
    )
    viscosity: Positive = Field(
        default=6.59e-8, description="viscosity eta_0 at zero pressure of (13) [MPa s]; > 0"
    )
    cavitation_penalty: Positive = Field(
        default=1.0e4, description="cavitation penalty epsilon of (25) [mm/(MPa s)]; > 0"
    )

    groove_width: Positive = Field(default=3.74, description="axial width of the groove [mm]; > 0")
    groove_centre: float = Field(
        default=0.0,
        description="axial position of the middle of the groove, section centre = 0 [mm]",
    )
    arc_start: float = Field(
        default=-34.0,
        ge=-120.0,
        lt=0.0,
        description="sealed end of the lubricated arc, from the bottom [degrees]; -120 to < 0",
    )
    arc_end: float = Field(
        default=43.0,
        gt=0.0,
        le=120.0,
        description="air end of the lubricated arc, from the bottom [degrees]; > 0 to 120",
    )

    @property
    def shear_modulus(self) -> float:
        """Shear modulus in the initial configuration, mu of (3) [MPa]."""
        return self.mu_1 + self.mu_2

    @field_validator("density", mode="before")
    @classmethod
    def _density_is_integer(cls, density: object) -> object:
        # a Literal compares by ==, which would let 2.0 and True through
        if type(density) is not int:
            raise ValueError("not an integer")
        return density

    @field_validator("speeds")
    @classmethod
    def _speeds_differ(cls, speeds: tuple[float, ...]) -> tuple[float, ...]:
        if len(set(speeds)) < len(speeds):
            raise ValueError("a speed is given twice")
        return speeds

    @model_validator(mode="after")
    def _tolerance_has_an_estimate(self) -> Self:
        if self.tolerance is not None and not (self.error_estimate and self.mesh == "graded"):
            raise ValueError(
                f"tolerance = {self.tolerance:g} needs an estimate of the error; "
                'set error_estimate = true and mesh = "graded"'
            )
        return self

    @model_validator(mode="after")
    def _seal_is_squeezed(self) -> Self:
        gap = 0.5 * (self.housing_diameter - self.rod_diameter)
        if not 0.5 * self.section_diameter < gap < self.section_diameter:
            raise ValueError(
                f"the gap between rod and housing is {gap:g} mm (rod_diameter, housing_diameter); "
                f"to squeeze the seal it must be between a half and one section_diameter, "
                f"{0.5 * self.section_diameter:g} to {self.section_diameter:g} mm"
            )
        centre = 0.5 * (self.inner_diameter + self.section_diameter)
        if not 0.5 * self.rod_diameter < centre < 0.5 * self.housing_diameter:
            raise ValueError(
                f"the section centre lies at radius {centre:g} mm (inner_diameter, "
                f"section_diameter); it must be between rod and housing, "
                f"{0.5 * self.rod_diameter:g} to {0.5 * self.housing_diameter:g} mm"
            )
        if self.groove_width < self.section_diameter:
            raise ValueError(
                f"groove_width = {self.groove_width:g} mm; it must be at least "
                f"section_diameter, {self.section_diameter:g} mm"
            )
        if 2 * abs(self.groove_centre) > self.groove_width - self.section_diameter:
            limit = 0.5 * (self.groove_width - self.section_diameter)
            raise ValueError(
                f"groove_centre = {self.groove_centre:g} mm; the round section must lie between "
                f"the walls, {-limit:g} to {limit:g} mm"
            )
        return self
