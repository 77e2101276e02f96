"""Chain rules in modal coordinates, through the linear forms and invariants of a potential."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from softehl.codegen.derive.linear_interfaces import LinearInterface
from softehl.codegen.derive.multilevel_chain_rule import Linearisation
from softehl.codegen.derive.output_entries import OutputEntry, OutputSlot
from softehl.codegen.derive.potential_structure import PotentialStructure
from softehl.codegen.graph.differentiation import PrescribedDerivatives, gradient
from softehl.codegen.graph.graph import FREE, Graph, Node
from softehl.codegen.graph.guarded_products import Certain
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition


def by_levels(d: Definition, s: PotentialStructure) -> ModalChainRule:
    """Level by level: quadratic values, linear forms, point values, modal coordinates."""
    return ModalChainRule(d, s, (s.forms, s.squares))


def by_derivatives(d: Definition, s: PotentialStructure) -> ModalChainRule:
    """Chain rule that skips the linear forms: derivatives of the top interface by point values."""
    inner = {*s.squares, *s.forms}
    upper = tuple(
        n for n in reachable([s.root, *s.constant], stop=inner.__contains__) if n in inner
    )
    return ModalChainRule(d, s, (upper,), _named_derivatives(d.graph, s.interface, upper))


def _named_derivatives(
    g: Graph, interface: LinearInterface, upper: Sequence[Node]
) -> dict[Node, dict[Node, Node]]:
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


@dataclass(frozen=True)
class ModalChainRule:
    """Derivatives in modal coordinates, carried to the unknowns by their constant matrix.

    `upper` holds the interfaces above the point values, lowest first; `derivatives` those
    of their values with respect to the point values, where these are taken at once.
    """

    d: Definition
    s: PotentialStructure
    upper: tuple[tuple[Node, ...], ...]
    derivatives: PrescribedDerivatives = field(default_factory=dict)

    def _adjoint(self) -> dict[Node, Node]:
        return gradient(
            self.d.graph,
            self.s.root,
            self.s.interface.modes,
            constant=self.s.constant,
            prescribed=self.derivatives,
            named=[*self.s.interface.point, *(n for level in self.upper for n in level)],
        )

    def residual(self) -> list[OutputEntry]:
        """R_i = sum of V_ki dPi/dm_k."""
        adjoint = self._adjoint()
        rows = self._at_unknowns([adjoint[m] for m in self.s.interface.modes])
        return [OutputEntry(OutputSlot(False, i), None, n) for i, n in enumerate(rows)]

    def tangent(self) -> list[OutputEntry]:
        """K_ij = sum of V_ki (d2 Pi / dm_k dm_l) V_lj."""
        modal = self._modal_tangent()
        half = [self._at_unknowns(row) for row in modal]
        full = [self._at_unknowns(column) for column in zip(*half, strict=True)]
        size = range(len(full))
        upper = self.d.conservative
        return [
            OutputEntry(
                OutputSlot(False, i),
                OutputSlot(False, j),
                full[i][j] if upper and j < i else full[j][i],
            )
            for i in size
            for j in size
        ]

    def _modal_tangent(self) -> list[list[Node]]:
        """Symmetric part at fixed constants, plus what the constants contribute."""
        g, modes, adjoint = self.d.graph, self.s.interface.modes, self._adjoint()
        fixed = self._forward(adjoint, modes, self.s.constant)
        size = range(len(modes))
        rows: list[list[Node]] = [[] for _ in modes]
        for k in size:
            for j in size:
                rows[k].append(rows[j][k] if j < k else fixed.derivative(adjoint[modes[k]], j))
        if not self.s.constant:
            return rows
        by_constant = self._forward(adjoint, self.s.constant, modes)
        levels = self._levels()
        moving = Linearisation(g, modes, levels[0], upper=levels[1:], prescribed=self.derivatives)
        for i, c in enumerate(self.s.constant):
            for k in size:
                slope = by_constant.derivative(adjoint[modes[k]], i)
                for j in size:
                    term = g.mul(slope, moving.derivative(c, j))
                    rows[k][j] = g.add(rows[k][j], g.sum(term) if c.varying else term)
        return rows

    def _levels(self) -> list[list[Node]]:
        interfaces = (self.s.interface.point, *self.upper)
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
            prescribed=self.derivatives,
            upper=levels[1:],
            gates={adjoint[z]: k for k, level in enumerate(levels) for z in level if z in adjoint},
            certain=Certain([self.s.root]),
        )

    def _at_unknowns(self, modal: Sequence[Node]) -> list[Node]:
        """Values at the unknowns of a linear functional of the modal coordinates."""
        g: Graph = self.d.graph
        at = {u.id: i for i, u in enumerate(self.d.directions)}
        out = [g.zero for _ in self.d.directions]
        for value, vector in zip(modal, self.s.interface.matrix, strict=True):
            for source, c in vector:
                i = at[source]
                out[i] = g.add(out[i], g.mul(g.const(c), value))
        return out
