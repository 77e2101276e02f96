"""From a model's potential to the outputs of each task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codegen.abi import Task, derivative_task
from codegen.differentiate import Linearisation, directional, gradient
from codegen.emit_c import Entry, Slot
from codegen.graph import Graph, Input, Node
from codegen.model import Definition
from codegen.waists import Waist, linear_waist, quadratic_waist, strip, substitute


def tasks(d: Definition) -> list[str]:
    """What a model offers: an energy only where the residual is its gradient."""
    offered: list[str] = [Task.RESIDUAL, Task.TANGENT]
    if d.conservative:
        offered.insert(0, Task.ENERGY)
    if d.fields:
        offered.append(Task.FIELDS)
    if d.product:
        offered.append(Task.PRODUCT)
    return offered + [derivative_task(name) for name, _ in d.derivatives]


def outputs(d: Definition, task: str) -> list[Entry]:
    """Output nodes of a task, before any pass."""
    if task == Task.ENERGY:
        return [Entry(Slot(False, 0), None, d.potential)]
    if task == Task.FIELDS:
        return [Entry(Slot(False, k), None, node) for k, (_, node) in enumerate(d.fields)]
    if task not in (Task.RESIDUAL, Task.TANGENT):
        return _rates(d, task)
    modal = _modal(d)
    if modal is not None:
        return modal.residual() + (modal.tangent() if task == Task.TANGENT else [])
    adjoint = gradient(d.graph, d.potential, d.directions, constant=d.constant, given=d.given)
    slots = _slots(d)
    rows = [Entry(s, None, adjoint[u]) for s, u in zip(slots, d.directions, strict=True)]
    if task == Task.RESIDUAL:
        return rows
    return rows + _tangent(d, rows, slots, adjoint)


def _rates(d: Definition, task: str) -> list[Entry]:
    """The residual's derivative along `direction` or with respect to one argument."""
    g = d.graph
    rows = outputs(d, Task.RESIDUAL)
    if task == Task.PRODUCT:
        array = {"dofs": "direction", "interpolated": "interpolated direction"}
        seeds = {
            u: g.input(array[u.payload.array], u.payload.index, varying=u.varying)
            for u in d.directions
            if isinstance(u.payload, Input)
        }
    else:
        by_task = {derivative_task(name): node for name, node in d.derivatives}
        seeds = {by_task[task]: g.one}
    rates = directional(g, [x.node for x in rows], seeds, d.given)
    return [Entry(x.row, None, n) for x, n in zip(rows, rates, strict=True)]


def _slots(d: Definition) -> list[Slot]:
    direct = len(d.unknowns)
    return [Slot(u.varying, k - direct if u.varying else k) for k, u in enumerate(d.directions)]


def _tangent(
    d: Definition, rows: list[Entry], slots: list[Slot], adjoint: dict[Node, Node]
) -> list[Entry]:
    waist = [z for z in d.waist if z.varying]
    mirror = {adjoint[z]: z for z in waist if z in adjoint} if d.conservative else {}
    forward = Linearisation(d.graph, d.directions, d.waist, symmetric=mirror, given=d.given)
    entries: dict[tuple[int, int], Node] = {}
    for i, row in enumerate(rows):
        for j in range(len(slots)):
            if d.conservative and j < i and not d.interpolated:
                entries[i, j] = entries[j, i]
            else:
                entries[i, j] = forward.derivative(row.node, j)
    return [
        Entry(slots[i], slots[j], n)
        for (i, j), n in entries.items()
        if not (slots[i].basis or slots[j].basis) or n is not d.graph.zero
    ]


