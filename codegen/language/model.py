"""The model of a page: declared symbols, named intermediates, one potential or weak form.

A model page declares its arguments, writes its mathematics in SymPy, and ends with `potential` or
`weak_form`.  Nothing is differentiated here; `codegen.pipeline` does that.

`Model` is what a page may say; `draft.Draft` owns the parts that keep it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import sympy as sp

from softehl.codegen.language import local
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.definition import Argument, Definition
from softehl.codegen.language.draft import Draft
from softehl.codegen.language.entries import Listed

__all__ = ["Argument", "Definition", "Model"]


PARENT_NAMES = ("parent_xi", "parent_eta", "parent_zeta")
"""Names of parent coordinates where a page or a law may use the short ones itself."""


class Model(Draft):
    """Builder of a `Definition`; every method declares or names something.

    The generator writes the loop over the points of `rule` out where that saves operations; the
    rule is then part of the kernel.  With unroll=False it never does, and `rule` is the default of
    a kernel that takes any; with unroll=True it always does.
    """

    _parent_names = ("xi", "eta", "zeta")

    # declarations -------------------------------------------------------------------------------

    def coordinates(self, *names: str) -> list[list[sp.Symbol]]:
        """Reference coordinates, any number of components: a list over the nodes for each."""
        return self._arguments.declare_coordinates(names)

    def nodal_unknowns(
        self, *names: str, idle: Sequence[str] = (), nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Unknowns at the nodes, numbered node by node; one list for each component.

        The `idle` ones of `names` belong to the node but need not enter the mathematics. nodes:
        at the first so many nodes only, such as a pressure at the corners of a quadratic cell.
        """
        return self._arguments.nodal_unknowns(names, idle, nodes)

    def unknown(self, name: str) -> sp.Symbol:
        """One more scalar unknown of the element."""
        return self._arguments.unknown(name)

    def internal(self, name: str, count: int | None = None) -> Any:
        """One unknown of an element, or a list of so many, called name_0, name_1, ...

        No other element knows them. A study condenses them from its equations exactly, keeps their
        values with the element, and has them in `result.fields`.
        """
        if count is None:
            return self._internal_unknowns([name])[0]
        if not (isinstance(count, int) and count > 0):
            raise ModelError(f"internal {name}: count = {count!r} must be an integer > 0")
        return self._internal_unknowns([f"{name}_{k}" for k in range(count)])

    def _internal_unknowns(self, names: Sequence[str]) -> list[sp.Symbol]:
        self._arguments.internal += names
        return Listed([self.unknown(name) for name in names], "the internal unknowns")

    def interpolated(self, name: str) -> tuple[sp.Symbol, sp.Symbol]:
        """Value and xi-derivative of a field with any number of element unknowns (`modes`).

        Each further field has modes of its own, which follow those of the fields before it.
        """
        return self.interpolated_sides(name)[0]

    def interpolated_sides(self, *names: str) -> list[tuple[sp.Symbol, sp.Symbol]]:
        """Value and xi-derivative of several fields that share the `modes` unknowns.

        An interior facet has two: the traces from its sides.  The basis holds both components
        of each field for every mode, zero where a mode belongs to another field.
        """
        return self._arguments.interpolated_sides(names)

    def parameters(self, /, **meanings: str) -> list[sp.Symbol]:
        """Arguments that are the same for all elements of a call."""
        return self._arguments.declare("parameters", meanings)

    def data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Arguments that differ from element to element."""
        return self._arguments.declare("data", meanings)

    def point_data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Arguments that differ from quadrature point to point, e.g. history variables."""
        return self._arguments.declare("point data", meanings, varying=True)

    def nodal_data(
        self, *names: str, meaning: str = "at the nodes", nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Data at the (first) nodes: a list over the nodes for each name, data name1, name2, ...

        A study fills `u_old` (for an unknown u) with the values of the step before.
        """
        return self._arguments.nodal_data(names, meaning, nodes)

    def rates(self, *names: str, order: int = 1) -> list[list[sp.Expr]]:
        """Time derivatives of nodal unknowns, in the order of `nodal_unknowns`.

        du/dt = rate u + u_rate, with the parameter `rate` and the data `u_rate` at the nodes;
        order=2: d2u/dt2 = acceleration u + u_acceleration. `Study.march` gives them.
        """
        return self._arguments.rates(names, order)

    def history(self, /, **new: Any) -> None:
        """Declare new values of `point_data` after a converged step: m.history(v_old=v).

        Each is a field of the kernel, named new_v_old.
        """
        self._outputs.add_history(new, self._arguments.names("point data"))

    def require(self, *conditions: Any) -> None:
        """Require conditions on parameters and data, e.g. `mu > 0`; checked at every call.

        Each condition compares one parameter or datum with a number by <, <=, > or >=.
        """
        self._arguments.require(conditions)

    def point(self) -> list[sp.Symbol]:
        """Coordinates of the quadrature point in the parent element."""
        names = self._parent_names[: self.rule.dimension]
        point = [self._symbols.input(s, "rule", k, varying=True) for k, s in enumerate(names)]
        return Listed(point, "the point's coordinates")

    @property
    def weight(self) -> sp.Symbol:
        """Weight of the quadrature point."""
        return self._symbols.input("weight", "rule", self.rule.dimension, varying=True)

    # mathematics --------------------------------------------------------------------------------

    def define(
        self,
        name: str,
        expression: Any,
        *,
        interface: bool = False,
        derivative: Mapping[sp.Symbol, Any] | None = None,
    ) -> Any:
        """Name an intermediate (scalar or matrix); returns its symbol or matrix of symbols.

        A `interface` intermediate is one that derivatives are taken through.  `derivative` replaces
        the true derivative by given ones with respect to chosen symbols.
        """
        return self._intermediates.define(
            name, expression, interface=interface, derivative=derivative
        )

    def norm(self, values: Any) -> Any:
        """Length of a scalar, list or matrix: the root of the sum of its squares.

        If it is zero, its first and second derivatives are zero too: a direction that does not
        exist contributes nothing.  (Of lengths below 1e-154 the squares are zero.)
        """
        return self._intermediates.norm(values)

    def implicit(
        self,
        name: str,
        equations: Callable[[Any], Any],
        *,
        start: Any,
        tolerance: float = 1e-10,
        size: float = 0.0,
        iterations: int = 25,
    ) -> Any:
        """Local unknowns s with equations(s) = 0, found by Newton's method inside the kernel.

        Equations that are integrals belong to the element: s is then one for all of its points
        (condensation), and the rule becomes part of the kernel.

        `start` is where the iteration begins: a scalar, a list, or a matrix, and s is alike; so is
        what `equations` returns.  Derivatives of s follow from the implicit function theorem,
        whatever the start.  The iteration ends when every equation is solved to `tolerance` of its
        own terms and a step changes every s_k by no more than `tolerance` (`size` + |s_k|), or by
        nothing but rounding; `size` is a magnitude of s_k below which it does not matter. The last
        step is taken, so that the error is of the order of its square.  Without success after
        `iterations` steps all outputs of the element are not-a-number.
        """
        iteration = local.Iteration(tolerance, size, iterations)
        condensed = partial(self._condensed, name)
        return local.implicit(self._symbols, name, equations, start, iteration, condensed)

    def principal(self, name: str, C: Any, energy: Any = None) -> sp.Symbol:
        """An isotropic energy of the principal stretches: energy(lambda_1, lambda_2, lambda_3).

        C is the symmetric right Cauchy-Green matrix, 3x3, the stretches are the roots of its
        eigenvalues, and `energy` must not change when they are exchanged.  First and second
        derivatives by C are exact to rounding also where stretches are equal or nearly so.
        """
        return local.principal(self._symbols, name, C, energy)

    def derivative(self, name: str, value: Any, by: Any) -> Any:
        """Derivatives of a scalar by one named symbol, a list or a matrix of them, e.g. P = dW/dF.

        The symbols are those of `define` or of arguments; all else is differentiated through.
        Entries of a matrix that are one symbol share its derivative, so that dW = P_ij dF_ij.
        """
        return self._intermediates.derivative(name, value, by)

    def integral(self, name: str, integrand: Any) -> sp.Symbol:
        """Quadrature of `integrand` over the parent element."""
        directions = self._arguments.directions
        return self._equations.integral(name, integrand, self.weight, directions)

    def measure(self, detJ: Any, gradients: Iterable[Any]) -> None:
        """Say what an integrand is multiplied by, and which names only divide by it.

        `kinematics` does; an integrand without such a factor is warned of.
        """
        self._equations.measure(detJ, gradients)

    def potential(self, expression: Any, *, constant: Iterable[Any] = ()) -> None:
        """The residual is the gradient of `expression` with the `constant` symbols frozen.

        Further potentials and weak forms add up.
        """
        self._equations.potential(expression, constant)

    def weak_form(self, terms: Sequence[tuple[Any, Any]]) -> None:
        """Residual = integral of sum(factor * variation of varied) over (factor, varied).

        Further weak forms and potentials add up.
        """
        density, frozen = sp.Integer(0), []
        for factor, varied in terms:
            label = self._equations.numbered("factor")
            frozen.append(self.define(label, factor, interface=True))
            density += frozen[-1] * varied
        work = self.integral(self._equations.label_of_work(), density)
        self.potential(work, constant=frozen)

    # what is made of it -------------------------------------------------------------------------

    def fields(self, /, **values: Any) -> None:
        """Quantities to be evaluated at the quadrature points; further calls add more."""
        self._outputs.add_fields(values)

    def offer(
        self,
        *,
        tasks: Sequence[str] | None = None,
        product: bool = False,
        pseudo_load: bool = False,
        fields_rate: bool = False,
        derivatives: Sequence[Any] = (),
    ) -> None:
        """Choose what is generated: tasks by name, derivatives of the residual by argument.

        `tasks` are chosen among energy, residual, tangent (residual and tangent together), fields
        and product; left out, all but the product.  `product` adds the tangent times a vector.
        `pseudo_load` adds the derivative of the residual along a variation of coordinates, data
        and parameters, `fields_rate` that of the fields: for sensitivities of what a study
        computes.  `derivatives` lists symbols of parameters, data or coordinates.  Further calls
        add up.
        """
        self._outputs.choose(tasks, product=product)
        self._outputs.pseudo_load |= pseudo_load
        self._outputs.fields_rate |= fields_rate
        self._outputs.derive_by(derivatives)

    def example(self, /, **values: float) -> None:
        """Values near which the model makes sense, by name; the check of its kernel starts there.

        Names of parameters, data, unknowns (`u_x1`) and coordinates (`X1`).  Values that are not
        named are about 1 (parameters, data), a few per cent (unknowns), the unit cell
        (coordinates).
        """
        self._arguments.set_example(values)
