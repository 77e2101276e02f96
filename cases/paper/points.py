"""Quadrature points of the film: h* by the rules of Gauss and Lobatto with few points."""

from __future__ import annotations

from softehl.cases.paper.item import Item, Product, Scope, Table
from softehl.cases.paper.states import Request, Store, ask, setup

DENSITIES = (1, 2)
POINTS = (2, 3, 4)
ORDER = 2
RULES = ("gauss", "lobatto")


def _request(scope: Scope, density: int, points: int, rule: str) -> Request:
    others = {"pressure_order": ORDER, "quadrature": rule, "quadrature_points": points}
    return ask(setup(density, scope.pressure(1.0), **others), [scope.speed(400.0)])


def _cases(scope: Scope) -> list[tuple[int, int]]:
    return [(d, n) for d in scope.meshes(DENSITIES, default=2) for n in POINTS]


def _requests(scope: Scope) -> list[Request]:
    return [_request(scope, d, n, rule) for d, n in _cases(scope) for rule in RULES]


def points(store: Store, scope: Scope) -> Product:
    """h* over density and number of points, and how far the rules differ."""
    rows, u = [], scope.speed(400.0)
    for d, n in _cases(scope):
        gauss, lobatto = (store.state(_request(scope, d, n, r).setup, u).h_star for r in RULES)
        rows.append((d, n, gauss, lobatto, 100.0 * (lobatto / gauss - 1.0)))
    header = ("density", "points", "gauss_um", "lobatto_um", "difference_percent")
    caption = (
        f"h*, FE, m_p = {ORDER}, outstroke, p_s = {scope.pressure(1.0):g} MPa, U = {u:g} mm/s."
    )
    return Product({"points": Table(header, rows)}, caption)


ITEMS = (Item("points", "Number of quadrature points", points, _requests),)
