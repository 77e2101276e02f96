"""The keys of a rubber, and what its elements take from them."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from softehl.cases.harness.parameters import Number, Parameters, key
from softehl.cases.seal.gland.key_values import value_text
from softehl.cases.seal.gland.rubbers import materials
from softehl.cases.seal.gland.rubbers.conditions import Rule
from softehl.cases.seal.gland.rubbers.rubber import PAPER
from softehl.cases.seal.gland.trade.parse_terms import rubber_named
from softehl.cases.seal.gland.trade.rubber_names import GLASS, read_rubber

Terms = Annotated[tuple[Number, ...], Field(min_length=1, max_length=3, strict=False)]


class Rubber(Parameters):
    """Keys of the material of a seal, or of a region of it."""

    material: materials.Name = key("mooney-rivlin", "rubber")
    mu_1: float | None = key(
        PAPER["mu_1"],
        "Mooney-Rivlin modulus mu_1; mu_1 + mu_2 is the shear modulus",
        unit="MPa",
        gt=0,
        le=1000,
    )
    mu_2: float | None = key(PAPER["mu_2"], "Mooney-Rivlin modulus mu_2", unit="MPa", ge=0, le=1000)
    mu: float | None = key(
        None, "modulus mu of neo-hooke, arruda-boyce and gent", unit="MPa", gt=0, le=1000
    )
    c_10: float | None = key(None, "Yeoh coefficient of I1bar - 3", unit="MPa", gt=0, le=1000)
    c_20: float | None = key(None, "Yeoh coefficient of (I1bar - 3)^2", unit="MPa", ge=-1e3, le=1e3)
    c_30: float | None = key(None, "Yeoh coefficient of (I1bar - 3)^3", unit="MPa", ge=-1e3, le=1e3)
    ogden_mu: Terms | None = key(
        None, "Ogden moduli mu_p", unit="MPa", bounds="a number or a list of up to 3"
    )
    ogden_alpha: Terms | None = key(
        None, "Ogden exponents alpha_p", bounds="a number or a list of up to 3, none 0"
    )
    lambda_m: float | None = key(
        None, "Arruda-Boyce stretch at which the chains lock", gt=1, le=1000
    )
    J_m: float | None = key(None, "Gent limit of I1bar - 3", gt=0, le=1e6)
    compound: str | None = key(
        None,
        "a rubber by polymer and hardness, for shore_A",
        bounds='"NBR 70", "FKM 75 IRHD", "EPDM 80", "PU 46 Shore D", also as material',
    )
    shore_A: float | None = key(
        None,
        "hardness Shore A, for mu by Gent's rule; 5 Shore are 20 to 28 % of it at 70, more above",
        bounds="20 to 90; polyurethane to 98, by another rule",
        ge=20,
        le=98,
    )
    fit: str | None = key(
        None,
        "tests of the rubber, for the parameters of its material",
        bounds="a CSV file with the columns test, stretch, stress_MPa",
        file=True,
    )
    ogden_terms: int = key(3, "terms of an Ogden fit", bounds="1, 2 or 3", ge=1, le=3)
    glass_transition: float | None = key(
        None,
        "glass transition of the rubber, for its modulus in the cold",
        unit="degC",
        bounds="-150 to 60, left out = typical of its polymer (docs/materials.md)",
        ge=-150,
        le=60,
    )
    modulus_rule: Rule | None = key(
        None,
        "modulus of a hardness over temperature",
        bounds='"wlf" (stiffer in the cold), "entropic" (also in proportion to the absolute '
        'temperature) or "constant", left out = wlf',
    )
    modulus_table: str | None = key(
        None,
        "shear modulus over temperature, measured",
        bounds="a CSV file with the columns temperature_degC, shear_modulus_MPa",
        file=True,
    )
    bulk_modulus: float = key(500.0, "bulk modulus kappa", unit="MPa", gt=0, le=1e5)

    @classmethod
    def worded(cls, values: dict[str, Any]) -> dict[str, Any]:
        """As in the base, and rubbers by their names."""
        return super().worded(rubber_named(values))

    @property
    def polymer(self) -> str | None:
        """Of the rubber that is named."""
        rubber = read_rubber("compound", self.compound) if self.compound else None
        return rubber.polymer if rubber else None

    @property
    def glass(self) -> float | None:
        """Its glass transition, that of the key or typical of its polymer, degC."""
        if self.glass_transition is not None:
            return self.glass_transition
        return GLASS.get(self.polymer or "")

    @property
    def energy(self) -> str:
        """Name of its energy among the kernels."""
        return materials.MATERIALS[self.material].energy

    @property
    def shear_modulus(self) -> float:
        """Shear modulus in the initial configuration, mu of (3) [MPa]."""
        return materials.shear_modulus(materials.MATERIALS[self.material], self._rubber)

    @property
    def rubber_values(self) -> dict[str, float]:
        """Parameters of the solid's kernel."""
        values = materials.MATERIALS[self.material].kernel_values(self._rubber)
        return {**values, "kappa": self.bulk_modulus}

    def solid_kernel(self, element: str) -> str:
        """Name of the kernel of a solid element: with the energy where it is not the paper's."""
        return f"solid_{element}" + ("" if self.energy == "mooney_rivlin" else f"_{self.energy}")

    @property
    def _rubber(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in materials.KEYS}

    @model_validator(mode="after")
    def _is_stable(self) -> Self:
        material, values = materials.MATERIALS[self.material], self._rubber
        if self.energy == "mooney_rivlin":
            return self  # with moduli that are not negative it always is
        if self.material == "ogden":
            mu, alpha = values["ogden_mu"], values["ogden_alpha"]
            if len(mu) != len(alpha):
                raise ValueError(
                    f"ogden_mu has {len(mu)} and ogden_alpha {len(alpha)} values: a term is a pair "
                    "of them"
                )
            if 0.0 in alpha:
                raise ValueError("ogden_alpha has a 0: an exponent of 0 is no term; leave it out")
        if unstable := materials.unstable_at(material, material.kernel_values(values)):
            keys = ", ".join(f"{key} = {value_text(values[key])}" for key in material.keys)
            raise ValueError(
                f'material = "{self.material}" ({keys}) is not stable in {unstable[0]} tension at '
                f"a stretch of {unstable[1]:.3g} (its stress falls there, or it locks); a seal "
                "needs 0.6 to 1.6"
            )
        return self
