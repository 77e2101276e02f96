"""From a model's potential to the outputs of each task."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from softehl.codegen.abi import Task, derivative_task
from softehl.codegen.derive.differentiate import Given, Linearisation, directional, gradient
from softehl.codegen.derive.interfaces import Waist, linear_waist, strip, substitute
from softehl.codegen.derive.invariants import narrow, quadratic_waist
from softehl.codegen.emit.c import Entry, Slot
from softehl.codegen.graph.graph import FREE, Graph, Input, Node, Op, reachable
from softehl.codegen.language.model import Definition

SMALL = 100
"""Values of a potential so simple that its waists may cost more than they save."""


def tasks(d: Definition) -> list[str]:
    """What a model offers: an energy only where the residual is its gradient, or what it chose."""
    offered: list[str] = [Task.RESIDUAL, Task.TANGENT]
    if d.conservative:
        offered.insert(0, Task.ENERGY)
    if d.fields:
        offered.append(Task.FIELDS)
    if d.product:
        offered.append(Task.PRODUCT)
    if d.tasks is not None:
        offered = [t for t in offered if t in d.tasks]
    return offered + [derivative_task(name) for name, _ in d.derivatives]


def outputs(d: Definition, task: str) -> list[Entry]:
    """Output nodes of a task, before any pass: the first of its `variants`."""
    return next(variants(d, task))


def variants(d: Definition, task: str) -> Iterator[list[Entry]]:
    """The same outputs by different chain rules: which one is the cheapest, passes will tell."""
    if task == Task.ENERGY:
        yield [Entry(Slot(False, 0), None, d.potential)]
    elif task == Task.FIELDS:
        yield [Entry(Slot(False, k), None, node) for k, (_, node) in enumerate(d.fields)]
    elif task not in (Task.RESIDUAL, Task.TANGENT):
        yield _rates(d, task)
    else:
        waisted = list(_modal(d))
        for modal in waisted:
            yield modal.residual() + (modal.tangent() if task == Task.TANGENT else [])
        if not waisted or len(reachable([d.potential])) <= SMALL:
            yield _plain(d, task)


def _plain(d: Definition, task: str) -> list[Entry]:
    """Reverse mode, and forward over it through the waists that the model names."""
    adjoint = gradient(d.graph, d.potential, d.directions, constant=d.constant, given=d.given)
    slots = _slots(d)
    rows = [Entry(s, None, adjoint[u]) for s, u in zip(slots, d.directions, strict=True)]
    return rows + (_tangent(d, rows, slots, adjoint) if task == Task.TANGENT else [])


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


def _modal(d: Definition) -> Iterator[_Modal]:
    """The model through its automatic waists, in two ways; nothing where that does not apply."""
    if d.interpolated or d.given:
        return
    g = d.graph
    (root,), kept = strip(g, [d.potential], d.constant)
    if _has_guarded_values(root):
        return
    waist = linear_waist(g, [root], d.directions)
    if waist is None:
        return
    named: dict[Node, Node] = {}
    replacement = {z: _named(g, value, named) for z, value in waist.rewritten.items()}
    (root,), new = substitute(g, [root], replacement)
    forms = tuple(named.values())
    constant = tuple(new[kept[c]] for c in d.constant)
    root, constant, squares = _quadratic(g, root, forms, constant)
    yield _Modal(d, root, constant, waist, (forms, squares))
    above = reachable([root, *constant], stop=lambda n: n in squares or n in forms)
    upper = tuple(n for n in above if n in squares or n in forms)
    yield _Modal(d, root, constant, waist, (upper,), _slopes(g, waist, upper))


def _named(g: Graph, form: Node, named: dict[Node, Node]) -> Node:
    """The name of a linear form; a form and its negative share one."""
    negative = g.neg(form)
    if negative in named:
        return g.neg(named[negative])
    return named.setdefault(form, g.name(f"z{len(named)}", form))


def _quadratic(
    g: Graph, root: Node, forms: tuple[Node, ...], constant: tuple[Node, ...]
) -> tuple[Node, tuple[Node, ...], tuple[Node, ...]]:
    """Root and constants through named quadratic values of the forms, and these."""
    narrowed = narrow(g, [root], forms, constant)
    if narrowed is not None:
        return narrowed.roots[0], tuple(narrowed.images[c] for c in constant), narrowed.squares
    squares = {
        q: g.name(f"q{k}", q) for k, q in enumerate(quadratic_waist([root], forms, constant))
    }
    (root,), new = substitute(g, [root], squares)
    return root, tuple(new[c] for c in constant), tuple(squares.values())


def _slopes(g: Graph, waist: Waist, upper: Sequence[Node]) -> dict[Node, dict[Node, Node]]:
    """Named derivatives of the upper waist with respect to the point waist.

    The chain rule then never enters the forms in between: their congruence G^T H G becomes a sum
    of products of few slopes.
    """
    local = Linearisation(g, waist.modes, waist.point)
    return {
        q: {
            y: slope if slope.op in FREE else g.name(f"{q.payload}_{y.payload}", slope)
            for y, slope in local.local(q.args[0]).items()
        }
        for q in upper
        if q.varying
    }


_PARTIAL = frozenset({Op.RECIP, Op.POW, Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP})


def _has_guarded_values(root: Node) -> bool:
    """True where only a side of a branch holds a value that need not exist outside of it.

    A waist would take such a value out of its branch.
    """
    always: set[Node] = set()
    stack = [root]
    while stack:
        n = stack.pop()
        if n not in always:
            always.add(n)
            stack += n.args[:1] if n.op is Op.BRANCH else n.args
    return any(n.op in _PARTIAL and n not in always for n in reachable([root]))


@dataclass(frozen=True)
class _Modal:
    """Derivatives in modal coordinates, carried to the unknowns by their constant matrix.

    `upper` holds the waists above the point values, lowest first; `slopes` the derivatives of
    their values with respect to the point values, where these are taken at once.
    """

    d: Definition
    root: Node
    constant: tuple[Node, ...]
    waist: Waist
    upper: tuple[tuple[Node, ...], ...]
    slopes: Given = field(default_factory=dict)

    def _adjoint(self) -> dict[Node, Node]:
        return gradient(
            self.d.graph,
            self.root,
            self.waist.modes,
            constant=self.constant,
            given=self.slopes,
            named=[*self.waist.point, *(n for level in self.upper for n in level)],
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
        levels = self._levels()
        moving = Linearisation(g, modes, levels[0], upper=levels[1:], given=self.slopes)
        for i, c in enumerate(self.constant):
            for k in size:
                slope = by_constant.derivative(adjoint[modes[k]], i)
                for j in size:
                    term = g.mul(slope, moving.derivative(c, j))
                    rows[k][j] = g.add(rows[k][j], g.sum(term) if c.varying else term)
        return rows

    def _levels(self) -> list[list[Node]]:
        waists = (self.waist.point, *self.upper)
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
            given=self.slopes,
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
