"""The chain rule in modal coordinates: through interfaces and invariants that are found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from softehl.codegen.derive.interfaces import Interface, linear_interface
from softehl.codegen.derive.invariants import quadratic_interface, through_invariants
from softehl.codegen.derive.linearise import Linearisation
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.graph.differentiate import Given, gradient
from softehl.codegen.graph.graph import FREE, Graph, Node, Op
from softehl.codegen.graph.traverse import reachable, strip, substitute
from softehl.codegen.language.definition import Definition


def through_interfaces(d: Definition) -> Iterator[_Modal]:
    """The model through the interfaces that are found, in two ways; nothing where none apply."""
    if d.interpolated or d.given:
        return
    g = d.graph
    (root,), kept = strip(g, [d.potential], d.constant)
    if _has_guarded_values(root):
        return
    interface = linear_interface(g, [root], d.directions)
    if interface is None:
        return
    named: dict[Node, Node] = {}
    replacement = {z: _named(g, value, named) for z, value in interface.rewritten.items()}
    (root,), new = substitute(g, [root], replacement)
    forms = tuple(named.values())
    constant = tuple(new[kept[c]] for c in d.constant)
    root, constant, squares = _quadratic(g, root, forms, constant)
    yield _Modal(d, root, constant, interface, (forms, squares))
    above = reachable([root, *constant], stop=lambda n: n in squares or n in forms)
    upper = tuple(n for n in above if n in squares or n in forms)
    yield _Modal(d, root, constant, interface, (upper,), _slopes(g, interface, upper))


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
    reduced = through_invariants(g, [root], forms, constant)
    if reduced is not None:
        return reduced.roots[0], tuple(reduced.images[c] for c in constant), reduced.squares
    squares = {
        q: g.name(f"q{k}", q) for k, q in enumerate(quadratic_interface([root], forms, constant))
    }
    (root,), new = substitute(g, [root], squares)
    return root, tuple(new[c] for c in constant), tuple(squares.values())


def _slopes(g: Graph, interface: Interface, upper: Sequence[Node]) -> dict[Node, dict[Node, Node]]:
    """Named derivatives of the upper interface with respect to the point interface.

    The chain rule then never enters the forms in between: their congruence G^T H G becomes a sum
    of products of few slopes.
    """
    local = Linearisation(g, interface.modes, interface.point)
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

    An interface would take such a value out of its branch.
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

    `upper` holds the interfaces above the point values, lowest first; `slopes` the derivatives of
    their values with respect to the point values, where these are taken at once.
    """

    d: Definition
    root: Node
    constant: tuple[Node, ...]
    interface: Interface
    upper: tuple[tuple[Node, ...], ...]
    slopes: Given = field(default_factory=dict)

    def _adjoint(self) -> dict[Node, Node]:
        return gradient(
            self.d.graph,
            self.root,
            self.interface.modes,
            constant=self.constant,
            given=self.slopes,
            named=[*self.interface.point, *(n for level in self.upper for n in level)],
        )

    def residual(self) -> list[Entry]:
        """R_i = sum of V_ki dPi/dm_k."""
        adjoint = self._adjoint()
        rows = self._spread([adjoint[m] for m in self.interface.modes])
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
        g, modes, adjoint = self.d.graph, self.interface.modes, self._adjoint()
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
        interfaces = (self.interface.point, *self.upper)
        return [v for v in ([n for n in w if n.varying] for w in interfaces) if v] or [[]]

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
        for value, vector in zip(modal, self.interface.matrix, strict=True):
            for source, c in vector:
                i = at[source]
                out[i] = g.add(out[i], g.mul(g.const(c), value))
        return out
