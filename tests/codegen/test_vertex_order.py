"""Orders of nodes for target `ufcx`: every element against basix, what basix has not is refused."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from softehl.codegen import pipeline
from softehl.codegen.abi import VERTEX_ORDER, Target, TargetError
from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.elements.element import Element
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

NOT_NODAL = ("quad8", "hex20", "wedge15", "pyramid5")
NODAL = [name for name in ELEMENTS if ELEMENTS[name].lines is None and name not in NOT_NODAL]
KINDS = {
    "line": "interval",
    "tri": "triangle",
    "quad": "quadrilateral",
    "tet": "tetrahedron",
    "hex": "hexahedron",
    "wedge": "prism",
}


def laplace(e: Element) -> Definition:
    """Any potential that uses every node of an element."""
    m = Model("laplace", nodes=len(e.nodes), rule=e.rule)
    X = m.coordinates(*"XYZ"[: e.dimension])
    (u,) = m.nodal_unknowns("u")
    m.potential(sum(a * b**3 for x in X for a, b in zip(x, u, strict=True)))
    return m.finish()


def on_unit_cell(e: Element) -> Any:
    """Nodes (n, d) where basix has its cells: on [0, 1]."""
    places = np.array(e.nodes, dtype=np.float64)
    kind = e.name.rstrip("0123456789")
    if kind in ("line", "quad", "hex"):
        return (places + 1) / 2
    if kind == "wedge":
        places[:, 2] = (places[:, 2] + 1) / 2
    return places


def key(name: str) -> tuple[int, int]:
    return len(ELEMENTS[name].nodes), ELEMENTS[name].dimension


@pytest.mark.parametrize("name", NODAL)
def test_orders_are_those_of_basix(name: str) -> None:
    basix = pytest.importorskip("basix")
    cell = getattr(basix.CellType, KINDS[name.rstrip("0123456789")])
    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.equispaced
    elements = [basix.create_element(family, cell, degree, variant) for degree in (1, 2)]
    (theirs,) = (e.points for e in elements if len(e.points) == len(ELEMENTS[name].nodes))
    found = theirs[list(VERTEX_ORDER[key(name)])]
    np.testing.assert_allclose(found, on_unit_cell(ELEMENTS[name]), atol=1e-14)


@pytest.mark.parametrize("name", ["line2", "quad4", "hex8"])
def test_corners_are_in_tensor_order(name: str) -> None:
    """Without basix: the first coordinate runs fastest."""
    e = ELEMENTS[name]
    corners = np.array([p[::-1] for p in product((0, 1), repeat=e.dimension)])
    np.testing.assert_array_equal(corners[list(VERTEX_ORDER[key(name)])], on_unit_cell(e))


def test_every_element_is_ordered_or_refused() -> None:
    assert {key(n) for n in NODAL} | {(1, 0), (2, 0)} == set(VERTEX_ORDER)
    assert len({key(n) for n in ELEMENTS}) == len(ELEMENTS)
    for (count, _), order in VERTEX_ORDER.items():
        assert sorted(order) == list(range(count))


@pytest.mark.parametrize("name", ["tri6", "quad9", "tet10"])
def test_unknowns_and_coordinates_are_permuted(name: str) -> None:
    d = laplace(ELEMENTS[name])
    text = pipeline.compile_model(d, Target.UFCX).text
    for node, vertex in enumerate(VERTEX_ORDER[key(name)]):
        assert f" * w[{vertex}]  u{node + 1}\n" in text
    assert f"{node + 1} at {vertex}" in text


@pytest.mark.parametrize("name", NOT_NODAL)
def test_elements_without_a_counterpart_are_refused(name: str) -> None:
    count, dimension = key(name)
    with pytest.raises(TargetError, match=rf"{count} nodes and a rule in {dimension}-D; DOLFINx"):
        pipeline.compile_model(laplace(ELEMENTS[name]), Target.UFCX)
