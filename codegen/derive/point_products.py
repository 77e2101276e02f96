"""Tangent of a large element as a sum over the points of products B^T M B.

The integrand W of a potential sees the unknowns u through few values z (strains, gradients): W(z),
z(u). With B = dz/du, P = dW/dz and M = dP/dz the tangent is the sum over the points of

    B^T M B + sum over k of P_k d2 z_k / du2 .

Written out entry by entry it is thousands of operations, which take a C compiler minutes. Here
only B, M and the second term are; loops multiply. The z are the smallest set of values through
which all ways from the unknowns to W lead (a minimum vertex cut, after Menger), of those that are
polynomials of degree 1 or 2 in values that do not vary with the point.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from softehl.codegen.derive.output_entries import OutputArray, OutputEntry, OutputSlot
from softehl.codegen.derive.potential_structure import degrees
from softehl.codegen.graph.differentiation import Dependence, gradient
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import always, operations, reachable, strip, substitute
from softehl.codegen.language.definition import Definition

FEW = 12
"""Unknowns below which an element is never large."""
VAST = 25_000
"""Operations of a potential times unknowns from which no other way to a tangent is looked at."""
LARGE = 8_000
"""Operations of a tangent, before any pass, up to which it is written out: its C is then compiled
in some seconds."""


def outputs(d: Definition, residual: Sequence[OutputEntry]) -> list[OutputEntry] | None:
    """Return the residual, B, M and what is added to their products; None where it does not fit.

    Left out are potentials that are no sum of integrals, prescribed derivatives, and models whose
    integrand sees sums over points or more values than there are unknowns.
    """
    g = d.graph
    split = _split(d)
    if split is None or d.prescribed or d.interpolated or any(u.varying for u in d.directions):
        return None
    remainder = split[1]
    (integrand,), frozen = strip(g, [split[0]], d.constant)
    values = _values(d, integrand, set(frozen.values()))
    if values is None:
        return None
    point_values = [g.input("value at a point", k, varying=True) for k in range(len(values))]
    back = dict(zip(point_values, values, strict=True))
    (inside,), images = substitute(g, [integrand], dict(zip(values, point_values, strict=True)))
    constant = {images[c] for c in frozen.values() if c in images}
    free = [p for p in point_values if p not in constant]
    first = gradient(g, inside, free, constant=constant, flat=True)
    fluxes = {p: first[p] for p in free}
    moduli = [
        gradient(g, fluxes[p], point_values, flat=True) if p in fluxes else {} for p in point_values
    ]
    size = range(len(values))
    pairs = [(i, j) for i in size for j in size if not (d.conservative and j > i)]
    nonzero_moduli = {
        (i, j): moduli[i][point_values[j]]
        for i, j in pairs
        if moduli[i].get(point_values[j], g.zero) is not g.zero
    }
    b_matrix = [gradient(g, z, d.directions, flat=True) for z in values]
    curved = _curvature(d, values, {z: fluxes[p] for p, z in back.items() if p in fluxes})
    made = [*nonzero_moduli.values(), *curved.values()]
    new, _ = substitute(g, made, back)
    at = iter(new)
    entries = [*residual]
    entries += [
        OutputEntry(OutputSlot(False, i), OutputSlot(False, j), next(at), OutputArray.MODULI)
        for i, j in nonzero_moduli
    ]
    entries += [
        OutputEntry(OutputSlot(False, i), OutputSlot(False, j), next(at), OutputArray.ADDED)
        for i, j in curved
    ]
    entries += [
        OutputEntry(OutputSlot(False, k), OutputSlot(False, j), row[u], OutputArray.SLOPES)
        for k, row in enumerate(b_matrix)
        for j, u in enumerate(d.directions)
        if row[u] is not g.zero
    ]
    return entries + _fixed(d, remainder)


def is_vast(d: Definition) -> bool:
    """True if a tangent would be so long that it takes long to write it out at all."""
    return operations([d.potential]) * len(d.unknowns) > VAST


def is_large(tangent: Sequence[OutputEntry]) -> bool:
    """True if a tangent that is written out entry by entry is long."""
    return operations([x.node for x in tangent]) > LARGE


def _split(d: Definition) -> tuple[Node, Node] | None:
    """Integrand of a potential that is one integral plus a value without any; None: another one."""
    g, fixed = d.graph, Dependence(tuple(d.directions))
    integrand, remainder = g.zero, g.zero
    stack = [(d.potential, g.one)]
    while stack:
        n, factor = stack.pop()
        match n.op:
            case Op.NAME if n not in d.constant:
                stack.append((n.args[0], factor))
            case Op.ADD | Op.SUB:
                sign = factor if n.op is Op.ADD else g.neg(factor)
                stack += [(n.args[1], sign), (n.args[0], factor)]
            case Op.NEG:
                stack.append((n.args[0], g.neg(factor)))
            case Op.MUL if not (fixed(n.args[0]) and fixed(n.args[1])) and fixed(n):
                a, b = n.args if fixed(n.args[1]) else tuple(reversed(n.args))
                stack.append((b, g.mul(factor, a)))
            case Op.SUM:
                integrand = g.add(integrand, g.mul(factor, n.args[0]))
            case _:
                if any(m.op is Op.SUM for m in reachable([n])) and fixed(n):
                    return None
                remainder = g.add(remainder, g.mul(factor, n))
    return None if integrand is g.zero else (integrand, remainder)


def _values(d: Definition, integrand: Node, constant: set[Node]) -> list[Node] | None:
    """The fewest values through which the integrand sees the unknowns, or None."""
    depends, frozen = Dependence(tuple(d.directions)), Dependence(tuple(constant))
    nodes = reachable([integrand])
    base = [n for n in nodes if not n.varying and depends(n)]
    degree = degrees([integrand], base, ())
    certain = set(always([integrand], conditions=False))

    def allowed(limit: int) -> set[Node]:
        return {
            n
            for n in certain
            if depends(n)
            and degree[n] <= limit
            and n is not integrand
            and (n in constant or not frozen(n))
            and not any(m.op is Op.SUM for m in (n, *n.args))
        }

    users = [n for n in nodes if depends(n)]
    linear = _cut(users, integrand, allowed(1), len(d.unknowns))
    curved = None
    if degree[integrand] > 2:
        curved = _cut(users, integrand, allowed(2), len(d.unknowns) if not linear else len(linear))
    selected = curved if curved and (not linear or 2 * len(curved) <= len(linear)) else linear
    if not selected or any(m.op is Op.SUM for m in reachable(selected)):
        return None
    return sorted(selected, key=lambda n: n.id)


def _cut(users: Sequence[Node], end: Node, allowed: set[Node], max_nodes: int) -> list[Node] | None:
    """Smallest set of allowed nodes that every way from an unknown to `end` meets, nearest to the
    unknowns; None if it has more than `max_nodes` nodes.

    Each augmenting path raises the flow through the nodes by one; a node is met at its entry (its
    number times 2) and left at its exit.
    """
    number = {n: k for k, n in enumerate(users)}
    last = 2 * number[end] + 1
    capacity: dict[int, dict[int, int]] = {}
    infinite = max_nodes + 1

    def joined(a: int, b: int, c: int) -> None:
        capacity.setdefault(a, {})[b] = c
        capacity.setdefault(b, {}).setdefault(a, 0)

    for n, k in number.items():
        joined(2 * k, 2 * k + 1, 1 if n in allowed else infinite)
        below = [number[a] for a in dict.fromkeys(n.args) if a in number]
        for a in below:
            joined(2 * a + 1, 2 * k, infinite)
        if not below:
            joined(-1, 2 * k, infinite)
    for _ in range(max_nodes + 1):
        predecessors = _predecessors(capacity, last)
        if last not in predecessors:
            return [
                n
                for n, k in number.items()
                if 2 * k in predecessors and 2 * k + 1 not in predecessors
            ]
        at = last
        while at != -1:
            previous = predecessors[at]
            capacity[previous][at] -= 1
            capacity[at][previous] += 1
            at = previous
    return None


def _predecessors(capacity: Mapping[int, Mapping[int, int]], last: int) -> dict[int, int]:
    """Predecessor of each vertex that can be reached, breadth first."""
    predecessors = {-1: -1}
    waiting = deque([-1])
    while waiting and last not in predecessors:
        at = waiting.popleft()
        for to, left in capacity[at].items():
            if left > 0 and to not in predecessors:
                predecessors[to] = at
                waiting.append(to)
    return predecessors


def _curvature(
    d: Definition, values: Sequence[Node], fluxes: Mapping[Node, Node]
) -> dict[tuple[int, int], Node]:
    """Lower triangle of the sum of fluxes times second derivatives of the values."""
    g = d.graph
    frozen = {z: g.input("flux at a point", k, varying=True) for k, z in enumerate(values)}
    total = g.zero
    for z in values:
        if z in fluxes:
            total = g.add(total, g.mul(frozen[z], z))
    lower = _hessian(g, total, d.directions)
    back = {frozen[z]: flux for z, flux in fluxes.items()}
    new, _ = substitute(g, list(lower.values()), back)
    return dict(zip(lower, new, strict=True))


def _hessian(g: Graph, value: Node, unknowns: Sequence[Node]) -> dict[tuple[int, int], Node]:
    """Lower triangle of the second derivatives of a value, without zeros."""
    rows = gradient(g, value, unknowns, flat=True)
    lower = {}
    for i, u in enumerate(unknowns):
        row = gradient(g, rows[u], unknowns[: i + 1], flat=True)
        lower.update({(i, j): row[v] for j, v in enumerate(unknowns[: i + 1])})
    return {at: n for at, n in lower.items() if n is not g.zero}


def _fixed(d: Definition, remainder: Node) -> list[OutputEntry]:
    """Second derivatives of what is no integral."""
    g = d.graph
    rows = gradient(g, remainder, d.directions, constant=d.constant)
    entries = []
    for i, u in enumerate(d.directions):
        row = gradient(g, rows[u], d.directions) if rows[u] is not g.zero else {}
        entries += [
            OutputEntry(OutputSlot(False, i), OutputSlot(False, j), row[v], OutputArray.ADDED)
            for j, v in enumerate(d.directions)
            if row.get(v, g.zero) is not g.zero and not (d.conservative and j > i)
        ]
    return entries


@dataclass(frozen=True)
class ProductBlock:
    """Values at a point that depend on the same unknowns: rows of B with the same columns."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def blocks(entries: Sequence[OutputEntry]) -> list[ProductBlock]:
    """Rows of B, those of the same columns together."""
    columns: dict[int, list[int]] = {}
    for x in entries:
        if x.array is OutputArray.SLOPES and x.column is not None:
            columns.setdefault(x.row.position, []).append(x.column.position)
    rows: dict[tuple[int, ...], list[int]] = {}
    for row, some in columns.items():
        rows.setdefault(tuple(some), []).append(row)
    return [ProductBlock(tuple(k), some) for some, k in rows.items()]