def _modal(d: Definition) -> _Modal | None:
    """The model through its automatic waist; None where that does not apply."""
    if d.interpolated or d.given:
        return None
    g = d.graph
    (root,), kept = strip(g, [d.potential], d.constant)
    waist = linear_waist(g, [root], d.directions)
    if waist is None:
        return None
    forms = {z: g.name(f"z{k}", value) for k, (z, value) in enumerate(waist.rewritten.items())}
    (root,), new = substitute(g, [root], forms)
    constant = tuple(new[kept[c]] for c in d.constant)
    squares = {
        q: g.name(f"q{k}", q)
        for k, q in enumerate(quadratic_waist([root], tuple(forms.values()), constant))
    }
    (root,), new = substitute(g, [root], squares)
    constant = tuple(new[c] for c in constant)
    return _Modal(d, root, constant, waist, tuple(forms.values()), tuple(squares.values()))


@dataclass(frozen=True)
class _Modal:
    """Derivatives in modal coordinates, carried to the unknowns by their constant matrix."""

    d: Definition
    root: Node
    constant: tuple[Node, ...]
    waist: Waist
    forms: tuple[Node, ...]
    squares: tuple[Node, ...]

    def _adjoint(self) -> dict[Node, Node]:
        return gradient(
            self.d.graph,
            self.root,
            self.waist.modes,
            constant=self.constant,
            named=(*self.waist.point, *self.forms, *self.squares),
        )

    def residual(self) -> list[Entry]:
        """R_i = sum of V_ki dPi/dm_k."""
        adjoint = self._adjoint()
        rows = self._spread([adjoint[m] for m in self.waist.modes])
        return [Entry(Slot(False, i), None, n) for i, n in enumerate(rows)]

    def tangent(self) -> list[Entry]:
        """K_ij = sum of V_ki (d2 Pi / dm_k dm_l) V_lj."""
        modal = self._modal_tangent()
        half = [self._spread(row) for row in modal]
        full = [self._spread(column) for column in zip(*half, strict=True)]
        size = range(len(full))
        upper = self.d.conservative
        return [
            Entry(Slot(False, i), Slot(False, j), full[i][j] if upper and j < i else full[j][i])
            for i in size
            for j in size
        ]

    def _modal_tangent(self) -> list[list[Node]]:
        """Symmetric part at fixed constants, plus what the constants contribute."""
        g, modes, adjoint = self.d.graph, self.waist.modes, self._adjoint()
        fixed = self._forward(adjoint, modes, self.constant)
        size = range(len(modes))
        rows: list[list[Node]] = [[] for _ in modes]
        for k in size:
            for j in size:
                rows[k].append(rows[j][k] if j < k else fixed.derivative(adjoint[modes[k]], j))
        if not self.constant:
            return rows
        by_constant = self._forward(adjoint, self.constant, modes)
        moving = Linearisation(g, modes, self._levels()[0])
        for i, c in enumerate(self.constant):
            for k in size:
                slope = by_constant.derivative(adjoint[modes[k]], i)
                for j in size:
                    term = g.mul(slope, moving.derivative(c, j))
                    rows[k][j] = g.add(rows[k][j], g.sum(term) if c.varying else term)
        return rows

    def _levels(self) -> list[list[Node]]:
        waists = (self.waist.point, self.forms, self.squares)
        return [v for v in ([n for n in w if n.varying] for w in waists) if v] or [[]]

    def _forward(
        self, adjoint: dict[Node, Node], directions: Sequence[Node], constant: Sequence[Node]
    ) -> Linearisation:
        levels = self._levels()
        return Linearisation(
            self.d.graph,
            directions,
            levels[0],
            symmetric={adjoint[z]: z for level in levels for z in level if z in adjoint},
            constant=constant,
            upper=levels[1:],
            gates={adjoint[z]: k for k, level in enumerate(levels) for z in level if z in adjoint},
        )

    def _spread(self, modal: Sequence[Node]) -> list[Node]:
        """Values at the unknowns of a linear functional of the modal coordinates."""
        g: Graph = self.d.graph
        at = {u.id: i for i, u in enumerate(self.d.directions)}
        out = [g.zero for _ in self.d.directions]
        for value, vector in zip(modal, self.waist.matrix, strict=True):
            for source, c in vector:
                i = at[source]
                out[i] = g.add(out[i], g.mul(g.const(c), value))
        return out
