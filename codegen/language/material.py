"""A material by itself: an energy or a stress as a function of the deformation.

    @softehl.material
    def neo(m):
        \"\"\"Compressible neo-Hooke.\"\"\"
        mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
        J = m.define("J", m.F.det())
        m.energy(mu / 2 * ((m.F.T * m.F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)

`Study.add("body", material=neo, ...)` makes a body of it, `m.stress(neo, F)` uses it on a page of
fields, `neo.on(model, F)` on any page.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.definition import PointForm
from softehl.codegen.language.draft import NAME
from softehl.codegen.language.entries import Matrix, applied
from softehl.codegen.language.fields import AXES, Fields
from softehl.codegen.language.model import Model
from softehl.codegen.language.pages import Page

_SHOWN = {1: ((0, 0),), 2: ((0, 0), (1, 1), (2, 2), (0, 1))}
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class Material:
    """Argument of the function of a law: the deformation, and calls that say what the law is."""

    def __init__(self, name: str, model: Model, F: Any) -> None:
        self.name, self.model = name, model
        self.W: Any = None
        self.P: Any = None
        self.small: bool | None = None
        self._F = Matrix(F)
        if self._F.shape != (3, 3):
            raise ModelError(f"{name}: F has shape {self._F.shape}, must be (3, 3)")
        self._green: Any = None
        self.parameters, self.require = model.parameters, model.require
        self.point_data, self.history, self.fields = model.point_data, model.history, model.fields
        self.norm, self.derivative, self.example = model.norm, model.derivative, model.example

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

    @property
    def green(self) -> Any:
        """Green's strain (F^T F - 1) / 2, (3, 3); the law is one of large strains."""
        if self._green is None:
            E = (self.F.T * self.F - sp.eye(3)) / 2
            names = {}
            for i, k in _SYMMETRIC:
                names[i, k] = names[k, i] = self.define(f"green_{i}{k}", E[i, k])
            self._green = Matrix(3, 3, lambda i, k: names[i, k])
        return self._green

    def _kinematics(self, *, small: bool) -> None:
        if self.small not in (None, small):
            raise ModelError(f"the material {self.name} uses m.F and m.strain: use one of them")
        self.small = small

    def define(self, name: str, expression: Any) -> Any:
        """A name for an intermediate, scalar or matrix."""
        return self.model.define(f"{self.name}_{name}", expression)

    def implicit(self, name: str, equations: Callable[[Any], Any], **settings: Any) -> Any:
        """Local unknowns, as `Model.implicit`."""
        return self.model.implicit(f"{self.name}_{name}", equations, **settings)

    def principal(self, name: str, C: Any, energy: Any = None) -> Any:
        """An isotropic energy of principal stretches, as `Model.principal`; C is m.F.T * m.F."""
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
        P = self._square(P)
        self.P = P if self.P is None else self.P + P

    def second_stress(self, S: Any) -> None:
        """Second Piola-Kirchhoff stress (3, 3) of a law of large strains: P = F S."""
        self.stress(self.F * self._square(S))

    def _square(self, P: Any) -> Any:
        if getattr(P, "shape", None) != (3, 3):
            shape = getattr(P, "shape", "that of a scalar")
            raise ModelError(f"{self.name}: the stress has shape {shape}, must be (3, 3)")
        return sp.Matrix(P)


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
        applied(self.name, self.write, m, write=f"`def {self.name}(m):`")
        if m.W is None and m.P is None:
            raise ModelError(f"the material {self.name} has neither m.energy(W) nor m.stress(P)")
        if m.small is None:
            raise ModelError(f"the material {self.name} uses neither m.F nor m.strain")
        return m

    def at(self, m: Fields, F: Any) -> tuple[Any, Any]:
        """P (3, 3) at F on a page of fields, and the energy or None."""
        return self._at(m, F)[:2]

    def _at(self, m: Fields, F: Any) -> tuple[Any, Any, bool]:
        """P, the energy or None, and True for a law of small strains."""
        names = Matrix(3, 3, lambda i, k: m.define(f"{self.name}_F_{i}{k}", F[i, k]))
        law = self.on(m, names)
        if law.W is None:
            return m.define(f"{self.name}_P", law.P), None, bool(law.small)
        P = m.derivative(f"{self.name}_P", law.W, names)
        return P, law.W, bool(law.small)

    def page(self) -> Page:
        """A body of this material: displacements, equilibrium, Cauchy stresses as fields."""
        return Page(self.name, self._body, doc=self.doc, source=self.write)

    def at_point(self) -> PointForm:
        """The law by itself: its residual is P, its tangent dP/dF, by displacement gradients."""
        return self.page().at_point("hex8")

    def _body(self, m: Fields) -> None:
        F = m.deformation_gradient(m.vector("u"))
        P, W, small = self._at(m, F)
        if W is None:
            m.weak(P, F)
        else:
            m.minimise(W)
        J = m.define("volume_ratio", F.det(method="berkowitz"))
        cauchy = P if small else P * F.T / J
        shown = _SHOWN.get(m.dimension, _SYMMETRIC)
        m.fields(J=J, **{f"sigma_{AXES[i]}{AXES[k]}": cauchy[i, k] for i, k in shown})


def material(function: Callable[[Material], object]) -> Law:
    """The law that a function writes: a decorator."""
    name = function.__name__
    if not NAME.fullmatch(name):
        raise ModelError(f"a material is called {name!r}; use letters, digits and underscores")
    return Law(name, " ".join((function.__doc__ or "").split()), function)
