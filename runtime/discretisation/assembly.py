"""Assembly of element kernels into a residual vector and a sparse tangent.

The sparsity pattern and the position of every element entry in it are computed once; assembling
is then a gather, a kernel call and an `add.at` for each piece of a block of like elements.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem_checks import (
    fault_message,
    not_finite,
    require_sound_elements,
    rows_not_finite,
    table_ends,
)
from softehl.runtime.discretisation.sparsity import Pattern, Structure
from softehl.runtime.suggestions import short_list

_SETS = 4  # sets of prescribed unknowns that are remembered


@dataclass(eq=False)
class Memo:
    """Results of assembly that may be needed again; they only save time.

    tangents: block name -> the latest parameters of a constant tangent, the positions of its
    entries and their values. crosses: prescribed unknowns -> see `Assembler.cross`. counts: names
    of blocks -> see `Assembler.counts`. reach: see `Assembler.reach`. faults: block name -> what
    has no value there (`problem_checks.fault_message`).
    """

    tangents: dict[str, tuple[Array, Integers, Array]] = field(default_factory=dict)
    crosses: dict[bytes, Integers] = field(default_factory=dict)
    counts: dict[frozenset[str], Integers] = field(default_factory=dict)
    reach: Array | None = None
    faults: dict[str, str] = field(default_factory=dict)

    def without(self, name: str) -> Memo:
        """A copy that knows nothing of one block's tangent."""
        tangents = {n: entry for n, entry in self.tangents.items() if n != name}
        return replace(self, tangents=tangents, crosses=dict(self.crosses))

    def keep_cross(self, key: bytes, positions: Integers) -> None:
        """Remember the positions of a set of unknowns; the oldest of too many is forgotten."""
        while len(self.crosses) >= _SETS:
            del self.crosses[next(iter(self.crosses))]
        self.crosses[key] = positions


