"""Reduced spherical Bessel functions of a length: sin(x) / x and its derivatives, smooth at zero.

S_n(w) = j_n(|w|) / |w|^n is an even entire function of the length of w, and its derivative by w_i
is -w_i S_(n+1)(w). So no derivative of any order divides by the length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from softehl.codegen.graph.graph import Graph, Node, Routine
from softehl.codegen.graph.partial_derivatives import DifferentiationError


@dataclass(frozen=True, eq=False)
class Bessel(Routine):
    """S_n of the length of its operands."""

    order: int

    def divided(self, between: Any, call: Node) -> list[Node]:
        raise DifferentiationError(
            "m.sinc, m.cosc and m.rotation have no divided differences: they may not be functions "
            "of an eigenvalue"
        )

    def partials(self, g: Graph, item: Node) -> list[tuple[Node, Node]]:
        args = item.args[0].args
        (higher,) = g.run(bessel(self.order + 1, len(args)), args)
        return [(w, g.neg(g.mul(w, higher))) for w in args]


@cache
def bessel(order: int, size: int) -> Bessel:
    """The routine of S_order of a vector."""
    return Bessel(f"bessel_{order}_of_{size}", size, 1, order)
