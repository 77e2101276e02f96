"""A nonlinear problem: assembled blocks, prescribed unknowns, reference sizes, and guards.

It satisfies the solvers' `MeasuredProblem` and `NamedProblem`. Continuation changes parameters,
prescribed values and guards: `with_parameters` and `with_fixed` give another problem on
the same assembler.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.constraints import Constraints, require_prescribed
from softehl.runtime.discretisation.dofmap import DofLayout
from softehl.runtime.discretisation.problem_checks import (
    ProblemError,
    in_order,
    require_known,
    unknown_name,
)
from softehl.runtime.discretisation.residual_norm import (
    ROUNDING,
    ResidualBalance,
    hides,
    is_far,
    residual_norm,
)
from softehl.runtime.discretisation.step_bounds import Guard
from softehl.runtime.suggestions import join_names, short_list


@dataclass(frozen=True, eq=False)
class Problem:
    """Assembled equations with prescribed unknowns.

    Parameters
    ----------
    assembler : Assembler
        The elements.
    layout : DofLayout
        Fields of the unknowns.
    parameters : mapping of str to array or mapping
        Block -> parameters, in the order of the kernel or by name; blocks without parameters are
        switched off.
    scales : mapping of str to float or array
        Field -> reference size of its residuals: a force [N], a flux [mm^2/s]. Left out, a
        residual is measured by the terms of its equation; else the stricter of both counts.
    fixed : array of int (k,)
        Prescribed unknowns. Their equations are x = value, and they are eliminated from others.
    values : array (k,)
        Their values.
    guards : tuple of Guard
        Bounds of a step.
    absolute : bool
        True: residuals are measured by `scales` alone, of which every field needs one.

    Raises
    ------
    ProblemError
        A name is unknown, a parameter is missing or not finite, or an unknown has two values.
    """

    assembler: Assembler
    layout: DofLayout
    parameters: Mapping[str, Any]
    scales: Mapping[str, float | Array] = field(default_factory=dict)
    fixed: Integers = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    values: Array = field(default_factory=lambda: np.empty(0))
    guards: tuple[Guard, ...] = ()
    absolute: bool = False

    def __post_init__(self) -> None:
        """Put parameters in order and refuse what makes no sense; see the class."""
        names = [block.name for block in self.assembler.blocks]
        require_known("block", self.parameters, names)
        require_known("field", self.scales, self.layout.names)
        if self.layout.total != self.assembler.size:
            raise ProblemError(
                f"the layout has {self.layout.total} unknowns, the assembler {self.assembler.size}"
            )
        missing = [name for name in self.layout.names if name not in self.scales]
        if self.absolute and missing:
            raise ProblemError(
                f"absolute scales: {join_names(missing)} has none; give one for each"
            )
        ordered = {n: in_order(self.assembler.block(n), v) for n, v in self.parameters.items()}
        object.__setattr__(self, "parameters", ordered)
        require_prescribed(self.fixed, self.values, self.layout.total, self.name_of)

    def __repr__(self) -> str:
        """Summary in one line."""
        return (
            f"<{type(self).__name__}: {self.layout.total} unknowns "
            f"({short_list(self.layout.names)}), "
            f"{len(self.fixed)} prescribed; blocks: {short_list(self.parameters)}>"
        )

    @cached_property
    def constraints(self) -> Constraints:
        """The map u = T z + g of prescribed values and ties."""
        return Constraints.of(self.assembler, self.fixed, self.values)

    def name_of(self, number: int) -> str:
        """Return an unknown in words: its number, field, element and place.

        Parameters
        ----------
        number : int
            Its number.

        Returns
        -------
        str
            For messages.
        """
        layout = self.layout
        field_name = next(n for n in layout.names if number < layout.part(n).stop)
        active = [block for block in self.assembler.blocks if block.name in self.parameters]
        element = unknown_name([*active, *self.assembler.blocks], number)
        return f"unknown {number} of field {field_name!r}{element}"

    def where_not_finite(self, x: Array) -> str:
        """Return the element whose residual or tangent is not finite, in words.

        Parameters
        ----------
        x : array (n,)
            Unknowns.

        Returns
        -------
        str
            Empty if there is none.
        """
        return self.assembler.not_finite(x, self.parameters)

    def at(self, x: Array) -> Problem:
        """Return the problem with the elements that it has at x, such as pairs in contact.

        Parameters
        ----------
        x : array (n,)
            Unknowns.

        Returns
        -------
        Problem
            The problem itself, unless elements depend on x.
        """
        return self

    def residual(self, x: Array) -> Array:
        """Return R(x): internal less external virtual work; x - value of prescribed unknowns.

        Parameters
        ----------
        x : array (n,)
            Unknowns.

        Returns
        -------
        array (n,)
            Residual.
        """
        r = self.assembler.residual(x, self.parameters)
        return self.constraints.residual(r, self.constraints.deviation(x))

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """Return R(x) and K = dR/dx, with prescribed unknowns eliminated.

        Parameters
        ----------
        x : array (n,)
            Unknowns. If they do not have the prescribed values, their influence on the other
            equations is in R, so that -K^-1 R is the exact Newton step.

        Returns
        -------
        residual : array (n,)
            Residual.
        tangent : sparse array (n, n)
            In CSC form.
        """
        return self.linearise_with(x, None)

    def linearise_with(
        self, x: Array, addition: Array | None
    ) -> tuple[Array, csc_array[np.float64]]:
        """Return R(x) and K as `linearise`, with an addition to K.

        Parameters
        ----------
        x : array (n,)
            Unknowns.
        addition : array (nnz,) or None
            Added to the entries of K before the elimination.

        Returns
        -------
        residual : array (n,)
            Residual.
        tangent : sparse array (n, n)
            In CSC form.
        """
        return self._linearised(x, addition, None)[:2]

    def linearise_along(self, x: Array, rate: Array) -> tuple[Array, csc_array[np.float64], Array]:
        """Return R(x) and K as `linearise`, and K times a vector before the elimination.

        Parameters
        ----------
        x : array (n,)
            Unknowns.
        rate : array (n,)
            The vector.

        Returns
        -------
        residual : array (n,)
            Residual.
        tangent : sparse array (n, n)
            In CSC form.
        product : array (n,)
            Zero for prescribed unknowns.
        """
        return self._linearised(x, None, rate)

    def _linearised(
        self, x: Array, addition: Array | None, rate: Array | None
    ) -> tuple[Array, csc_array[np.float64], Array]:
        r, K = self.assembler.linearise(x, self.parameters)
        if addition is not None:
            K.data += addition
        constraints, along = self.constraints, np.zeros_like(r)
        r = constraints.residual(r, constraints.deviation(x), lambda v: np.asarray(K @ v))
        if rate is not None and rate.any():
            along = np.asarray(K @ rate)
            along[self.fixed] = 0.0
        return r, self.eliminated(K), along

    def norm(self, r: Array) -> float:
        """Return the root of the sum over fields of |R / scale|^2.

        Parameters
        ----------
        r : array (n,)
            Residual; every field needs a scale.

        Returns
        -------
        float
            Norm.
        """
        return float(np.linalg.norm(self.scaled(r)))

    def scaled(self, r: Array) -> Array:
        """Return a residual divided by the reference sizes of its fields.

        Parameters
        ----------
        r : array (n,)
            Residual.

        Returns
        -------
        array (n,)
            `norm` is its 2-norm.
        """
        return r * self._weights

    @cached_property
    def _weights(self) -> Array:
        """One over the reference size of each residual, (n,)."""
        weights = np.zeros(self.layout.total)
        for name in self.layout.names:
            if name not in self.scales:
                raise ProblemError(f"field {name!r} has no scale: give one, it is needed here")
            weights[self.layout.part(name)] = 1.0 / np.asarray(self.scales[name])
        return weights

    def measure(self, x: Array, K: csc_array[np.float64] | None, *, rounded: bool = False) -> float:
        """Return the dimensionless size of the residual.

        Parameters
        ----------
        x : array (n,)
            Unknowns.
        K : sparse array (n, n) or None
            A tangent near x.
        rounded : bool
            Leave out what rounding may cause.

        Returns
        -------
        float
            inf if the residual is not finite. Every equation counts relative to its own terms,
            every field to its loads, reactions and internal forces; with `absolute` scales it is
            the norm.

        Raises
        ------
        ProblemError
            An unknown occurs in no block that is switched on.
        """
        self._require_determined()
        if self.absolute:
            r = self.residual(x)
            return self.norm(r) if np.isfinite(r).all() else np.inf
        r, forces = self.assembler.residual_and_size(x, self.parameters)
        if not np.isfinite(r).all():
            return np.inf
        noise, terms = np.zeros_like(r), np.zeros_like(r)
        if K is not None:
            if self._is_lost(x, forces, K):
                return 1.0
            terms = self._terms(np.abs(x), K)
            if rounded:
                noise = self.noise(x, K)
        prescribed, target = self.constraints.prescribed, self.constraints.admissible(x)
        defect = np.where(prescribed, 0.0, np.maximum(np.abs(r) - noise, 0.0))
        deviation, extent = x - target, np.maximum(np.abs(x), np.abs(target))
        met = prescribed | (self.assembler.counts(self.parameters) > 1)
        balance = ResidualBalance(defect, forces, terms, met, deviation, extent)
        norm = residual_norm(balance.squares(self.layout.fields), balance.worst())
        return max(norm, self._by_scales(defect))

    def merit(self, x: Array) -> float:
        """Return the norm of the residuals, each field relative to its forces.

        Parameters
        ----------
        x : array (n,)
            Unknowns.

        Returns
        -------
        float
            Norm.
        """
        if self.absolute:
            return self.norm(self.residual(x))
        r, forces = self.assembler.residual_and_size(x, self.parameters)
        r[self.fixed] = 0.0
        sizes = [[float(np.linalg.norm(v[f])) for v in (r, forces)] for f in self.layout.fields]
        return float(np.linalg.norm([a / (b or 1.0) for a, b in sizes]))

    def noise(self, x: Array, K: csc_array[np.float64]) -> Array:
        """Return an upper bound of rounding in each residual.

        Parameters
        ----------
        x : array (n,)
            Unknowns.
        K : sparse array (n, n)
            A tangent near x.

        Returns
        -------
        array (n,)
            Bounds.
        """
        return ROUNDING * self._terms(np.abs(x) + self.assembler.reach(), K)

    def _terms(self, magnitudes: Array, K: csc_array[np.float64]) -> Array:
        """Terms that cancel in each equation, (n,), for unknowns of these magnitudes, (n,).

        An entry of K may itself be what is left of larger numbers, of which sqrt(K_ii K_jj) is a
        bound wherever an energy is convex (Cauchy and Schwarz).
        """
        root = np.sqrt(np.abs(K.diagonal()))
        root[self.fixed] = 0.0
        around = self.assembler.around(root * magnitudes, self.parameters)
        return np.asarray(_sizes(K) @ magnitudes) + root * around

    def _by_scales(self, defect: Array) -> float:
        """Largest norm of the residuals of a field over the scale that is given for it."""
        scales = self.scales.items()
        scaled = [defect[self.layout.part(name)] / np.asarray(scale) for name, scale in scales]
        return max((float(np.linalg.norm(part)) for part in scaled), default=0.0)

    def beyond_rounding(self, r: Array, x: Array, K: csc_array[np.float64]) -> float:
        """Return the norm of a residual less what the last digits of x may cause.

        Parameters
        ----------
        r : array (n,)
            Residual at x.
        x : array (n,)
            Unknowns.
        K : sparse array (n, n)
            A tangent near x.

        Returns
        -------
        float
            inf without `absolute` scales.
        """
        if not self.absolute:
            return np.inf
        noise = np.finfo(np.float64).eps * np.asarray(abs(K) @ np.abs(x))
        return self.norm(np.maximum(np.abs(r) - noise, 0.0))

    def _is_lost(self, x: Array, forces: Array, K: csc_array[np.float64]) -> bool:
        """True if unknowns have grown until rounding is as large as the loads."""
        reach = self.assembler.reach()
        reference = max(float(reach.max()), float(np.abs(self.values).max(initial=0.0)))
        largest = float(np.abs(x).max(initial=0.0))
        if not is_far(largest, reference):
            return False
        noise = ROUNDING * np.asarray(abs(K) @ (np.abs(x) + reach))
        return hides(float(np.linalg.norm(noise)), float(np.linalg.norm(forces)))

    def _require_determined(self) -> None:
        undetermined = np.setdiff1d(self.assembler.loose(self.parameters), self.fixed)
        if len(undetermined):
            others = f" (and {len(undetermined) - 1} more)" if len(undetermined) > 1 else ""
            raise ProblemError(
                f"{self.name_of(int(undetermined[0]))}{others} occurs in no block that is switched "
                "on: prescribe it, or give its block parameters"
            )

    def step_limit(self, x: Array, dx: Array) -> float:
        """Return the largest fraction of a step that every guard admits.

        Parameters
        ----------
        x : array (n,)
            Unknowns.
        dx : array (n,)
            Step.

        Returns
        -------
        float
            1 without guards.
        """
        return min((guard.limit(x, dx) for guard in self.guards), default=1.0)

    def with_parameters(self, **changes: Mapping[str, float] | None) -> Problem:
        """Return the problem with other parameters.

        Parameters
        ----------
        **changes : mapping of str to float, or None
            Block -> parameters that change; None switches the block off. A block that was off needs
            all of its parameters.

        Returns
        -------
        Problem
            The problem.

        Raises
        ------
        ProblemError
            A name is unknown, or a parameter missing.
        """
        parameters = dict(self.parameters)
        for name, values in changes.items():
            if values is None:
                parameters.pop(name, None)
            else:
                parameters[name] = self._changed(name, values)
        return replace(self, parameters=parameters)

    def with_fixed(self, fixed: Sequence[Integers], values: Sequence[Array | float]) -> Problem:
        """Return the problem with these unknowns prescribed, and no others.

        Parameters
        ----------
        fixed : sequence of array of int
            Numbers of unknowns, in parts.
        values : sequence of array or float
            Values of each part.

        Returns
        -------
        Problem
            The problem.
        """
        full = [
            np.broadcast_to(np.asarray(v, dtype=np.float64), f.shape)
            for f, v in zip(fixed, values, strict=True)
        ]
        return replace(
            self,
            fixed=np.concatenate([np.empty(0, dtype=np.int64), *fixed]),
            values=np.concatenate([np.empty(0), *full]),
        )

    def also_fixed(self, fixed: Integers, value: Array | float) -> Problem:
        """Return the problem with further unknowns prescribed.

        Parameters
        ----------
        fixed : array of int (k,)
            Numbers of unknowns.
        value : array (k,) or float
            Their values.

        Returns
        -------
        Problem
            The problem.
        """
        return self.with_fixed([self.fixed, fixed], [self.values, value])

    def admissible(self, x: Array) -> Array:
        """Return unknowns with the prescribed values.

        Parameters
        ----------
        x : array (n,)
            Unknowns.

        Returns
        -------
        array (n,)
            A copy.
        """
        return self.constraints.admissible(x)

    def since(self, x: Array) -> Problem:
        """Return the problem of the next step; see `ElementBlock.since`.

        Parameters
        ----------
        x : array (n,)
            Unknowns at the end of the previous step.

        Returns
        -------
        Problem
            The problem.
        """
        assembler = self.assembler.since(x)
        return self if assembler is self.assembler else replace(self, assembler=assembler)

    def fields(self, name: str, x: Array) -> dict[str, Array]:
        """Return the fields of a block at its quadrature points.

        Parameters
        ----------
        name : str
            A block that is switched on.
        x : array (n,)
            Unknowns.

        Returns
        -------
        dict of str to array (elements, points)
            Name -> values.
        """
        return self.assembler.block(name).fields(x, self.parameters[name])

    def renewed(self, name: str, x: Array) -> Array:
        """Return the states of a block with a model at its points after a step.

        Parameters
        ----------
        name : str
            The block.
        x : array (n,)
            Unknowns at the end of the step.

        Returns
        -------
        array (elements, points, k)
            States.
        """
        return self.assembler.block(name).renewed(x, self.parameters[name])

    def _changed(self, name: str, values: Mapping[str, float]) -> Array:
        require_known("block", [name], [block.name for block in self.assembler.blocks])
        block = self.assembler.block(name)
        names, old = block.kernel.parameters, self.parameters.get(name)
        require_known(f"parameter of block {name!r}", values, names)
        if old is None:
            if set(values) != set(names):
                raise ProblemError(f"block {name!r} is off: give all of {join_names(names)}")
            return in_order(block, values)
        changed = {**dict(zip(names, old, strict=False)), **values}
        arrays = old[len(names) :]
        if not len(arrays):
            return in_order(block, changed)
        return np.concatenate([[changed[name] for name in names], arrays])

    def eliminated(self, K: csc_array[np.float64]) -> csc_array[np.float64]:
        """Return K with rows and columns of prescribed unknowns replaced by those of the identity.

        Parameters
        ----------
        K : sparse array (n, n)
            Tangent, which is changed.

        Returns
        -------
        sparse array (n, n)
            K.
        """
        return self.constraints.tangent(K, self.assembler)


def _sizes(K: Any) -> Any:
    """|K|; of a matrix without a copy of its structure."""
    if not isinstance(K, csc_array):  # of an operator a bound
        return abs(K)
    return csc_array((np.abs(K.data), K.indices, K.indptr), shape=K.shape)
