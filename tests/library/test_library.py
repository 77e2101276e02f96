"""The library: every entry has a page, a source and a published number that it reaches."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, ModelFileError, Study, StudyError, von_mises
from softehl.codegen.models.material_elements import LAWS
from softehl.codegen.tools.library import (
    LONGEST,
    LibraryError,
    built_in,
    entries,
    entry,
    text_of,
)
from softehl.runtime.mesh.cells import CELLS
from tests.library import fracture
from tests.library.benchmark import Benchmark, Convergence
from tests.library.every import BENCHMARKS, CONVERGENCE
from tests.library.laws import TENSION

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "library.md").read_text(encoding="utf-8")
NUMBERS = json.loads((DOCS / "library.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "benchmark",
    [
        pytest.param(b, id=f"{b.entry}-{k}", marks=[pytest.mark.slow] if b.slow else [])
        for k, b in enumerate(BENCHMARKS)
    ],
)
def test_published_numbers(benchmark: Benchmark) -> None:
    value = benchmark.run()
    assert benchmark.error(value) <= benchmark.tolerance, (value, benchmark.published)


@pytest.mark.parametrize("table", CONVERGENCE, ids=lambda c: f"{c.entry}: {c.problem}")
def test_shells_converge(table: Convergence) -> None:
    """The numbers of the page: the coarsest anew, the finest within the tolerance."""
    found = [NUMBERS[table.key(size)] for size in table.sizes]
    assert table.run(table.sizes[0]) == pytest.approx(found[0], rel=1e-5)
    assert abs(found[-1] / table.published - 1) <= table.tolerance
    assert abs(found[-1] / table.published - 1) < abs(found[0] / table.published - 1)


def test_every_entry_is_short_documented_and_has_a_number() -> None:
    for e in entries().values():
        assert len(e.path.read_text(encoding="utf-8").splitlines()) <= LONGEST, e.name
        assert e.summary.endswith("."), e.name
        assert e.source, e.name
        assert e.benchmark, e.name
        assert e.kind == "material" or e.cells, e.name
        assert set(e.kinds) <= set(CELLS), e.name
        assert all(re.search(r"\w", meaning) for meaning in e.parameters.values()), e.name
    assert {b.entry for b in BENCHMARKS} == set(entries()) | set(built_in())


def test_laws_that_are_built_in() -> None:
    assert list(built_in()) == list(LAWS)
    for name, e in built_in().items():
        assert set(e.parameters) == set(TENSION[name][0]), name
    with pytest.raises(LibraryError, match="hooke is built in and has no file"):
        text_of("hooke")


def test_the_page_lists_every_entry_and_number() -> None:
    for e in entries().values():
        assert f"`{e.name}`" in PAGE, f"{e.name} is missing: python docs/library.py"
    for b in BENCHMARKS:
        assert b.problem in PAGE, f"{b.problem} is missing: python docs/library.py"


def test_the_numbers_of_the_page_are_within_their_tolerances() -> None:
    """Of all entries, the slow ones included; the page has eight digits."""
    missed = [b.key for b in BENCHMARKS if b.error(NUMBERS[b.key]) > max(b.tolerance, 1e-7)]
    assert not missed, "docs/library.py wrote numbers that are wrong"


def test_a_wrong_number_is_seen() -> None:
    b = BENCHMARKS[0]
    assert b.error(b.published * (1 + 2 * b.tolerance)) > b.tolerance


def test_elements_refuse_other_cells() -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    with pytest.raises(StudyError, match=r"'taylor_hood' is for quad9, tri6, .*, not for quad4"):
        study.add("b", element="taylor_hood", mu=1.0)
    with pytest.raises(StudyError, match="'truss' is for line2, not for quad4"):
        study.add("b", element="truss", E=1.0, A=1.0)


def test_names_that_are_not_there() -> None:
    assert entry("Hencky", "material").name == "hencky"
    with pytest.raises(LibraryError, match=r"no element 'trus'.*did you mean truss"):
        entry("trus", "element")
    with pytest.raises(LibraryError, match="hencky is a material"):
        entry("hencky", "element")
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    with pytest.raises(StudyError, match=r"give a page, element=\.\.\. or material=\.\.\., one"):
        study.add("b", element="truss", material="hooke")


@pytest.mark.parametrize(
    "element",
    [
        "plane_stress",
        "micropolar",
        "strain_gradient",
        "pian_sumihara",
        "q1e4",
        "at1",
        "thermoelastic",
    ],
)
def test_elements_without_a_hoop_strain_refuse_rings(element: str) -> None:
    order = 1 if "quad4" in (entry(element, "element").kinds or ["quad4"]) else 2
    mesh = Mesh.rectangle(1, 1, cells=(1, 1), order=order)
    study = Study(mesh, geometry="axisymmetric")
    with pytest.raises(ModelFileError, match="no hoop strain"):
        study.add("b", element=element)


@pytest.mark.slow
def test_the_force_by_griffith_is_that_of_the_elastic_plate() -> None:
    published = next(b.published for b in fracture.BENCHMARKS if "Griffith" in b.problem)
    assert fracture.griffith() == pytest.approx(published, rel=1e-5)


SHEET = {"E": 210e3, "nu": 0.3, "t": 2.0}
RUBBER = {"mu": 0.5, "kappa": 20.0}
STRESSED: list[tuple[str, str, dict[str, float]]] = [
    ("plane_stress", "quad4", SHEET),
    ("pian_sumihara", "quad4", SHEET),
    ("plane_stress_neo_hooke", "quad4", RUBBER | {"t": 2.0}),
    ("q1e4", "hex8", {"E": 210e3, "nu": 0.3}),
    ("fbar", "hex8", RUBBER),
    ("q1p0", "hex8", RUBBER),
    ("q1e9", "hex8", RUBBER),
    ("taylor_hood", "quad9", {"mu": 0.5}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind", "given"), STRESSED)
def test_stresses_are_those_of_the_reaction(name: str, kind: str, given: dict[str, float]) -> None:
    """A block that is pulled: Cauchy stress times deformed area, and von Mises of it."""
    order = 2 if kind == "quad9" else 1
    sides = {"left": "u_x", "bottom": "u_y"}
    if kind == "hex8":
        mesh = Mesh.box(1, 1, 1, cells=(2, 1, 1))
        sides |= {"bottom": "u_z", "front": "u_y"}
    else:
        mesh = Mesh.rectangle(1, 1, cells=(2, 1), order=order)
    study = Study(mesh)
    arguments: dict[str, Any] = dict(given)
    study.add("b", element=name, **arguments)
    for side, unknown in sides.items():
        study.fix(side, **{unknown: 0})
    large = "mu" in given
    study.fix("right", u_x=0.3 if large else 1e-6)
    result = study.solve(steps=3)
    fields = result.at_nodes("b")
    node = result.system.mesh.node_at(np.ones(mesh.dimension))
    area = given.get("t", 1.0)
    if large:
        for axis in "yz"[: mesh.dimension - 1]:
            area *= 1 + result.values(f"u_{axis}")[node]
        area *= fields.get("stretch_across", np.ones(node + 1))[node]
    force = result.reaction("right")["u_x"]
    assert fields["sigma_xx"][node] * area == pytest.approx(force, rel=1e-6)
    if kind != "quad9":
        assert von_mises(fields)[node] == pytest.approx(abs(fields["sigma_xx"][node]))
