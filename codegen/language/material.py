"""A material by itself: an energy or a stress as a function of the deformation.

    @softehl.material
    def neo(m):
        \"\"\"Compressible neo-Hooke.\"\"\"
        mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
        J = m.define("J", m.F.det())
        m.energy(mu / 2 * ((m.F.T * m.F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)

`softehl generate` writes such a law for hosts; `neo.on(model, F)` puts it into a page.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.language.lower import ModelError
from softehl.codegen.language.model import NAME, Model


class Material:
    """Argument of the function of a law: the deformation, and calls that say what the law is."""

    def __init__(self, name: str, model: Model, F: Any) -> None:
        self.name, self.model = name, model
        self.W: Any = None
        self.P: Any = None
        self.small: bool | None = None
        self._F = sp.Matrix(F)
        if self._F.shape != (3, 3):
            raise ModelError(f"{name}: F has shape {self._F.shape}, must be (3, 3)")

    @property
    def F(self) -> Any:
        """Deformation gradient (3, 3); the law is one of large strains."""
        self._kinematics(small=False)
        return self._F

    @property
    def strain(self) -> Any:
        """Small strain (3, 3), the symmetric part of F - 1; the law is one of small strains."""
        self._kinematics(small=True)
        return (self._F + self._F.T) / 2 - sp.eye(3)

    def _kinematics(self, *, small: bool) -> None:
        if self.small not in (None, small):
            raise ModelError(f"the material {self.name} uses m.F and m.strain: use one of them")
        self.small = small

    def parameters(self, **meanings: str) -> list[sp.Symbol]:
        """Constants of the material, as `Model.parameters`."""
        return self.model.parameters(**meanings)

    def define(self, name: str, expression: Any) -> Any:
        """A name for an intermediate, scalar or matrix."""
        return self.model.define(f"{self.name}_{name}", expression)

    def principal(self, name: str, energy: Callable[[Any, Any, Any], Any]) -> Any:
        """An isotropic energy of the principal stretches of F, as `Model.principal`."""
        C = self.define(f"{name}_C", self.F.T * self.F)
        return self.model.principal(f"{self.name}_{name}", C, energy)

    def energy(self, W: Any) -> None:
        """Energy per undeformed volume; further energies add up."""
        if self.P is not None:
            raise ModelError(f"the material {self.name} has a stress: it cannot have an energy too")
        self.W = W if self.W is None else self.W + W

    def stress(self, P: Any) -> None:
        """First Piola-Kirchhoff stress (3, 3) as a function of F, or the stress of a small strain.

        Further stresses add up.
        """
        if self.W is not None:
            raise ModelError(f"the material {self.name} has an energy: it cannot have a stress too")
        P = sp.Matrix(P)
        if P.shape != (3, 3):
            raise ModelError(f"{self.name}: the stress has shape {P.shape}, must be (3, 3)")
        self.P = P if self.P is None else self.P + P


@dataclass(frozen=True)
class Law:
    """A material of a page: its name, its documentation, the function that writes it."""

    name: str
    doc: str
    write: Callable[[Material], object]

    def on(self, model: Model, F: Any) -> Material:
        """The law in a page, at the deformation gradient F (3, 3): its energy `W` or stress `P`.

        Its parameters become those of the page.
        """
        m = Material(self.name, model, F)
        self.write(m)
        if m.W is None and m.P is None:
            raise ModelError(f"the material {self.name} has neither m.energy(W) nor m.stress(P)")
        if m.small is None:
            raise ModelError(f"the material {self.name} uses neither m.F nor m.strain")
        return m


def material(function: Callable[[Material], object]) -> Law:
    """The law that a function writes: a decorator."""
    name = function.__name__
    if not NAME.fullmatch(name):
        raise ModelError(f"a material is called {name!r}; use letters, digits and underscores")
    return Law(name, " ".join((function.__doc__ or "").split()), function)
