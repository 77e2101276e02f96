"""The keys of an oil that thins under shear, and what its films take from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import model_validator

from softehl.cases.harness.parameters import Parameters, key

_USUAL = {
    "eyring": 'eyring_stress = "5 MPa"',
    "carreau": 'carreau_rate = "1e6 1/s" (or carreau_stress) and carreau_exponent = 0.5',
}
"""Law -> what it needs at least; its keys begin with its name."""


class ThinningKeys(Parameters):
    """Keys of an oil that thins under shear."""

    shear_thinning: Literal["eyring", "carreau"] | None = key(
        None,
        "law by which the oil thins under shear",
        bounds='"eyring", "carreau", left out = by the keys that follow, Newtonian without',
    )
    eyring_stress: float | None = key(
        None, "Eyring: stress tau_0 at which the oil thins", unit="MPa", gt=0
    )
    carreau_stress: float | None = key(
        None, "Carreau: stress tau_c at which the oil thins", unit="MPa", gt=0
    )
    carreau_rate: float | None = key(
        None,
        "Carreau: shear rate at which the oil thins at zero pressure, for carreau_stress",
        unit="1/s",
        gt=0,
    )
    carreau_exponent: float | None = key(
        None,
        "Carreau: exponent n of stress over rate where it has thinned",
        bounds="0.2 to 1, 1 = Newtonian",
        ge=0.2,
        le=1,
    )
    carreau_plateau: float | None = key(
        None,
        "Carreau: viscosity at the highest rates over that at rest",
        bounds="0 to 1, left out = 0",
        ge=0,
        le=1,
    )

    @property
    def thins(self) -> str:
        """Name of the law, empty for a Newtonian oil."""
        return self.shear_thinning or next(filter(self._set_keys, _USUAL), "")

    def thinning_values(self, viscosity: float) -> Mapping[str, float]:
        """Parameters of the kernels of films that thin; viscosity: at rest and zero pressure."""
        rate = self.carreau_rate or 0.0
        stress = self.eyring_stress or self.carreau_stress or viscosity * rate
        if not stress:
            return {}
        return {
            "critical_stress": stress,
            "thinning_exponent": self.carreau_exponent or 1.0,
            "thinning_plateau": self.carreau_plateau or 0.0,
        }

    @property
    def film_suffix(self) -> str:
        """Suffix of the names of kernels of smooth films; empty for Newtonian oils."""
        return f"_{self.thins}" if self.thins else ""

    def require_model(self, *, conserving: bool, dg: bool, asks: Mapping[str, bool]) -> None:
        """ValueError for films of which there is no model.

        asks: what cannot be had with a penalty -> whether it is given; "roughness" is one. Flow
        factors and facets are those of a Newtonian oil.
        """
        for what, requested in asks.items():
            if requested and not conserving:
                raise ValueError(
                    f'cavitation = "penalty" does not work with {what}; leave cavitation out'
                )
        if conserving and dg:
            raise ValueError('reynolds = "dg" works with cavitation = "penalty" only; use "fe"')
        for what, requested in (('reynolds = "dg"', dg), ("roughness", asks["roughness"])):
            if requested and self.thins:
                raise ValueError(
                    f"{what} needs a Newtonian oil; leave it or the keys of {self.thins} out"
                )

    def _set_keys(self, law: str) -> list[str]:
        """Keys of a law that have a value."""
        return [n for n in NUMBERS if n.startswith(law) and getattr(self, n) is not None]

    @model_validator(mode="after")
    def _thins_by_one_law(self) -> Self:
        law = self.thins
        if not law:
            return self
        for other in _USUAL:
            if other != law and (conflicting := self._set_keys(other)):
                also = f'shear_thinning = "{law}"' if self.shear_thinning else law
                raise ValueError(f"{conflicting[0]} is no key of {also}; leave one of them out")
        if self.carreau_stress and self.carreau_rate:
            raise ValueError(
                f"carreau_stress = {self.carreau_stress:g} and carreau_rate = "
                f"{self.carreau_rate:g}: one follows from the other; leave one of them out"
            )
        carreau = self.carreau_exponent and (self.carreau_stress or self.carreau_rate)
        if not (self.eyring_stress or carreau):
            raise ValueError(f'shear_thinning = "{law}" needs more, as in {_USUAL[law]}')
        return self


NUMBERS = tuple(name for name in ThinningKeys.model_fields if name != "shear_thinning")
"""Keys of both laws."""
