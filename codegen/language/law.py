"""`@softehl.material`: a stress law by itself, which any page of fields can use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.language.definition import PointForm
from softehl.codegen.language.entries import applied
from softehl.codegen.language.fields import AXES, Fields
from softehl.codegen.language.lower import ModelError
from softehl.codegen.language.pages import Page

_SHOWN = {1: ((0, 0),), 2: ((0, 0), (1, 1), (2, 2), (0, 1))}
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class Law:
    """Argument of the function of a material: the deformation, and what a page has but fields.

    F: deformation gradient (3, 3), of names. It says energies or stresses, which add up.
    """

    def __init__(self, name: str, m: Fields, F: Any) -> None:
        self.name, self._m = name, m
        self.F = sp.Matrix(3, 3, lambda i, k: m.define(f"{name}_F_{i}{k}", F[i, k]))
        self.parameters, self.define, self.require = m.parameters, m.define, m.require
        self.point_data, self.history, self.fields = m.point_data, m.history, m.fields
        self.implicit, self.principal, self.norm = m.implicit, m.principal, m.norm
        self.derivative = m.derivative
        self._strain: Any = None
        self._energies: list[Any] = []
        self._stresses: list[Any] = []

    @property
    def strain(self) -> Any:
        """E = (F^T F - 1) / 2, Green's strain (3, 3)."""
        if self._strain is None:
            E = (self.F.T * self.F - sp.eye(3)) / 2
            names = {}
            for i, k in _SYMMETRIC:
                names[i, k] = names[k, i] = self.define(f"{self.name}_E_{i}{k}", E[i, k])
            self._strain = sp.Matrix(3, 3, lambda i, k: names[i, k])
        return self._strain

    def energy(self, density: Any) -> None:
        """Energy per reference volume, of F or the strain."""
        self._energies.append(sp.sympify(density))

    def stress(self, P: Any) -> None:
        """First Piola-Kirchhoff stress (3, 3), force per reference area."""
        self._stresses.append(self._square("stress", P))

    def second_stress(self, S: Any) -> None:
        """Second Piola-Kirchhoff stress (3, 3): P = F S."""
        self._stresses.append(self.F * self._square("second_stress", S))

    def _square(self, word: str, value: Any) -> Any:
        if getattr(value, "shape", None) != (3, 3):
            shape = getattr(value, "shape", "no matrix")
            raise ModelError(f"{word} of {self.name} has shape {shape}, must be (3, 3)")
        return value

    def finished(self) -> tuple[Any, Any]:
        """P, and the energy where the law is nothing else (None: it is not)."""
        if not (self._energies or self._stresses):
            raise ModelError(f"{self.name} has neither m.energy(W) nor m.stress(P)")
        P = sum(self._stresses, sp.zeros(3, 3))
        energy = sp.Add(*self._energies)
        if self._energies:
            P += self.derivative(f"{self.name}_dW", energy, self.F)
        return self.define(f"{self.name}_P", P), None if self._stresses else energy


@dataclass(frozen=True)
class Material:
    """A stress law: `write` says it, given a `Law`."""

    name: str
    write: Callable[[Law], Any]
    doc: str = ""

    def at(self, m: Fields, F: Any) -> tuple[Any, Any]:
        """P (3, 3) at F on a page, and the energy or None."""
        law = Law(self.name, m, F)
        applied(self.name, self.write, law)
        return law.finished()

    def page(self) -> Page:
        """A body of this material: displacements, equilibrium, Cauchy stresses as fields."""
        return Page(self.name, self._body, doc=self.doc)

    def at_point(self) -> PointForm:
        """The law by itself: its residual is P, its tangent dP/dF, by displacement gradients."""
        return self.page().at_point("hex8")

    def _body(self, m: Fields) -> None:
        F = m.deformation_gradient(m.vector("u"))
        P = m.stress(self, F)
        m.weak(P, F)
        J = m.define("volume_ratio", F.det(method="berkowitz"))
        cauchy = P * F.T / J
        shown = _SHOWN.get(m.dimension, _SYMMETRIC)
        m.fields(J=J, **{f"sigma_{AXES[i]}{AXES[k]}": cauchy[i, k] for i, k in shown})


def material(write: Callable[[Law], Any]) -> Material:
    """Make a stress law of a function that gets m, a `Law`: `@softehl.material`."""
    return Material(write.__name__, write, write.__doc__ or "")
