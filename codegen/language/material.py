"""Material laws: an energy or a stress as a function of the deformation.

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

from softehl.codegen.language.definition import PointForm
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import AXES, Fields
from softehl.codegen.language.flatten import Matrix, call_function
from softehl.codegen.language.model import Model
from softehl.codegen.language.model_builder import NAME
from softehl.codegen.language.weak_form import Page

_SHOWN = {1: ((0, 0),), 2: ((0, 0), (1, 1), (2, 2), (0, 1))}
_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class Material:
    """Argument of the function of a stress law: the deformation, and calls that define the law.

    Attributes
    ----------
    name : str
        Name of the law.
    model : Model
        Model that the law is part of. Its `parameters`, `require`, `point_data`, `history`,
        `fields`, `norm`, `derivative`, `example`, `table`, `network`, `array`, `sum`, `product`,
        `minimum`, `maximum`, `point_array`, `each` and functions of tensors (`log`, `sqrt`, `exp`,
        `power`, `isotropic`, `eigenvalues`) and of rotations (`sinc`, `cosc`, `rotation`,
        `rotation_vector`) are methods here as well.
    W : Expr or None
        Energy per reference volume [MPa].
    P : Matrix or None
        First Piola-Kirchhoff stress (3, 3) [MPa].
    small : bool or None
        True for small strains, False for large ones, None before either is used.
    """

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
        self.table, self.network, self.array = model.table, model.network, model.array
        self.log, self.sqrt, self.exp, self.power = model.log, model.sqrt, model.exp, model.power
        self.isotropic, self.eigenvalues = model.isotropic, model.eigenvalues
        self.sum, self.product = model.sum, model.product
        self.minimum, self.maximum = model.minimum, model.maximum
        self.point_array, self.each = model.point_array, model.each
        self.sinc, self.cosc = model.sinc, model.cosc
        self.rotation, self.rotation_vector = model.rotation, model.rotation_vector

    @property
    def F(self) -> Any:
        """Deformation gradient (3, 3); makes the law one of large strains."""
        self._kinematics(small=False)
        return self._F

    @property
    def strain(self) -> Any:
        """Small strain (3, 3), the symmetric part of F - 1; makes the law one of small strains."""
        self._kinematics(small=True)
        return (self._F + self._F.T) / 2 - sp.eye(3)

    @property
    def green(self) -> Any:
        """Green's strain (F^T F - 1) / 2, (3, 3); makes the law one of large strains."""
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
        """Name an intermediate value, scalar or matrix.

        Parameters
        ----------
        name : str
            Its name.
        expression : Expr or Matrix
            Its value.

        Returns
        -------
        Symbol or Matrix
            The name, as symbols.
        """
        return self.model.define(f"{self.name}_{name}", expression)

    def probe(self, name: str, value: Any) -> Any:
        """Record a value for explanations, as `Model.probe`.

        Parameters
        ----------
        name : str
            Its name in `Kernel.explain` and `Study.explain`, after that of the material.
        value : Expr or Matrix
            The value.

        Returns
        -------
        Expr or Matrix
            The value itself.
        """
        return self.model.probe(f"{self.name}_{name}", value)

    def implicit(self, name: str, equations: Callable[[Any], Any], **settings: Any) -> Any:
        """Declare local unknowns, as `Model.implicit`.

        Parameters
        ----------
        name : str
            Name of the unknowns.
        equations : callable
            Function of the unknowns that returns their residuals.
        **settings
            `start`, `tolerance`, `size` and `iterations` of `Model.implicit`.

        Returns
        -------
        Symbol, list or Matrix
            The unknowns.
        """
        return self.model.implicit(f"{self.name}_{name}", equations, **settings)

    def principal(self, name: str, C: Any, energy: Any = None) -> Any:
        """Return an isotropic energy of principal stretches, as `Model.principal`.

        Parameters
        ----------
        name : str
            Name of the energy.
        C : Matrix
            m.F.T * m.F, or its isochoric part.
        energy : callable
            Function energy(lambda_1, lambda_2, lambda_3), symmetric in its arguments.

        Returns
        -------
        Symbol
            The energy.
        """
        return self.model.principal(f"{self.name}_{name}", C, energy)

    def external(self, name: str, inputs: Any, **prototype: Any) -> Any:
        """Return the values of a C function of the user, as `Model.external`.

        Parameters
        ----------
        name : str
            Name of the values, and of the function in C.
        inputs : Expr, list or Matrix
            Arguments of the function.
        **prototype
            `outputs`, `source`, `derivatives` and `function` of `Model.external`.

        Returns
        -------
        Symbol, list or Matrix
            The values.
        """
        prototype.setdefault("function", name)
        return self.model.external(f"{self.name}_{name}", inputs, **prototype)

    def energy(self, W: Any) -> None:
        """Define the energy; further energies add up.

        Parameters
        ----------
        W : Expr
            Energy per reference volume [MPa].

        Raises
        ------
        ModelError
            The law has a stress.
        """
        if self.P is not None:
            raise ModelError(f"the material {self.name} has a stress: it cannot have an energy too")
        self.W = W if self.W is None else self.W + W

    def stress(self, P: Any) -> None:
        """Define the stress; further stresses add up.

        Parameters
        ----------
        P : Matrix
            First Piola-Kirchhoff stress (3, 3) as a function of F, or the stress of a small strain
            [MPa].

        Raises
        ------
        ModelError
            The law has an energy, or P a wrong shape.
        """
        if self.W is not None:
            raise ModelError(f"the material {self.name} has an energy: it cannot have a stress too")
        P = self._square(P)
        self.P = P if self.P is None else self.P + P

    def second_stress(self, S: Any) -> None:
        """Define the second Piola-Kirchhoff stress of a law of large strains: P = F S.

        Parameters
        ----------
        S : Matrix
            (3, 3) [MPa].

        Raises
        ------
        ModelError
            The law has an energy, or S a wrong shape.
        """
        self.stress(self.F * self._square(S))

    def _square(self, P: Any) -> Any:
        if getattr(P, "shape", None) != (3, 3):
            shape = getattr(P, "shape", "that of a scalar")
            raise ModelError(f"{self.name}: the stress has shape {shape}, must be (3, 3)")
        return sp.Matrix(P)


