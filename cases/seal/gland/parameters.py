"""Parameters of a reciprocating seal (section 5.1 and Table 1 of the paper), with their limits.

Units are mm, MPa, N, s.
"""

from typing import Any, Self

from pydantic import model_validator

from softehl.cases.seal.gland.contradictions import require_consistent
from softehl.cases.seal.gland.fitting import fitted
from softehl.cases.seal.gland.headings import SEAL, WORDS
from softehl.cases.seal.gland.oils import with_oil
from softehl.cases.seal.gland.records.duty import Duty
from softehl.cases.seal.gland.records.film_model import FilmModel
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.gland.records.numerics import Numerics
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.records.solid import Solid
from softehl.cases.seal.gland.rubbers.regions import with_regions
from softehl.cases.seal.gland.rubbers.rubber import with_rubber
from softehl.cases.seal.gland.surfaces import SurfacePair
from softehl.cases.seal.gland.trade.said import SaidKeys, with_limits


class Seal(FilmModel, Oil, Numerics, Duty, Solid, Gland, SaidKeys):
    """Everything that defines one run of a seal: an O-ring, or a seal of another section.

    Its keys are those of its records; what needs one of them takes that one. Raises
    pydantic.ValidationError also for a geometry in which the seal is not squeezed.
    """

    names = (
        *("ring", "rod", "bore", "groove_diameter", "squeeze", "groove_depth", "fill", "gland"),
        *("backup", "compound", "shore_A", "fit", "oil", "oil_density", "roelands", "said"),
    )
    headings = SEAL
    words = WORDS

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Diameters and width from ring, rod, squeeze and gland; rubber and oil.  ValueError."""
        values = fitted(with_limits(dict(given)))
        return with_oil(with_rubber(with_regions(values)))

    @property
    def surfaces(self) -> SurfacePair:
        """Roughness, asperities and their friction."""
        return self.pair(self.surface_modulus)

    @model_validator(mode="after")
    def _nothing_contradicts(self) -> Self:
        require_consistent(self)
        return self


ORing = Seal
"""The old name."""
