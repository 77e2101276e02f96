"""Fields that a page interpolates along its elements: places of their unknowns, and the rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.fem.rules import automatic_points, film_rule, several
from softehl.runtime.fem.unknowns import Slot
from softehl.runtime.kernels import Kernel, Rule
from softehl.runtime.names import listed
from softehl.runtime.statement.records import Form, StudyError


def placed(
    block: str, kernel: Kernel, nodes: Integers, slots: Sequence[Slot], form: Form
) -> tuple[tuple[Slot, ...], Form]:
    """Slots that are not along the elements, and the form with the places of those that are.

    An order stands for polynomials of this order that are continuous where elements have an end in
    common: their values at the Gauss-Lobatto points, those at the ends first, in the order of their
    nodes. An unknown of the element may stand at a place of a field of other elements. Raises
    StudyError.
    """
    own = [s for s in slots if s.node is None and s.name in form.along]
    rest, standing = tuple(s for s in slots if s not in own), [s.name for s in own]
    names = [name for name in form.along if name not in standing]
    if bool(names) != bool(kernel.interpolated) or (*rest, *own) != tuple(slots):
        has = kernel.interpolated or listed([s.name for s in slots if s.node is None])
        example = f", as in along={{{kernel.interpolated!r}: 2}}" if kernel.interpolated else ""
        raise StudyError(
            f"{block!r}: along = {listed(form.along)}; {kernel.name} has {has} along "
            f"its elements{example}"
        )
    places = {n: _places(block, n, nodes, form.along[n]) for n in (*standing, *names)}
    orders = [places[name].shape[1] - 1 for name in names]
    rule = form.rule or (_rule(block, kernel, orders) if names else None)
    count = sum(places[name].shape[1] for name in names)
    if names and (rule is None or rule.basis is None or rule.basis.shape[1] != count):
        there = 0 if rule is None or rule.basis is None else rule.basis.shape[1]
        raise StudyError(
            f"{block!r}: an element has {count} unknowns along it, the rule {there} functions"
        )
    return rest, replace(form, along=places, rule=rule)


def _rule(block: str, kernel: Kernel, orders: Sequence[int]) -> Rule:
    """Lagrange polynomials of these orders at Gauss points, which integrate products of them."""
    fields = (kernel.interpolated or "").split(", ")
    if len(fields) != len(orders) or min(orders) < 1:
        raise StudyError(
            f"{block!r}: {kernel.name} interpolates {kernel.interpolated}: give an order for each "
            "of them, or the rule with their shape functions, rule=..."
        )
    points = automatic_points(max(orders), "gauss")
    rules = [film_rule(order, "gauss", points) for order in orders]
    return rules[0] if len(rules) == 1 else several(*rules)


def _places(block: str, name: str, nodes: Integers, given: int | Integers) -> Integers:
    """Places (n, m) of a field, counted from 0.  Raises StudyError."""
    n = len(nodes)
    if isinstance(given, int):
        if given < 1:
            raise StudyError(f"{block!r}: along {name!r}: order {given}, must be at least 1")
        ends, numbers = np.unique(nodes[:, :2], return_inverse=True)
        first, last = numbers.reshape(n, 2).T
        inner = len(ends) + np.arange(n * (given - 1)).reshape(n, given - 1)
        return np.column_stack([first, inner, last])
    places = np.asarray(given)
    if places.dtype.kind not in "iu" or places.ndim != 2 or len(places) != n or (places < 0).any():
        raise StudyError(
            f"{block!r}: along {name!r}: an order, or numbers of places from 0 on, ({n}, m); given "
            f"{places.dtype} of shape {places.shape}"
        )
    return places
