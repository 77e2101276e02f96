"""The model of a page: declared symbols, named intermediates, one potential or weak form.

A model page declares its arguments, writes its mathematics in SymPy, and ends with `potential` or
`weak_form`.  Nothing is differentiated here; `codegen.pipeline` does that.

`Model` is what a page may say; `model_builder.ModelBuilder` owns the parts that hold it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import sympy as sp

from softehl.codegen.graph.term_reductions import Kind
from softehl.codegen.language import (
    external_functions,
    local_unknowns,
    run_time_functions,
    run_time_terms,
)
from softehl.codegen.language.definition import Argument, Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import CheckedList
from softehl.codegen.language.model_builder import ModelBuilder
from softehl.codegen.language.run_time_terms import TermArray

__all__ = ["Argument", "Definition", "Model"]


PARENT_NAMES = ("parent_xi", "parent_eta", "parent_zeta")
"""Names of parent coordinates where a page or a law may use the short ones itself."""


class Model(ModelBuilder):
    """Builder of a `Definition`; methods declare arguments, name values and add equations.

    Parameters
    ----------
    name : str
        Name of the model, part of the names of C functions.
    nodes : int
        Number of nodes of the element.
    rule : QuadratureRule, optional
        Quadrature; one point without coordinates if left out.
    unroll : bool, optional
        True: the loop over the points of `rule` is always written out, and the rule is part of the
        kernel. False: never; `rule` is the default of a kernel that takes any rule. Left out, it is
        written out where that saves operations.
    doc : str
        Description of the model.

    Raises
    ------
    ModelError
        The name is not allowed.
    """

    _parent_names = ("xi", "eta", "zeta")
    _varying_points = True

    # declarations -------------------------------------------------------------------------------

    def coordinates(self, *names: str) -> list[list[sp.Symbol]]:
        """Declare reference coordinates, of any number of components.

        Parameters
        ----------
        *names : str
            Components, such as "X", "Y".

        Returns
        -------
        list of list of Symbol
            [component][node].
        """
        return self._arguments.declare_coordinates(names)

    def nodal_unknowns(
        self, *names: str, idle: Sequence[str] = (), nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Declare unknowns at the nodes, numbered node by node.

        Parameters
        ----------
        *names : str
            Components, such as "u_x", "u_y".
        idle : sequence of str
            Those of `names` that need not occur in the mathematics.
        nodes : int, optional
            Number of the first nodes that have them, for instance a pressure at the corners of a
            quadratic cell; all nodes if left out.

        Returns
        -------
        list of list of Symbol
            [component][node].
        """
        return self._arguments.nodal_unknowns(names, idle, nodes)

    def unknown(self, name: str) -> sp.Symbol:
        """Declare one more scalar unknown of the element.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Symbol
            The unknown.
        """
        return self._arguments.unknown(name)

    def internal(self, name: str, count: int | None = None) -> Any:
        """Declare internal unknowns of an element, which no other element shares.

        Parameters
        ----------
        name : str
            Name; of several unknowns name_0, name_1, ...
        count : int, optional
            Number of unknowns; one symbol if left out.

        Returns
        -------
        Symbol or list of Symbol
            The unknowns.

        Raises
        ------
        ModelError
            `count` is no integer above zero.

        Notes
        -----
        A study eliminates them exactly (static condensation), stores their values with the element,
        and has them in `Result.fields`.
        """
        if count is None:
            return self._internal_unknowns([name])[0]
        if not (isinstance(count, int) and count > 0):
            raise ModelError(f"internal {name}: count = {count!r} must be an integer > 0")
        return self._internal_unknowns([f"{name}_{k}" for k in range(count)])

    def _internal_unknowns(self, names: Sequence[str]) -> list[sp.Symbol]:
        self._arguments.internal += names
        return CheckedList([self.unknown(name) for name in names], "the internal unknowns")

    def interpolated(self, name: str) -> tuple[sp.Symbol, sp.Symbol]:
        """Declare a field with any number of element unknowns (`modes`).

        Parameters
        ----------
        name : str
            Name of the field. Each further field has its own modes, after those of previous fields.

        Returns
        -------
        tuple of Symbol
            Value and derivative by xi.
        """
        return self.interpolated_sides(name)[0]

    def interpolated_sides(self, *names: str) -> list[tuple[sp.Symbol, sp.Symbol]]:
        """Declare fields that share the `modes` unknowns, such as two traces at an interior facet.

        Parameters
        ----------
        *names : str
            Names of the fields. The basis has both components of each field for every mode, zero
            where a mode belongs to another field.

        Returns
        -------
        list of tuple of Symbol
            Value and derivative by xi of each field.
        """
        return self._arguments.interpolated_sides(names)

    def parameters(self, /, **meanings: str) -> list[sp.Symbol]:
        """Declare parameters: arguments that are the same for all elements, or arrays in a study.

        Parameters
        ----------
        **meanings : str
            Name -> meaning, with its unit.

        Returns
        -------
        list of Symbol
            The parameters, in this order.
        """
        return [symbol for n, text in meanings.items() for symbol in self._parameter(n, text)]

    def _parameter(self, name: str, meaning: str) -> list[sp.Symbol]:
        """A parameter, or the data of elements or points that a study gives in its place."""
        array = self._arguments.varying.get(name)
        if array is None:
            return self._arguments.declare("parameters", {name: meaning})
        return (self.data if array == "data" else self.point_data)(**{name: meaning})

    def data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Declare data: arguments that differ from element to element.

        Parameters
        ----------
        **meanings : str
            Name -> meaning, with its unit.

        Returns
        -------
        list of Symbol
            The data, in this order.
        """
        return self._arguments.declare("data", meanings)

    def point_data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Declare data of the quadrature points, such as history variables.

        Parameters
        ----------
        **meanings : str
            Name -> meaning, with its unit.

        Returns
        -------
        list of Symbol
            The data, in this order.
        """
        return self._arguments.declare("point data", meanings, varying=True)

    def nodal_data(
        self, *names: str, meaning: str = "at the nodes", nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Declare data at the nodes: data name1, name2, ...

        Parameters
        ----------
        *names : str
            Names. A study fills `u_old` (of an unknown u) with the values of the previous step.
        meaning : str
            Meaning, with its unit.
        nodes : int, optional
            Number of the first nodes that have them; all nodes if left out.

        Returns
        -------
        list of list of Symbol
            [name][node].
        """
        return self._arguments.nodal_data(names, meaning, nodes)

    def rates(self, *names: str, order: int = 1) -> list[list[sp.Expr]]:
        """Return time derivatives of nodal unknowns.

        Parameters
        ----------
        *names : str
            Names of nodal unknowns.
        order : int
            1: du/dt = rate u + u_rate, with the parameter `rate` and the nodal data `u_rate`. 2:
            d2u/dt2 = acceleration u + u_acceleration. `Study.march` gives their values.

        Returns
        -------
        list of list of Expr
            [name][node].
        """
        return self._arguments.rates(names, order)

    def history(self, /, **new: Any) -> None:
        """Declare the values of `point_data` after a converged step: m.history(v_old=v).

        Parameters
        ----------
        **new : Expr
            Name of a point datum -> its new value, a field of the kernel called new_NAME.

        Raises
        ------
        ModelError
            There is no such point datum.
        """
        terms = [h.name for h in self._arguments.term_history]
        renewed = {name: value for name, value in new.items() if name in terms}
        others = {name: value for name, value in new.items() if name not in terms}
        declared = [*self._arguments.names("point data"), *terms]
        self._outputs.add_history(others, declared)
        history = self._arguments.term_history
        updates = run_time_terms.updates(self._symbols, history, renewed)
        self._outputs.add_term_history(updates)

    def require(self, *conditions: Any) -> None:
        """Require conditions on parameters and data, such as `mu > 0`; every call checks them.

        Parameters
        ----------
        *conditions : Relational
            Each compares one parameter or datum with a number by <, <=, > or >=.

        Raises
        ------
        ModelError
            A condition has another form.
        """
        self._arguments.require(conditions)

    def point(self) -> list[sp.Symbol]:
        """Return the coordinates of the quadrature point in the reference cell.

        Returns
        -------
        list of Symbol
            xi, eta, zeta, as many as the rule has dimensions.
        """
        names = self._parent_names[: self.rule.dimension]
        point = [self._symbols.input(s, "rule", k, varying=True) for k, s in enumerate(names)]
        return CheckedList(point, "the point's coordinates")

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
        """Name an intermediate value, scalar or matrix.

        Parameters
        ----------
        name : str
            Its name.
        expression : Expr or Matrix
            Its value.
        interface : bool
            True: derivatives are computed through this value by the chain rule.
        derivative : mapping of Symbol to Expr, optional
            Symbol -> derivative of the value in place of the true one.

        Returns
        -------
        Symbol or Matrix
            The name, as symbols.
        """
        return self._intermediates.define(
            name, expression, interface=interface, derivative=derivative
        )

    def norm(self, values: Any) -> Any:
        """Return the length of a scalar, list or matrix: the root of the sum of its squares.

        Parameters
        ----------
        values : Expr, list or Matrix
            The entries.

        Returns
        -------
        Expr
            The length.

        Notes
        -----
        Its first and second derivatives at zero are zero: a direction that does not exist
        contributes nothing. The squares of lengths below 1e-154 are zero.
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
        """Declare local unknowns s with equations(s) = 0, solved by Newton's method in the kernel.

        Parameters
        ----------
        name : str
            Name of the unknowns.
        equations : callable
            Function of s that returns the residuals, in the form of s. Residuals that are integrals
            belong to the element: s is then the same at all of its points (condensation), and the
            rule is part of the kernel.
        start : Expr, list or Matrix
            Initial value, which gives s its form.
        tolerance : float
            The iteration ends when every residual is smaller than `tolerance` times its terms, and
            a step changes every s_k by at most `tolerance` (`size` + abs(s_k)), or by rounding
            only. The last step is applied, so that the error is of the order of its square.
        size : float
            Magnitude of s_k below which it is insignificant.
        iterations : int
            Largest number of steps; after it all outputs of the element are nan.

        Returns
        -------
        Symbol, list or Matrix
            s. Its derivatives follow from the implicit function theorem, for any `start`.

        Raises
        ------
        ModelError
            The residuals have another form than `start`.
        """
        iteration = local_unknowns.Iteration(tolerance, size, iterations)
        condensed = partial(self._condensed, name)
        return local_unknowns.implicit(self._symbols, name, equations, start, iteration, condensed)

    def principal(self, name: str, C: Any, energy: Any = None) -> sp.Symbol:
        """Return an isotropic energy of the principal stretches.

        Parameters
        ----------
        name : str
            Name of the energy.
        C : Matrix
            Symmetric right Cauchy-Green tensor (3, 3); the stretches are the roots of its
            eigenvalues.
        energy : callable
            Function energy(lambda_1, lambda_2, lambda_3), symmetric in its arguments.

        Returns
        -------
        Symbol
            The energy. Its first and second derivatives by C are exact to rounding, also at equal
            or nearly equal stretches.

        Raises
        ------
        ModelError
            C has a wrong shape, or the energy is not symmetric.
        """
        return local_unknowns.principal(self._symbols, name, C, energy)

    def external(
        self,
        name: str,
        inputs: Any,
        *,
        outputs: Any = 1,
        source: Any = None,
        derivatives: int | None = None,
        function: str | None = None,
    ) -> Any:
        """Return the values of a C function of the user.

        Parameters
        ----------
        name : str
            Name of the values, and of the function in C.
        inputs : Expr, list or Matrix
            Arguments x of the function, row by row where they are matrices.
        outputs : int or tuple of int
            Number of values y; 1 gives a scalar, (3, 3) a matrix.
        source : str, Path or function, optional
            C file beside the page, or its text; or a function of ctypes, cffi or Numba of this
            process. Left out: such a function is given to `Study.add(name=...)`.
        derivatives : int, optional
            Highest order of derivatives that the function returns, 0, 1 or 2; 1 if left out, 0 for
            a function of `double complex`.
        function : str, optional
            Name in C, if it is another one than `name`.

        Returns
        -------
        Symbol, list or Matrix
            The values.

        Raises
        ------
        ModelError
            The file, the function or a count is missing or wrong.

        Notes
        -----
        The prototype is `int law(const double *x, double *y, double *dy, double *ddy)`, with dy
        [outputs][inputs] and ddy [outputs][inputs][inputs] where they are not NULL. It returns 0,
        or another number where there is no value. With `double complex` instead of `double` the
        derivatives of the next order follow by complex steps. Threads call it at the same time.
        """
        what = function or name
        at = external_functions.given_address(name, source)
        prototype = external_functions.Prototype(what, outputs, derivatives, source, at)
        address = [] if prototype.has_text else [self._address(what, at)]
        return external_functions.external_values(self._symbols, name, inputs, prototype, address)

    def table(
        self,
        name: str,
        argument: Any,
        *,
        meaning: str = "",
        interpolation: str = "linear",
        outside: str = "constant",
    ) -> sp.Symbol:
        """Return the value of a curve whose points are given with each call.

        Parameters
        ----------
        name : str
            Name of the curve, by which `Study.add` gets its points: k=([20, 100], [1.2, 1.1]).
            Several calls with one name are values of one curve.
        argument : Expr
            Where it is evaluated.
        meaning : str
            Meaning of its values, with their unit.
        interpolation : str
            "linear", "pchip" (monotone cubic) or "spline" (C2 cubic), unless the curve says so.
        outside : str
            Before the first point and behind the last: "constant", "linear", or "error": not a
            number; unless the curve says so.

        Returns
        -------
        Symbol
            The value. All of its derivatives are exact.

        Raises
        ------
        ModelError
            There is no such interpolation.
        """
        return run_time_functions.table(
            self._symbols,
            self._arguments.array,
            name,
            argument,
            meaning=meaning,
            interpolation=interpolation,
            outside=outside,
        )

    def array(self, name: str, meaning: str = "") -> TermArray:
        """Declare an array with one number for each term of a sum, as many as each call gives.

        Parameters
        ----------
        name : str
            Name, by which `Study.add` gets its numbers: g=[0.3, 0.2, 0.1].
        meaning : str
            Meaning of its numbers, with their unit.

        Returns
        -------
        TermArray
            The array, for `sum`, `product`, `minimum` and `maximum`.

        Raises
        ------
        ModelError
            The name belongs to something else.
        """
        return run_time_terms.array(self._symbols, self._arguments.array, name, meaning)

    def sum(self, *arrays_and_function: Any) -> Any:
        """Return the sum of a function of the entries of arrays over their terms.

        Parameters
        ----------
        *arrays_and_function : TermArray, then callable
            Arrays of equal length, or lists of them, and a function of one entry of each, as in
            m.sum(g, tau, lambda g, tau: g * exp(-t / tau)). It returns a scalar, list or matrix.

        Returns
        -------
        Symbol, list or Matrix
            The sum. Its derivatives are exact, also by the entries.

        Raises
        ------
        ModelError
            An argument is no array, or the last one no function.

        Notes
        -----
        The kernel has one loop over the terms, whatever their number is.
        """
        return self._reduced(Kind.SUM, arrays_and_function)

    def point_array(self, name: str, terms: TermArray, meaning: str = "") -> TermArray:
        """Declare history of each term: data of each point with one number for each term.

        Parameters
        ----------
        name : str
            Its name. `Study.add` takes a value at the start for all terms; zero if left out.
        terms : TermArray
            Array whose length it has.
        meaning : str
            Meaning, with its unit.

        Returns
        -------
        TermArray
            The history, for `sum`, `each` and the like. `history` renews it.

        Raises
        ------
        ModelError
            `terms` is no array, or the name belongs to something else.
        """
        declare = partial(self._arguments.point_array, varying=self._varying_points)
        return run_time_terms.point_array(self._symbols, declare, name, terms, meaning)

    def each(self, *arrays_and_function: Any) -> Any:
        """Return new history of each term, for `history`.

        Parameters
        ----------
        *arrays_and_function : TermArray, then callable
            Arrays, and a function of one entry of each. It returns a scalar or a list.

        Returns
        -------
        NewTerms or list of NewTerms
            The values, as in m.history(h=m.each(tau, h, lambda tau, h: h * exp(-dt / tau))).

        Raises
        ------
        ModelError
            An argument is no array, or the last one no function.
        """
        groups = self._arguments.term_groups
        return run_time_terms.each(self._symbols, groups, arrays_and_function)

    def _reduced(self, kind: Kind, arguments: Sequence[Any]) -> Any:
        groups = self._arguments.term_groups
        return run_time_terms.reduced(self._symbols, groups, kind, arguments)

    def product(self, *arrays_and_function: Any) -> Any:
        """Return the product of a function of the entries of arrays over their terms; as `sum`.

        Parameters
        ----------
        *arrays_and_function : TermArray, then callable
            Arrays of equal length, and a function of one entry of each.

        Returns
        -------
        Symbol, list or Matrix
            The product. Its derivatives are exact where a factor is zero, too.

        Raises
        ------
        ModelError
            An argument is no array, or the last one no function.
        """
        return self._reduced(Kind.PRODUCT, arrays_and_function)

    def minimum(self, *arrays_and_function: Any) -> Any:
        """Return the smallest value of a function of the entries of arrays; as `sum`.

        Parameters
        ----------
        *arrays_and_function : TermArray, then callable
            Arrays of equal length, and a function of one entry of each.

        Returns
        -------
        Symbol, list or Matrix
            The smallest value; its derivatives are those of the first such term.

        Raises
        ------
        ModelError
            An argument is no array, or the last one no function.
        """
        return self._reduced(Kind.MINIMUM, arrays_and_function)

    def maximum(self, *arrays_and_function: Any) -> Any:
        """Return the largest value of a function of the entries of arrays; as `sum`.

        Parameters
        ----------
        *arrays_and_function : TermArray, then callable
            Arrays of equal length, and a function of one entry of each.

        Returns
        -------
        Symbol, list or Matrix
            The largest value; its derivatives are those of the first such term.

        Raises
        ------
        ModelError
            An argument is no array, or the last one no function.
        """
        return self._reduced(Kind.MAXIMUM, arrays_and_function)

    def network(
        self,
        name: str,
        inputs: Sequence[Any],
        *,
        layers: Sequence[int] = (16, 16),
        activation: str = "softplus",
        convex: bool = False,
        monotone: bool = False,
        meaning: str = "",
    ) -> sp.Symbol:
        """Return the value of a network whose weights are given with each call.

        Parameters
        ----------
        name : str
            Name of its weights, by which `Study.add` gets them: W=[(W1, b1), (W2, b2), (W3, b3)]
            with weights (to, from) and biases (to,) of each layer, a `state_dict` of PyTorch,
            parameters of Flax, or all numbers in one array.
        inputs : list of Expr
            What it sees.
        layers : sequence of int
            Widths of the hidden layers.
        activation : str
            "softplus", "softplus_squared", "tanh" or "sigmoid", of all hidden layers.
        convex : bool
            True: an input-convex network. Hidden layers and the result see the inputs, too, with
            weights of their own, and weights of hidden values must not be negative.
        monotone : bool
            True, of a convex one: no weight is negative, so that it increases with each input.
        meaning : str
            Meaning of its value, with the unit.

        Returns
        -------
        Symbol
            The value. Its first and second derivatives are exact.

        Raises
        ------
        ModelError
            A width is no integer above zero, or there is no such activation.
        """
        return run_time_functions.network(
            self._symbols,
            self._arguments.array,
            name,
            inputs,
            layers=layers,
            activation=activation,
            convex=convex,
            monotone=monotone,
            meaning=meaning,
        )

    # functions of tensors -----------------------------------------------------------------------

    def isotropic(self, C: Any, f: Callable[[Any], Any]) -> Any:
        """Return a function of a symmetric tensor: the sum of f(c_a) n_a n_a.

        Parameters
        ----------
        C : Matrix
            Symmetric tensor (2, 2) or (3, 3) with eigenvalues c_a and eigenvectors n_a.
        f : callable
            Function of one eigenvalue, such as `lambda x: sp.Max(x, 0)`.

        Returns
        -------
        Matrix
            Symmetric tensor of the shape of C.

        Raises
        ------
        ModelError
            C has a wrong shape or is not symmetric, or f has no divided differences.

        Notes
        -----
        First and second derivatives are exact to rounding, also at equal or nearly equal
        eigenvalues. They are divided differences of f (Ju. L. Daleckii, S. G. Krein, AMS
        Translations (2) 47 (1965) 1). Where a condition in f holds at one of two eigenvalues only,
        they are quotients of the two values.
        """
        return self._tensors.isotropic("isotropic", C, f)

    def log(self, C: Any) -> Any:
        """Return the logarithm of a symmetric positive definite tensor.

        Parameters
        ----------
        C : Matrix
            (2, 2) or (3, 3), such as F.T * F.

        Returns
        -------
        Matrix
            Of the shape of C, see `isotropic`. Hencky's strain is m.log(F.T * F) / 2.
        """
        return self._tensors.isotropic("log", C, sp.log)

    def sqrt(self, C: Any) -> Any:
        """Return the square root of a symmetric positive definite tensor.

        Parameters
        ----------
        C : Matrix
            (2, 2) or (3, 3), such as F.T * F.

        Returns
        -------
        Matrix
            Of the shape of C, see `isotropic`. The right stretch tensor is m.sqrt(F.T * F).
        """
        return self._tensors.isotropic("sqrt", C, sp.sqrt)

    def power(self, C: Any, exponent: Any) -> Any:
        """Return a power of a symmetric tensor.

        Parameters
        ----------
        C : Matrix
            (2, 2) or (3, 3), positive definite unless the exponent is a positive whole number.
        exponent : number or Expr
            A number, a parameter, or another expression.

        Returns
        -------
        Matrix
            Of the shape of C, see `isotropic`.
        """
        return self._tensors.isotropic("power", C, lambda c: c**exponent)

    def exp(self, A: Any) -> Any:
        """Return the exponential of a matrix, which need not be symmetric.

        Parameters
        ----------
        A : Matrix
            (2, 2) or (3, 3).

        Returns
        -------
        Matrix
            Of the shape of A. Of a symmetric A as `isotropic`, of others by scaling and squaring,
            with derivatives exact to rounding.

        Raises
        ------
        ModelError
            A has a wrong shape.
        """
        return self._tensors.exponential(A)

    def eigenvalues(self, C: Any) -> tuple[Any, ...]:
        """Return the eigenvalues of a symmetric tensor, the largest first.

        Parameters
        ----------
        C : Matrix
            (2, 2) or (3, 3).

        Returns
        -------
        tuple of Symbol
            Two or three.

        Notes
        -----
        They are no smooth functions of C where two of them are equal: first derivatives are then
        those along the computed eigenvectors, and the second derivatives, which grow as the
        reciprocal of the distance, leave the pair out. What is symmetric in the eigenvalues is
        smooth by `isotropic` and `principal`.
        """
        return self._tensors.eigenvalues(C)

    # functions that are smooth at zero ----------------------------------------------------------

    def sinc(self, x: Any) -> Any:
        """Return sin(x) / x, which is 1 at zero.

        Parameters
        ----------
        x : Expr
            A scalar.

        Returns
        -------
        Symbol
            The value. Derivatives of any order are exact to rounding at every x.

        Raises
        ------
        ModelError
            x is no scalar.
        """
        return self._smooth.sinc(x)

    def cosc(self, x: Any) -> Any:
        """Return (1 - cos(x)) / x^2, which is 1/2 at zero.

        Parameters
        ----------
        x : Expr
            A scalar.

        Returns
        -------
        Expr
            The value. Derivatives of any order are exact to rounding at every x.

        Raises
        ------
        ModelError
            x is no scalar.
        """
        return self._smooth.cosc(x)

    def rotation(self, w: Any) -> Any:
        """Return the rotation by an angle |w| about the axis w (Rodrigues).

        Parameters
        ----------
        w : list or Matrix
            Rotation vector, three entries.

        Returns
        -------
        Matrix
            Orthogonal matrix (3, 3), the exponential of the skew matrix of w. Derivatives of any
            order are exact to rounding, also at w = 0.

        Raises
        ------
        ModelError
            w has another number of entries.
        """
        return self._smooth.rotation(w)

    def rotation_vector(self, R: Any, *, branches: bool = True) -> Any:
        """Return the rotation vector of a rotation, the inverse of `rotation`.

        Parameters
        ----------
        R : Matrix
            Rotation (3, 3).
        branches : bool
            False: one formula in place of four, for rotations well below half a turn, such as those
            between the nodes of an element; digits are lost near half a turn.

        Returns
        -------
        Matrix
            (3, 1), of a length of at most pi. Derivatives are exact to rounding; across half a turn
            the vector changes its sign.

        Raises
        ------
        ModelError
            R has another shape.
        """
        return self._smooth.rotation_vector(R, branches=branches)

    def derivative(self, name: str, value: Any, by: Any) -> Any:
        """Return derivatives of a scalar, such as P = dW/dF.

        Parameters
        ----------
        name : str
            Name of the derivative.
        value : Expr
            The scalar.
        by : Symbol, list or Matrix
            Symbols of `define` or of arguments. Entries of a matrix that are one symbol share its
            derivative, so that dW = P_ij dF_ij.

        Returns
        -------
        Symbol, list or Matrix
            In the form of `by`.

        Raises
        ------
        ModelError
            An entry of `by` is no such symbol.
        """
        return self._intermediates.derivative(name, value, by)

    def integral(self, name: str, integrand: Any) -> sp.Symbol:
        """Return the integral over the reference cell by quadrature.

        Parameters
        ----------
        name : str
            Name of the integral.
        integrand : Expr
            Value at the point, including the Jacobian.

        Returns
        -------
        Symbol
            The integral.
        """
        directions = self._arguments.directions
        return self._equations.integral(name, integrand, self.weight, directions)

    def measure(self, detJ: Any, gradients: Iterable[Any]) -> None:
        """Declare the factor of all integrands, and the names that only divide by it.

        Parameters
        ----------
        detJ : Expr
            Jacobian; a warning names an integrand without it.
        gradients : iterable of Expr
            Gradients of shape functions, which have the Jacobian in a denominator.

        Notes
        -----
        `softehl.kinematics` calls it.
        """
        self._equations.measure(detJ, gradients)

    def potential(self, expression: Any, *, constant: Iterable[Any] = ()) -> None:
        """Add the gradient of an expression to the residual; further ones add up.

        Parameters
        ----------
        expression : Expr
            The potential.
        constant : iterable of Symbol
            Symbols without variation.
        """
        self._equations.potential(expression, constant)

    def weak_form(self, terms: Sequence[tuple[Any, Any]]) -> None:
        """Add the integral of sum(factor * variation of varied) to the residual.

        Further weak forms and potentials add up.

        Parameters
        ----------
        terms : sequence of tuple
            Pairs (factor, varied).
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
        """Declare quantities that are evaluated at the quadrature points; further calls add more.

        Parameters
        ----------
        **values : Expr
            Name -> value.
        """
        self._outputs.add_fields(values)

    def probe(self, name: str, value: Any) -> Any:
        """Record a value for explanations; the mathematics and the kernel do not change.

        Parameters
        ----------
        name : str
            Its name in `Kernel.explain` and `Study.explain`.
        value : Expr or Matrix
            The value; of a matrix name_00, name_01, ...

        Returns
        -------
        Expr or Matrix
            The value itself.
        """
        return self._outputs.probe(name, value)

    def offer(
        self,
        *,
        tasks: Sequence[str] | None = None,
        product: bool = False,
        pseudo_load: bool = False,
        fields_rate: bool = False,
        derivatives: Sequence[Any] = (),
    ) -> None:
        """Select what is generated; further calls add up.

        Parameters
        ----------
        tasks : sequence of str, optional
            Of energy, residual, tangent (with the residual), fields and product; all but the
            product if left out.
        product : bool
            Add the product of the tangent with a vector.
        pseudo_load : bool
            Add the derivative of the residual along a variation of coordinates, data and
            parameters, for sensitivities.
        fields_rate : bool
            Add that of the fields.
        derivatives : sequence of Symbol
            Parameters, data or coordinates by which the residual is differentiated.

        Raises
        ------
        ModelError
            There is no such task or argument.
        """
        self._outputs.choose(tasks, product=product)
        self._outputs.pseudo_load |= pseudo_load
        self._outputs.fields_rate |= fields_rate
        self._outputs.derive_by(derivatives)

    def example(self, /, **values: float) -> None:
        """Give values near which the model makes sense; the check of its kernel starts there.

        Parameters
        ----------
        **values : float
            Names of parameters, data, unknowns (`u_x1`) and coordinates (`X1`) -> values. Others
            are about 1 (parameters, data), a few per cent (unknowns), the unit cell (coordinates).

        Raises
        ------
        ModelError
            There is no such argument.
        """
        self._arguments.set_example(values)
