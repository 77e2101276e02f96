"""Fields that a page interpolates along its elements: where their unknowns stand, and the rule."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.definition.argument_checks import require_names
from softehl.runtime.definition.problem_definition import Block, PageOptions, StudyError
from softehl.runtime.discretisation.dofmap import Slot
from softehl.runtime.discretisation.quadrature import (
    automatic_points,
    gauss,
    lagrange,
    pressure_nodes,
    several,
)
from softehl.runtime.kernels.kernel import Kernel, Rule
from softehl.runtime.suggestions import join_names


def placed(
    block: str, kernel: Kernel, count: int, slots: Sequence[Slot], form: PageOptions
) -> tuple[tuple[Slot, ...], PageOptions]:
    """Slots of unknowns at nodes and of elements, and the form with the places of all others.

    count: of the elements. An order stands for a polynomial by its values at the Gauss-Lobatto
    points of a line: the first and the last are unknowns of its two nodes, those between them of
    the element ("p:1", ...). An unknown of an element may be the one at a place of a field of other
    elements. Raises StudyError.
    """
    element_slots = [s for s in slots if s.node is None and s.name in form.along]
    node_slots, standing = (
        tuple(s for s in slots if s not in element_slots),
        [s.name for s in element_slots],
    )
    names = [name for name in form.along if name not in standing]
    if bool(names) != bool(kernel.interpolated) or (*node_slots, *element_slots) != tuple(slots):
        has = kernel.interpolated or join_names([s.name for s in slots if s.node is None])
        example = f", as in along={{{kernel.interpolated!r}: 2}}" if kernel.interpolated else ""
        raise StudyError(
            f"{block!r}: along = {join_names(form.along)}; {kernel.name} has {has} along "
            f"its elements{example}"
        )
    renamed = [form.called[name] for name in interpolated(kernel) if name in form.called]
    require_names("field", renamed, form.along, f"{block!r}: along")
    orders = _orders(block, kernel, form)
    names = list(orders) or names
    along = [f for name, order in orders.items() for f in _by_order(name, order)]
    dof_tables = (
        {} if orders else {n: _dof_table(block, n, count, form.along[n]) for n in form.along}
    )
    dof_tables = {name: dof_tables[name] for name in (*standing, *names) if name in dof_tables}
    widths = [orders[n] + 1 if orders else dof_tables[n].shape[1] for n in names]
    rule = form.rule
    if names and (rule is None or rule.basis is None):
        rule = _rule(block, kernel, [w - 1 for w in widths], rule)
    functions = 0 if rule is None or rule.basis is None else rule.basis.shape[1]
    if names and functions != sum(widths):
        raise StudyError(
            f"{block!r}: an element has {sum(widths)} unknowns along it, the rule {functions} "
            "functions"
        )
    return (*node_slots, *along), replace(form, along=dof_tables, rule=rule)


def interpolated(kernel: Kernel) -> list[str]:
    """Names of the fields that a page interpolates."""
    return kernel.interpolated.split(", ") if kernel.interpolated else []


def require_apart(block: Block, others: Iterable[Block]) -> None:
    """Raise StudyError where two blocks on one line would have inner unknowns of their own."""
    inner = {slot.name for slot in block.slots if slot.node is None and ":" in slot.name}
    for other in others:
        both = inner & {slot.name for slot in other.slots}
        if both and _lines(block) & _lines(other):
            field = min(both).partition(":")[0]
            raise StudyError(
                f"{block.name!r}: {other.name!r} has {field} along the same lines: give both the "
                "places of its unknowns, so that they share them"
            )


def _lines(block: Block) -> set[tuple[int, ...]]:
    return {tuple(sorted(end_nodes)) for end_nodes in block.nodes[:, :2].tolist()}


def _by_order(name: str, order: int) -> tuple[Slot, ...]:
    """Unknowns of a polynomial along a line, from its first node to its second."""
    inner = (Slot(f"{name}:{k}", None) for k in range(1, order))
    return (Slot(name, 0), *inner, Slot(name, 1))


def _orders(block: str, kernel: Kernel, form: PageOptions) -> dict[str, int]:
    """Orders of the fields, as the page lists them; none where places are given.

    Raises StudyError.
    """
    along = form.along
    orders = {n: int(order) for n, order in along.items() if isinstance(order, int | np.integer)}
    if orders and (len(orders) < len(along) or kernel.nodes < 2):
        raise StudyError(
            f"{block!r}: along = {join_names(along)}: orders for all of them, on lines of 2 nodes "
            "or more, or places for all of them"
        )
    for name, order in orders.items():
        if order < 1:
            raise StudyError(f"{block!r}: along {name!r}: order {order}, must be at least 1")
    fields = [form.called.get(name, name) for name in interpolated(kernel)]
    if (form.rule and form.rule.basis is not None) or len(orders) != len(fields):
        return orders
    require_names("field", orders, fields, kernel.name)
    return {name: orders[name] for name in fields}


def _rule(block: str, kernel: Kernel, orders: Sequence[int], rule: Rule | None) -> Rule:
    """Lagrange polynomials of these orders at the points of a rule.

    Left out, they are Gauss points which integrate products of them.
    """
    if len(interpolated(kernel)) != len(orders) or min(orders) < 1:
        raise StudyError(
            f"{block!r}: {kernel.name} interpolates {kernel.interpolated}: give an order for each "
            "of them, or the rule with their shape functions, rule=..."
        )
    at = rule or gauss(automatic_points(max(orders), "gauss"))
    if at.points.shape[1:] != (1,):
        raise StudyError(
            f"{block!r}: the rule has points of {at.points.shape[1]} coordinates; a line has 1"
        )
    bases = [lagrange(pressure_nodes(order), at.points[:, 0]) for order in orders]
    rules = [Rule(at.points, at.weights, basis) for basis in bases]
    return rules[0] if len(rules) == 1 else several(*rules)


def _dof_table(block: str, name: str, count: int, table: int | Integers) -> Integers:
    """Places (n, m) of a field, counted from 0.  Raises StudyError."""
    numbers = np.asarray(table)
    if numbers.dtype.kind not in "iu" or numbers.ndim != 2 or len(numbers) != count:
        raise StudyError(
            f"{block!r}: along {name!r}: an order, or numbers of places ({count}, m); given "
            f"{numbers.dtype} of shape {numbers.shape}"
        )
    if numbers.size and numbers.min() < 0:
        raise StudyError(f"{block!r}: along {name!r}: places are counted from 0")
    return numbers
