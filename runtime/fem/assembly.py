"""Assembly of element kernels into a residual vector and a sparse tangent.

The sparsity pattern and the position of every element entry in it are computed once; assembling
is then a gather, a kernel call and an `add.at` for each piece of a block of like elements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeAlias

import numpy as np
from scipy.sparse import csc_array

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.checks import not_finite, require_sound_elements
from softehl.runtime.fem.mass import Mass
from softehl.runtime.fem.pattern import Pattern, Structure
from softehl.runtime.kernels import Kernel, Rule
from softehl.runtime.suggestions import few

Again: TypeAlias = Callable[[Array, Array, Array | None], None]
"""A task of a kernel: of its unknowns, and of the values and the tangent that it writes."""

_PIECE = 1 << 18  # entries of the tangents that are evaluated before they are added up
_GROUP = 8  # elements that a kernel evaluates at once at most
_SETS = 4  # sets of prescribed unknowns that are remembered


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
    """Like elements of one kernel.

    name: by which parameters are given. coordinates: (n, 2 nodes) reference (z, r), node by node.
    dofs: (n, ndof) numbers of the unknowns. data: (n, k) constants of each element or None.
    rule: quadrature rule, None for the kernel's own. constant: the tangent depends on parameters
    alone, so that it is evaluated once for each set of them. point_data: (n, points, k) values at
    the quadrature points, such as the history of the steps before, or None.
    check_orientation: elements that are inside out are refused; False for a page whose nodes have
    another order than VTK's. calls: the latest call of each task and the parameters it was made
    with; it saves time only.
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
        """Element residuals (n, ndof) at the global vector x."""
        again, dofs = self._again("residual", parameters), self._gathered(x)
        if again is None:
            return self.kernel.residual(self.coordinates, dofs, **self.given(parameters))
        again(dofs, values := np.empty(dofs.shape), None)
        return values

    def tangent(self, x: Array, parameters: Array) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof) at the global vector x."""
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
        known = self.calls.get(task)
        if known is None or known[0] is not parameters:
            at_rest = np.zeros(self.dofs.shape)
            call = self.kernel.call(task, self.coordinates, at_rest, **self.given(parameters))
            known = self.calls[task] = parameters, call.again()
        return known[1]

    def pieces(self, scatter: Integers) -> Iterator[tuple[ElementBlock, Integers]]:
        """Parts of the block whose tangents fit into a core's cache, with theirs of `scatter`."""
        n = len(self.dofs)
        step = max(_PIECE // max(self.dofs.shape[1] ** 2, 1), _GROUP)
        if n <= step:
            yield self, scatter
            return
        width = len(scatter) // n
        for first in range(0, n, step):
            part = slice(first, first + step)
            data = None if self.data is None else self.data[part]
            history = None if self.point_data is None else self.point_data[part]
            coordinates, dofs = self.coordinates[part], self.dofs[part]
            piece = replace(self, coordinates=coordinates, dofs=dofs, data=data, point_data=history)
            if isinstance(self.kernel, Mass):
                piece = replace(piece, kernel=self.kernel.part(part))
            yield piece, scatter[width * first : width * (first + step)]

    def since(self, x: Array) -> ElementBlock:
        """The block in the step after x: data u_old1, ... of unknowns u1, ... are those of x."""
        unknowns, names = (tuple(getattr(self.kernel, n, ())) for n in ("unknowns", "data"))
        places = {f"{u[:-1]}_old{u[-1]}": k for k, u in enumerate(unknowns)}
        columns = [k for k, name in enumerate(names) if name in places]
        if not columns or self.data is None:
            return self
        data = self.data.copy()
        data[:, columns] = x[self.dofs[:, [places[names[k]] for k in columns]]]
        return replace(self, data=data)

    def given(self, parameters: Array) -> dict[str, Any]:
        """Arguments of its kernel besides coordinates and unknowns."""
        given = {"data": self.data, "parameters": parameters, "rule": self.rule}
        return given if self.point_data is None else {**given, "point_data": self.point_data}

    def fields(self, x: Array, parameters: Array) -> dict[str, Array]:
        """Fields of the kernel at its quadrature points, name -> (n, points); with them its
        internal unknowns, the same at all points of an element.
        """
        internal = self.internal
        if not self.kernel.fields:
            values = np.empty((len(self.dofs), len(self._rule.weights) if internal else 0, 0))
        else:
            given = self.given(parameters)
            values = self.kernel.fields_at(self.coordinates, x[self.dofs], **given)
        found = {name: values[:, :, i] for i, name in enumerate(self.kernel.fields)}
        for name, numbers in internal.items():
            found.setdefault(name, np.repeat(x[numbers][:, None], values.shape[1], axis=1))
        return found

    @property
    def internal(self) -> dict[str, Integers]:
        """Numbers (n,) of the unknowns that each element has for itself, by name."""
        names = getattr(self.kernel, "internal", ())
        unknowns = getattr(self.kernel, "unknowns", ())
        return {name: self.dofs[:, unknowns.index(name)] for name in names}

    @property
    def _rule(self) -> Rule:
        if self.rule is not None:
            return self.rule
        assert isinstance(self.kernel, Kernel)
        return self.kernel.default_rule


@dataclass(eq=False)
class Memo:
    """Results of assembly that may be needed again; they only save time.

    tangents: block name -> the latest parameters of a constant tangent, the positions of its
    entries and their values. crosses: prescribed unknowns -> see `Assembler.cross`. counts: names
    of blocks -> see `Assembler.counts`. reach: see `Assembler.reach`.
    """

    tangents: dict[str, tuple[Array, Integers, Array]] = field(default_factory=dict)
    crosses: dict[bytes, Integers] = field(default_factory=dict)
    counts: dict[frozenset[str], Integers] = field(default_factory=dict)
    reach: Array | None = None

    def without(self, name: str) -> Memo:
        """A copy that knows nothing of one block's tangent."""
        tangents = {n: known for n, known in self.tangents.items() if n != name}
        return replace(self, tangents=tangents, crosses=dict(self.crosses))

    def keep_cross(self, key: bytes, places: Integers) -> None:
        """Remember the positions of a set of unknowns; the oldest of too many is forgotten."""
        while len(self.crosses) >= _SETS:
            del self.crosses[next(iter(self.crosses))]
        self.crosses[key] = places


@dataclass(eq=False)
class Assembler:
    """Blocks of elements and the pattern they share.

    Parameters are given block by block, in the kernel's order; a block without parameters is
    switched off, its place in the pattern stays. Results depend on the arguments alone; `memo` is
    the one field that changes with calls.
    """

    size: int
    blocks: tuple[ElementBlock, ...]
    structure: Structure
    memo: Memo = field(default_factory=Memo)

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Assembler: {self.size} unknowns; blocks: {few(b.name for b in self.blocks)}>"

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: without what only saves time."""
        return {**vars(self), "memo": Memo()}

    @classmethod
    def build(cls, size: int, blocks: Sequence[ElementBlock]) -> Assembler:
        """Assembler of blocks over `size` unknowns.

        Raises ValueError if two blocks share a name, and for elements that are inside out.
        """
        names = [block.name for block in blocks]
        if len(set(names)) < len(names):
            raise ValueError(f"two blocks have the same name: {', '.join(names)}")
        for block in blocks:
            require_sound_elements(block)
        return cls(size, tuple(blocks), Structure(size, tuple(block.dofs for block in blocks)))

    @property
    def pattern(self) -> Pattern:
        """Sparsity of the tangent, and where every element entry goes in it."""
        return self.structure.pattern

    def block(self, name: str) -> ElementBlock:
        """The block of that name; KeyError if there is none."""
        for block in self.blocks:
            if block.name == name:
                return block
        raise UnknownNameError(
            f"no block {name!r}; there are {', '.join(b.name for b in self.blocks)}"
        )

    def with_data(
        self, name: str, *, data: Array | None = None, point_data: Array | None = None
    ) -> Assembler:
        """The assembler with other data of one block; the pattern is shared."""
        changed = replace(self.block(name), data=data, point_data=point_data)
        blocks = tuple(changed if b.name == name else b for b in self.blocks)
        return replace(self, blocks=blocks, memo=self.memo.without(name))

    def since(self, x: Array) -> Assembler:
        """The assembler in the step after x; see `ElementBlock.since`."""
        blocks = tuple(block.since(x) for block in self.blocks)
        changed = any(new is not old for new, old in zip(blocks, self.blocks, strict=True))
        return replace(self, blocks=blocks) if changed else self

    def residual(self, x: Array, parameters: Mapping[str, Array]) -> Array:
        """Sum of the element residuals, (size,)."""
        total = np.zeros(self.size)
        for block in self.blocks:
            if block.name in parameters:
                self._add_residual(total, block, x, parameters[block.name])
        return total

    def residual_and_size(self, x: Array, parameters: Mapping[str, Array]) -> tuple[Array, Array]:
        """Sum of the element residuals, and of their magnitudes: both (size,).

        At an equilibrium the second is the size of the loads, reactions and internal forces.
        """
        total, size = np.zeros(self.size), np.zeros(self.size)
        for block in self.blocks:
            if block.name in parameters:
                local = block.residual(x, parameters[block.name]).ravel()
                np.add.at(total, block.dofs.ravel(), local)
                np.add.at(size, block.dofs.ravel(), np.abs(local))
        return total, size

    def loose(self, names: Iterable[str]) -> Integers:
        """Unknowns that no element of the blocks of these names has, rising."""
        return np.flatnonzero(self.counts(names) == 0)

    def counts(self, names: Iterable[str]) -> Integers:
        """Number of elements of the blocks of these names that have each unknown, (size,)."""
        key = frozenset(names)
        if key not in self.memo.counts:
            found = np.zeros(self.size, dtype=np.int64)
            for block in self.blocks:
                if block.name in key:
                    np.add.at(found, block.dofs.ravel(), 1)
            self.memo.counts[key] = found
        return self.memo.counts[key]

    def around(self, values: Array, names: Iterable[str]) -> Array:
        """For each unknown the sum of values (size,) over all unknowns of the elements that it is
        in, of the blocks of these names: (size,).
        """
        found, chosen = np.zeros(self.size), frozenset(names)
        for block in self.blocks:
            if block.name in chosen:
                sums = values[block.dofs].sum(axis=1)
                np.add.at(found, block.dofs, sums[:, None])
        return found

    def reach(self) -> Array:
        """Largest coordinate of the elements that each unknown occurs in, (size,).

        Kernels that add displacements to coordinates lose a displacement in the rounding of
        this number.
        """
        if self.memo.reach is None:
            reach = np.zeros(self.size)
            for block in self.blocks:
                if not np.size(block.coordinates):
                    continue  # its kernel has none
                flat = np.abs(block.coordinates).reshape(len(block.dofs), -1)
                largest = flat.max(axis=1, initial=0.0)
                np.maximum.at(reach, block.dofs, largest[:, None])
            self.memo.reach = reach
        return self.memo.reach

    def not_finite(self, x: Array, parameters: Mapping[str, Array]) -> str:
        """The element whose residual or tangent at x is not finite, for messages; empty if none."""
        for block in self.blocks:
            if block.name in parameters:
                found = not_finite(block, *block.tangent(x, parameters[block.name]))
                if found:
                    return found
        return ""

    def linearise(
        self, x: Array, parameters: Mapping[str, Array]
    ) -> tuple[Array, csc_array[np.float64]]:
        """Residual (size,) and tangent (size, size), csc with the fixed pattern."""
        total, data = np.zeros(self.size), np.zeros(self.pattern.nnz)
        for block, scatter in zip(self.blocks, self.pattern.scatter, strict=True):
            if block.name not in parameters:
                continue
            given = parameters[block.name]
            if block.constant:
                self._add_residual(total, block, x, given)
                places, entries = self._constant(block, scatter, given)
                np.add.at(data, places, entries)
                continue
            for piece, places in block.pieces(scatter):
                local, tangents = piece.tangent(x, given)
                np.add.at(data, places, tangents.ravel())
                np.add.at(total, piece.dofs.ravel(), local.ravel())
        return total, self.pattern.matrix(data)

    def cross(self, fixed: Integers) -> Integers:
        """Positions in the data of the rows and columns of these unknowns; kept for later calls."""
        key = fixed.tobytes()
        places = self.memo.crosses.get(key)
        if places is None:
            chosen = np.zeros(self.size, dtype=bool)
            chosen[fixed] = True
            columns = np.repeat(chosen, np.diff(self.pattern.indptr))
            places = np.flatnonzero(columns | chosen[self.pattern.indices])
            self.memo.keep_cross(key, places)
        return places

    def _add_residual(self, total: Array, block: ElementBlock, x: Array, given: Array) -> None:
        """Add the residuals of a block to the sum, in place."""
        np.add.at(total, block.dofs.ravel(), block.residual(x, given).ravel())

    def _constant(
        self, block: ElementBlock, scatter: Integers, parameters: Array
    ) -> tuple[Integers, Array]:
        """Places and values of the entries of a constant tangent."""
        known = self.memo.tangents.get(block.name)
        if known is None or not np.array_equal(known[0], parameters):
            data = np.zeros(self.pattern.nnz)
            np.add.at(data, scatter, block.tangent(np.zeros(self.size), parameters)[1].ravel())
            places = np.flatnonzero(data)
            known = parameters.copy(), places, data[places]
            self.memo.tangents[block.name] = known
        return known[1], known[2]