@dataclass(eq=False)
class Assembler:
    """Blocks of elements with a common sparsity pattern.

    Parameters are given block by block; a block without parameters is switched off, and keeps its
    place in the pattern.

    Attributes
    ----------
    size : int
        Number of unknowns.
    blocks : tuple of ElementBlock
        The elements.
    structure : Structure
        The pattern, made when it is needed.
    memo : Memo
        Intermediate results; saves time only.
    """

    size: int
    blocks: tuple[ElementBlock, ...]
    structure: Structure
    memo: Memo = field(default_factory=Memo)

    def __repr__(self) -> str:
        """Summary in one line."""
        return (
            f"<Assembler: {self.size} unknowns; blocks: {short_list(b.name for b in self.blocks)}>"
        )

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: without what only saves time."""
        return {**vars(self), "memo": Memo()}

    @classmethod
    def build(cls, size: int, blocks: Sequence[ElementBlock]) -> Assembler:
        """Make an assembler.

        Parameters
        ----------
        size : int
            Number of unknowns.
        blocks : sequence of ElementBlock
            The elements.

        Returns
        -------
        Assembler
            The assembler.

        Raises
        ------
        ValueError
            Two blocks have the same name, or an element is inverted.
        """
        names = [block.name for block in blocks]
        if len(set(names)) < len(names):
            raise ValueError(f"two blocks have the same name: {', '.join(names)}")
        for block in blocks:
            require_sound_elements(block)
        return cls(size, tuple(blocks), Structure(size, tuple(block.dofs for block in blocks)))

    @property
    def pattern(self) -> Pattern:
        """Sparsity of the tangent, and positions of the element entries."""
        return self.structure.pattern

    def block(self, name: str) -> ElementBlock:
        """Return the block of a name.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        ElementBlock
            The block.

        Raises
        ------
        UnknownNameError
            There is no such block; a KeyError.
        """
        for block in self.blocks:
            if block.name == name:
                return block
        raise UnknownNameError(
            f"no block {name!r}; there are {', '.join(b.name for b in self.blocks)}"
        )

    def with_data(
        self, name: str, *, data: Array | None = None, point_data: Array | None = None
    ) -> Assembler:
        """Return the assembler with other data of one block.

        Parameters
        ----------
        name : str
            Name of the block.
        data : array (n, k), optional
            Data of each element.
        point_data : array (n, points, k), optional
            Values at the quadrature points.

        Returns
        -------
        Assembler
            With the same pattern.
        """
        changed = replace(self.block(name), data=data, point_data=point_data)
        blocks = tuple(changed if b.name == name else b for b in self.blocks)
        return replace(self, blocks=blocks, memo=self.memo.without(name))

    def since(self, x: Array) -> Assembler:
        """Return the assembler in the next step; see `ElementBlock.since`.

        Parameters
        ----------
        x : array (size,)
            Unknowns at the end of the previous step.

        Returns
        -------
        Assembler
            With the same pattern.
        """
        blocks = tuple(block.since(x) for block in self.blocks)
        changed = any(new is not old for new, old in zip(blocks, self.blocks, strict=True))
        return replace(self, blocks=blocks) if changed else self

    def residual(self, x: Array, parameters: Mapping[str, Array]) -> Array:
        """Return the sum of the element residuals.

        Parameters
        ----------
        x : array (size,)
            Unknowns.
        parameters : mapping of str to array (k,)
            Block -> parameters.

        Returns
        -------
        array (size,)
            Residual.
        """
        total = np.zeros(self.size)
        for block in self.blocks:
            if block.name in parameters:
                self._add_residual(total, block, x, parameters[block.name])
        return total

    def residual_and_size(self, x: Array, parameters: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return the sums of the element residuals and of their magnitudes.

        Parameters
        ----------
        x : array (size,)
            Unknowns.
        parameters : mapping of str to array (k,)
            Block -> parameters.

        Returns
        -------
        residual : array (size,)
            Residual.
        size : array (size,)
            Sum of magnitudes: at an equilibrium the size of loads, reactions and internal forces.
        """
        total, size = np.zeros(self.size), np.zeros(self.size)
        for block in self.blocks:
            if block.name in parameters:
                local = block.residual(x, parameters[block.name]).ravel()
                np.add.at(total, block.dofs.ravel(), local)
                np.add.at(size, block.dofs.ravel(), np.abs(local))
        return total, size

    def loose(self, names: Iterable[str]) -> Integers:
        """Return the unknowns that no element of some blocks has.

        Parameters
        ----------
        names : iterable of str
            Names of the blocks.

        Returns
        -------
        array of int
            Numbers, rising.
        """
        return np.flatnonzero(self.counts(names) == 0)

    def counts(self, names: Iterable[str]) -> Integers:
        """Return the number of elements of some blocks that have each unknown.

        Parameters
        ----------
        names : iterable of str
            Names of the blocks.

        Returns
        -------
        array of int (size,)
            Numbers of elements.
        """
        key = frozenset(names)
        if key not in self.memo.counts:
            n_elements = np.zeros(self.size, dtype=np.int64)
            for block in self.blocks:
                if block.name in key:
                    np.add.at(n_elements, block.dofs.ravel(), 1)
            self.memo.counts[key] = n_elements
        return self.memo.counts[key]

    def around(self, values: Array, names: Iterable[str]) -> Array:
        """Return for each unknown the sum of values over all unknowns of its elements.

        Parameters
        ----------
        values : array (size,)
            Values.
        names : iterable of str
            Names of the blocks.

        Returns
        -------
        array (size,)
            Sums.
        """
        sums_around, active = np.zeros(self.size), frozenset(names)
        for block in self.blocks:
            if block.name in active:
                sums = values[block.dofs].sum(axis=1)
                np.add.at(sums_around, block.dofs, sums[:, None])
        return sums_around

    def reach(self) -> Array:
        """Return the largest coordinate of the elements of each unknown.

        Returns
        -------
        array (size,)
            Kernels that add displacements to coordinates lose digits of a displacement in the
            rounding of this number.
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

    def _fault(self, block: ElementBlock, x: Array, parameters: Array, row: int) -> str:
        return fault_message(block, x, parameters, row, self.memo.faults)

    def not_finite(self, x: Array, parameters: Mapping[str, Array]) -> str:
        """Return the element whose residual or tangent is not finite, in words.

        Parameters
        ----------
        x : array (size,)
            Unknowns.
        parameters : mapping of str to array (k,)
            Block -> parameters.

        Returns
        -------
        str
            Empty if there is none.
        """
        for block in self.blocks:
            if block.name in parameters:
                results = block.tangent(x, parameters[block.name])
                message = not_finite(block, results)
                if message:
                    row = int(rows_not_finite(results)[0])
                    message += table_ends(block, x, parameters[block.name])
                    return message + self._fault(block, x, parameters[block.name], row)
        return ""

    def linearise(
        self, x: Array, parameters: Mapping[str, Array]
    ) -> tuple[Array, csc_array[np.float64]]:
        """Return residual and tangent.

        Parameters
        ----------
        x : array (size,)
            Unknowns.
        parameters : mapping of str to array (k,)
            Block -> parameters.

        Returns
        -------
        residual : array (size,)
            Residual.
        tangent : sparse array (size, size)
            In CSC form, with the same pattern always.
        """
        total, data = np.zeros(self.size), np.zeros(self.pattern.nnz)
        for block, scatter in zip(self.blocks, self.pattern.scatter, strict=True):
            if block.name not in parameters:
                continue
            block_parameters = parameters[block.name]
            if block.constant:
                self._add_residual(total, block, x, block_parameters)
                positions, entries = self._constant(block, scatter, block_parameters)
                np.add.at(data, positions, entries)
                continue
            for piece, positions in block.pieces(scatter):
                local, tangents = piece.tangent(x, block_parameters)
                np.add.at(data, positions, tangents.ravel())
                np.add.at(total, piece.dofs.ravel(), local.ravel())
        return total, self.pattern.matrix(data)

    def cross(self, fixed: Integers) -> Integers:
        """Return the positions of rows and columns of unknowns in the data of the tangent.

        Parameters
        ----------
        fixed : array of int
            Numbers of the unknowns.

        Returns
        -------
        array of int
            Positions.
        """
        key = fixed.tobytes()
        positions = self.memo.crosses.get(key)
        if positions is None:
            is_fixed = np.zeros(self.size, dtype=bool)
            is_fixed[fixed] = True
            columns = np.repeat(is_fixed, np.diff(self.pattern.indptr))
            positions = np.flatnonzero(columns | is_fixed[self.pattern.indices])
            self.memo.keep_cross(key, positions)
        return positions

    def _add_residual(self, total: Array, block: ElementBlock, x: Array, parameters: Array) -> None:
        """Add the residuals of a block to the sum, in place."""
        np.add.at(total, block.dofs.ravel(), block.residual(x, parameters).ravel())

    def _constant(
        self, block: ElementBlock, scatter: Integers, parameters: Array
    ) -> tuple[Integers, Array]:
        """Places and values of the entries of a constant tangent."""
        cached = self.memo.tangents.get(block.name)
        if cached is None or not np.array_equal(cached[0], parameters):
            data = np.zeros(self.pattern.nnz)
            np.add.at(data, scatter, block.tangent(np.zeros(self.size), parameters)[1].ravel())
            positions = np.flatnonzero(data)
            cached = parameters.copy(), positions, data[positions]
            self.memo.tangents[block.name] = cached
        return cached[1], cached[2]