@dataclass(frozen=True)
class Law:
    """Stress law that a function defines; made by `softehl.material`.

    Attributes
    ----------
    name : str
        Name of the law.
    doc : str
        Description.
    write : callable
        The function, which takes a `Material`.
    """

    name: str
    doc: str
    write: Callable[[Material], object]

    def on(self, model: Model, F: Any) -> Material:
        """Add the law to a model.

        Parameters
        ----------
        model : Model
            The model; the law's parameters become parameters of it.
        F : Matrix
            Deformation gradient (3, 3).

        Returns
        -------
        Material
            With its energy `W` or stress `P`.

        Raises
        ------
        ModelError
            The function defines no energy and no stress.
        """
        m = Material(self.name, model, F)
        call_function(self.name, self.write, m, write=f"`def {self.name}(m):`")
        if m.W is None and m.P is None:
            raise ModelError(f"the material {self.name} has neither m.energy(W) nor m.stress(P)")
        if m.small is None:
            raise ModelError(f"the material {self.name} uses neither m.F nor m.strain")
        return m

    def at(self, m: Fields, F: Any) -> tuple[Any, Any]:
        """Return the stress and the energy of the law on a page of fields.

        Parameters
        ----------
        m : Fields
            The page.
        F : Matrix
            Deformation gradient (3, 3).

        Returns
        -------
        P : Matrix
            First Piola-Kirchhoff stress (3, 3) [MPa].
        W : Expr or None
            Energy per reference volume [MPa].
        """
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
        """Return the page of a body of this material: equilibrium, and Cauchy stresses as fields.

        Returns
        -------
        Page
            The page, with the displacements u_x, u_y, u_z.
        """
        return Page(self.name, self._body, doc=self.doc, source=self.write)

    def at_point(self) -> PointForm:
        """Return the law at a point: its residual is P, its tangent dP/dF.

        Returns
        -------
        PointForm
            The unknowns are the components of the displacement gradient.
        """
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
        entries = _SHOWN.get(m.dimension, _SYMMETRIC)
        m.fields(J=J, **{f"sigma_{AXES[i]}{AXES[k]}": cauchy[i, k] for i, k in entries})


def material(function: Callable[[Material], object]) -> Law:
    """Make a stress law of a function: `@softehl.material`.

    Parameters
    ----------
    function : callable
        Function that takes a `Material`.

    Returns
    -------
    Law
        The law, for `Study.add(material=...)` and `Fields.stress`.

    Raises
    ------
    ModelError
        The name of the function is not allowed.
    """
    name = function.__name__
    if not NAME.fullmatch(name):
        raise ModelError(f"a material is called {name!r}; use letters, digits and underscores")
    return Law(name, " ".join((function.__doc__ or "").split()), function)
