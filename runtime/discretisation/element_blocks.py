"""Blocks of like elements: kernel, coordinates, unknowns, data."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.mass import MassKernel
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.kernels.explanation import Explanation
from softehl.runtime.kernels.kernel import Kernel, KernelError, Rule

Again: TypeAlias = Callable[[Array, Array, Array | None], None]
"""A task of a kernel: of its unknowns, and of the values and the tangent that it writes."""


_PIECE = 1 << 18  # entries of the tangents that are evaluated before they are added up
_GROUP = 8  # elements that a kernel evaluates at once at most


class ElementKernel(Protocol):
    """Interface of a compiled kernel to assembly; arrays are batched over n elements."""

    @property
    def name(self) -> str:
        """Family of the kernel."""
        ...

    @property
    def signature(self) -> str:
        """Identity of the compiled code."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the parameter array."""
        ...

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields of `fields_at`."""
        ...

    def residual(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """Element residuals (n, ndof)."""
        ...

    def tangent(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        ...

    def fields_at(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """Fields at the quadrature points (n, points, len(fields))."""
        ...


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Elements of one kernel.

    Parameters
    ----------
    name : str
        Name, by which parameters are given.
    kernel : Kernel
        The kernel.
    coordinates : array (n, nodes dim)
        Reference coordinates, node by node.
    dofs : array of int (n, ndof)
        Numbers of the unknowns.
    data : array (n, k), optional
        Data of each element.
    rule : Rule, optional
        Quadrature rule; the kernel's own if left out.
    constant : bool
        True if the tangent depends on parameters alone: it is evaluated once for each set.
    point_data : array (n, points, k), optional
        Values at the quadrature points, such as history.
    check_orientation : bool
        Refuse inverted elements. False for a page with another order of nodes than VTK's.
    calls : dict
        The latest call of each task; saves time only.
    """

    name: str
    kernel: ElementKernel
    coordinates: Array
    dofs: Integers
    data: Array | None = None
    rule: Rule | None = None
    constant: bool = False
    point_data: Array | None = None
    check_orientation: bool = True
    calls: dict[str, tuple[Array, Again]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<ElementBlock {self.name}: {len(self.dofs)} elements of {self.kernel.name}>"

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: without its latest calls."""
        return {**vars(self), "calls": {}}

    def residual(self, x: Array, parameters: Array) -> Array:
        """Return the element residuals.

        Parameters
        ----------
        x : array (size,)
            All unknowns.
        parameters : array (k,)
            Parameters of the kernel.

        Returns
        -------
        array (n, ndof)
            Residuals.
        """
        again, dofs = self._again("residual", parameters), self._gathered(x)
        if again is None:
            return self.kernel.residual(self.coordinates, dofs, **self.given(parameters))
        again(dofs, values := np.empty(dofs.shape), None)
        return values

    def tangent(self, x: Array, parameters: Array) -> tuple[Array, Array]:
        """Return element residuals and tangents.

        Parameters
        ----------
        x : array (size,)
            All unknowns.
        parameters : array (k,)
            Parameters of the kernel.

        Returns
        -------
        residual : array (n, ndof)
            Residuals.
        tangent : array (n, ndof, ndof)
            Tangents.
        """
        again, dofs = self._again("tangent", parameters), self._gathered(x)
        if again is None:
            return self.kernel.tangent(self.coordinates, dofs, **self.given(parameters))
        values, tangents = np.empty(dofs.shape), np.empty((*dofs.shape, dofs.shape[1]))
        again(dofs, values, tangents)
        return values, tangents

    def _gathered(self, x: Array) -> Array:
        """Unknowns (n, ndof) of the elements at the global vector x."""
        return np.ascontiguousarray(x[self.dofs], dtype=np.float64)

    def _again(self, task: str, parameters: Array) -> Again | None:
        """The task with other unknowns than at its last call; None if more than they differ."""
        if not isinstance(self.kernel, Kernel) or self.point_data is not None:
            return None
        cached = self.calls.get(task)
        if cached is None or cached[0] is not parameters:
            at_rest = np.zeros(self.dofs.shape)
            call = self.kernel.call(task, self.coordinates, at_rest, **self.given(parameters))
            cached = self.calls[task] = parameters, call.again()
        return cached[1]

    def pieces(self, scatter: Integers) -> Iterator[tuple[ElementBlock, Integers]]:
        """Yield parts of the block whose tangents fit into the cache of a core.

        Parameters
        ----------
        scatter : array of int
            Positions of the block's entries in the tangent.

        Yields
        ------
        block : ElementBlock
            Part of the elements.
        scatter : array of int
            Their positions.
        """
        n = len(self.dofs)
        is_model = isinstance(self.kernel, ModelKernel)  # which knows its states by their array
        step = n if is_model else max(_PIECE // max(self.dofs.shape[1] ** 2, 1), _GROUP)
        if n <= step:
            yield self, scatter
            return
        width = len(scatter) // n
        for first in range(0, n, step):
            part = slice(first, first + step)
            piece = self.part(part)
            if isinstance(self.kernel, MassKernel):
                piece = replace(piece, kernel=self.kernel.part(part))
            yield piece, scatter[width * first : width * (first + step)]

    def part(self, elements: slice | Integers) -> ElementBlock:
        """Return the block with some of its elements.

        Parameters
        ----------
        elements : slice or array of int
            Numbers of the elements.

        Returns
        -------
        ElementBlock
            Block of these elements alone.
        """
        data = None if self.data is None else self.data[elements]
        history = None if self.point_data is None else self.point_data[elements]
        coordinates, dofs = self.coordinates[elements], self.dofs[elements]
        return replace(self, coordinates=coordinates, dofs=dofs, data=data, point_data=history)

    def since(self, x: Array) -> ElementBlock:
        """Return the block in the next step: data u_old1, ... have the values of u1, ...

        Parameters
        ----------
        x : array (size,)
            Unknowns at the end of the previous step.

        Returns
        -------
        ElementBlock
            The block with these data.
        """
        unknowns, names = (tuple(getattr(self.kernel, n, ())) for n in ("unknowns", "data"))
        columns_of_old = {f"{u[:-1]}_old{u[-1]}": k for k, u in enumerate(unknowns)}
        columns = [k for k, name in enumerate(names) if name in columns_of_old]
        if not columns or self.data is None:
            return self
        data = self.data.copy()
        data[:, columns] = x[self.dofs[:, [columns_of_old[names[k]] for k in columns]]]
        return replace(self, data=data)

    def given(self, parameters: Array) -> dict[str, Any]:
        """Return the arguments of the kernel besides coordinates and unknowns.

        Parameters
        ----------
        parameters : array (k,)
            Parameters of the kernel.

        Returns
        -------
        dict
            Keyword arguments.
        """
        arguments = {"data": self.data, "parameters": parameters, "rule": self.rule}
        return (
            arguments if self.point_data is None else {**arguments, "point_data": self.point_data}
        )

    def fields(self, x: Array, parameters: Array) -> dict[str, Array]:
        """Return the fields at the quadrature points, and internal unknowns of the elements.

        Parameters
        ----------
        x : array (size,)
            All unknowns.
        parameters : array (k,)
            Parameters of the kernel.

        Returns
        -------
        dict of str to array (n, points)
            Name -> values.
        """
        internal = self.internal
        if not self.kernel.fields:
            values = np.empty((len(self.dofs), len(self._rule.weights) if internal else 0, 0))
        else:
            arguments = self.given(parameters)
            values = self.kernel.fields_at(self.coordinates, x[self.dofs], **arguments)
        by_name = {name: values[:, :, i] for i, name in enumerate(self.kernel.fields)}
        for name, numbers in internal.items():
            by_name.setdefault(name, np.repeat(x[numbers][:, None], values.shape[1], axis=1))
        return by_name

    def renewed(self, x: Array, parameters: Array) -> Array:
        """Return the states after a step, of a kernel with a model at its points.

        Parameters
        ----------
        x : array (size,)
            Unknowns at the end of the step.
        parameters : array (k,)
            Parameters of the kernel.

        Returns
        -------
        array (n, points, k)
            States.
        """
        assert isinstance(self.kernel, ModelKernel)
        return self.kernel.renewed(self.coordinates, self._gathered(x), **self.given(parameters))

    def explain(self, x: Array, parameters: Array, element: int) -> Explanation:
        """Return the named values of the page in one element, as `Kernel.explain`.

        Parameters
        ----------
        x : array (size,)
            All unknowns.
        parameters : array (k,)
            Parameters of the kernel.
        element : int
            Number of the element in the block.

        Returns
        -------
        Explanation
            Values at the quadrature points, and the first operation without a value.

        Raises
        ------
        KernelError
            The block has no page.
        """
        if not isinstance(self.kernel, Kernel):
            raise KernelError(f"block {self.name!r} has no page")
        arguments = self.given(parameters)
        return self.kernel.explain(
            self.coordinates, self._gathered(x), element=element, **arguments
        )

    @property
    def internal(self) -> dict[str, Integers]:
        """Numbers (n,) of the internal unknowns of the elements, by name."""
        names = getattr(self.kernel, "internal", ())
        unknowns = getattr(self.kernel, "unknowns", ())
        return {name: self.dofs[:, unknowns.index(name)] for name in names}

    @property
    def _rule(self) -> Rule:
        if self.rule is not None:
            return self.rule
        assert isinstance(self.kernel, Kernel)
        return self.kernel.default_rule
