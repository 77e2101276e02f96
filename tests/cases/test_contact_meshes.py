"""Meshes that the contact places, and contact states that are kept."""

import shutil
import threading
from collections.abc import Callable
from functools import cache
from math import inf, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.section_keys import dimensions
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from softehl.cases.seal.meshing.o_grid import MOST_LAYERS, SHORT, STEEPEST_GROWTH
from softehl.cases.seal.meshing.section_mesh import corner_jacobians
from softehl.cases.seal.meshing.spacing import Spacing, Spot, graded
from softehl.cases.seal.section.layout import Layout, uniform_layout
from softehl.cases.seal.solve.arc_meshing import contact_layout
from softehl.cases.seal.solve.contact_meshes import (
    FIRST_LEG,
    WITHOUT_INFLUENCE,
    ContactMeshes,
    ContactStore,
    contact_key,
    legs_of,
    stored_contact,
)
from softehl.cases.seal.solve.contact_solver import LEG, ContactSolver
from softehl.cases.seal.solve.contact_stages import contact_problem
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_arrays, write_arrays
from tests.cases.oring_cases import oring

# --- Graded meshes: contact edges, shape of the elements, the contact and the film on them --------


_RADIUS = 0.5 * Seal().section_diameter


@cache
def _contact(density: int, mesh: str = "graded", p_s: float = 1.0) -> tuple[SealSystem, Array]:
    route = ContactMeshes(ContactSolver(PathDriver(Silent())))
    return route.contact(oring(density=density, mesh=mesh, sealed_pressure=p_s))


@cache
def _curve(**changes: object) -> Outcome[FilmState]:
    return run(oring(**changes), Silent())


def test_the_edge_of_a_pressure_like_a_square_root_is_found_exactly() -> None:
    system = build_system(oring(density=2))
    s = system.section.positions
    x = system.at_rest()
    first, last = 0.413, 1.777
    system.rod_multipliers(x)[:] = -np.sqrt(np.maximum(np.minimum(s - first, last - s), 0.0))
    edges = contact_edges(system, x)
    assert [edge.position for edge in edges] == pytest.approx([first, last], abs=1e-12)
    assert [edge.rise for edge in edges] == pytest.approx([1.0, 1.0], abs=1e-12)


def test_segments_are_finest_at_the_edges_of_the_contact() -> None:
    system, x = _contact(2)
    s = system.section.positions
    sizes, middle = np.diff(s), 0.5 * (s[1:] + s[:-1])
    for edge in contact_edges(system, x):
        nearest = np.abs(middle - edge.position).argmin()
        assert sizes[nearest] < 1.6 * sizes.min()
        assert sizes[nearest] < 1.4 * sizes[nearest - 2 : nearest + 3].min()
    assert sizes.min() < 0.2 * sizes.mean()
    assert len(s) == 55


def test_a_graded_mesh_is_valid_and_its_boundary_is_round() -> None:
    system, x = _contact(2)
    assert system.section.layout.shape.outline.disc is not None
    centre, radius = system.section.layout.shape.outline.disc
    radii = np.hypot(*(system.mesh.points[system.mesh.boundary] - centre).T)
    assert radii == pytest.approx(np.full(len(radii), radius), rel=1e-13)
    assert corner_jacobians(system.mesh).min() > 0.1
    assert contact_layout(system, x, system.parameters).sizes.spacing is not None


def test_the_same_contact_is_found_on_both_meshes() -> None:
    pressures = []
    for mesh in ("uniform", "graded"):
        system, x = _contact(2, mesh, p_s=0.0)
        pressures.append(-(system.rod_multipliers(x) * system.rod_areas).sum())
    assert pressures[1] == pytest.approx(pressures[0], rel=3e-3)


@pytest.mark.slow
def test_a_graded_film_needs_no_finer_mesh_at_low_speed() -> None:
    """h* of graded density 8, outstroke: 0.2581 um at 25 and 0.5953 um at 100 mm/s."""
    outcome = _curve(mesh="graded", density=2, stroke="out", speeds=(100.0, 25.0))
    h = [state.h_star_um for state in outcome.states]
    assert outcome.converged
    assert h == pytest.approx([0.5953, 0.2581], rel=5e-3)
    assert [state.verdict for state in outcome.states] == ["ok", "ok"]
    uniform = _curve(
        mesh="uniform", error_estimate=False, density=2, stroke="out", speeds=(100.0, 25.0)
    )
    assert [state.verdict for state in uniform.states] == ["ok", "under-resolved"]


@pytest.mark.parametrize(("depth", "layers"), [(inf, 3), (5e-2, 3), (1e-2, 3), (1e-3, 6)])
def test_layers_below_the_arc_are_as_thin_as_the_inlet_is_long(depth: float, layers: int) -> None:
    layout, spacing = _placed()
    plain, thin = layout.graded(spacing, 33), layout.graded(spacing, 33, depth)
    thicknesses = np.diff([_depth(thin, ring) for ring in range(2 * layers + 1)])
    ratios = thicknesses[1:] / thicknesses[:-1]
    assert len(thin.mesh(2).quads) == len(plain.mesh(2).quads) + (layers - 3) * 2 * 2 * (66 + 12)
    assert thicknesses[0] <= depth
    assert np.all(ratios > 1.0)
    assert np.all(ratios <= STEEPEST_GROWTH + 1e-9)
    assert corner_jacobians(thin.mesh(2)).min() > 0.1
    same = np.array_equal(thin.mesh(2).points, plain.mesh(2).points)
    assert same == (depth > _depth(plain, 1))


def test_more_layers_than_there_may_be_are_not_made() -> None:
    layout, spacing = _placed()
    thinnest = layout.graded(spacing, 33, 1e-9)
    thicknesses = np.diff([_depth(thinnest, ring) for ring in range(2 * MOST_LAYERS + 1)])
    assert thicknesses[1:] / thicknesses[:-1] == pytest.approx(STEEPEST_GROWTH)


@pytest.mark.parametrize("density", [1, 2, 4])
def test_no_element_is_folded_wherever_the_arc_ends(density: int) -> None:
    _, spacing = _placed()
    guide = uniform_layout(Seal())
    for first, last in np.random.default_rng(7).uniform([5.0, 5.0], [74.0, 74.0], (40, 2)):
        layout = guide.between(guide, _on_circle(guide, -first, last)).graded(spacing, 54, 1e-3)
        assert corner_jacobians(layout.mesh(density)).min() > 0.05, (first, last)


def _on_circle(guide: Layout, first: float, last: float) -> tuple[float, float]:
    """Ends of an arc (mm) on the guide's, from angles in degrees."""
    a, b = (float(radians(angle) * _RADIUS - guide.film[0]) for angle in (first, last))
    return a, b


def _placed() -> tuple[Layout, Spacing]:
    """A section whose arc goes from -35 to 35 degrees."""
    guide = uniform_layout(Seal())
    spacing = graded(1.0, [Spot(0.2), Spot(0.8)], 66, coarsest=0.1, rate=0.3)
    return guide.between(guide, _on_circle(guide, -35.0, 35.0)), spacing


def _depth(layout: Layout, ring: int) -> float:
    """How far a ring of nodes is below the arc's middle at density 2, mm."""
    disc, mesh = layout.shape.outline.disc, layout.mesh(2)
    assert disc is not None
    node = ring * 2 * (2 * layout.long + 2 * SHORT) + layout.long
    return float(_RADIUS - np.linalg.norm(mesh.points[node] - disc[0]))


# --- Contact states that runs share: found again, verified, prolonged, and never trusted ----------


Damage = Callable[[Path, np.random.Generator], None]
"""Stages of the path of the pressure: roughly on the way, then at its end."""

OTHER = {
    "upwinding": 0.3,
    "error_estimate": False,
    "pressure_order": 3,
    "reynolds": "dg",
    "quadrature": "lobatto",
    "quadrature_points": 7,
    "stroke": "in",
    "speeds": (400.0,),
    "pressure_viscosity": 0.0,
    "shear_traction": False,
    "rotation": "free",
    "solver": "monolithic",
    "linear": "superlu",
    "viscosity": 1e-7,
    "cavitation_penalty": 2e4,
}
"""Another value of every parameter that the contact stage does not know."""

ROUGH: dict[str, Any] = {
    **{"cavitation": "mass-conserving", "cavitation_pressure": -0.05, "roughness": (0.1, 0.3)},
    **{"asperity_stiffness": 5.0, "boundary_friction": 0.2},
}
"""The same for a film that the ones above do not go together with."""

THINNING: dict[str, Any] = {
    **{"shear_thinning": "carreau", "carreau_stress": 0.01, "carreau_exponent": 0.7},
    "carreau_plateau": 0.2,
}
"""The same for an oil that thins."""

OTHER_WORDS = {
    *("eyring_stress", "carreau_rate"),
    *("bore", "groove_diameter"),
    *("ring", "rod", "squeeze", "groove_depth", "fill", "gland", "backup", "said", "compound"),
    *("sensitivity", "tolerances", "travel", "service"),
    *("shore_A", "fit", "ogden_terms", "oil", "temperature", "oil_density", "roelands"),
    *("modulus_rule", "modulus_table", "glass_transition", "swelling", "compression_set"),
    *("heating", "viscosity_slope"),
}
"""Other words for the diameters and the width, for rubber and oil, which are what matters."""

YEOH = {"material": "yeoh", "c_10": 1.83, "c_20": 0.0, "c_30": 0.0, "solid": "taylor_mean"}
OGDEN = {"material": "ogden", "ogden_mu": (3.66,), "ogden_alpha": (2.0,), "solid": "taylor_mean"}
RUBBERS: dict[str, list[dict[str, Any]]] = {
    "material": [{"material": "neo-hooke", "mu": 3.04}],
    "mu": [{"material": "neo-hooke", "mu": mu} for mu in (3.0, 3.1)],
    **{k: [{**YEOH, k: value} for value in (1.9, 2.0)] for k in ("c_10", "c_20", "c_30")},
    "ogden_mu": [{**OGDEN, "ogden_mu": (mu,)} for mu in (3.0, 3.1)],
    "ogden_alpha": [{**OGDEN, "ogden_alpha": (alpha,)} for alpha in (2.1, 2.2)],
    "lambda_m": [
        {"material": "arruda-boyce", "mu": 3.0, "lambda_m": value, "solid": "taylor_mean"}
        for value in (4.0, 5.0)
    ],
    "J_m": [
        {"material": "gent", "mu": 3.0, "J_m": value, "solid": "taylor_mean"}
        for value in (40.0, 50.0)
    ],
}
"""For every key of a rubber beside the paper's, cases that differ from each other by it."""

CHANGED = {
    "mesh": "graded",
    "density": 2,
    "solid": "fbar",
    "housing_friction": 0.1,
    "extrusion_gap": 0.05,
    "corner_fillet": 0.2,
    "sealed_pressure": 0.25,
    "inner_diameter": 50.4,
    "section_diameter": 3.54,
    "rod_diameter": 50.01,
    "housing_diameter": 56.29,
    "mu_1": 3.0,
    "mu_2": 0.6,
    "bulk_modulus": 400.0,
    "groove_width": 3.75,
    "groove_centre": 0.01,
    "arc_start": -33.0,
    "arc_end": 42.0,
}


def case(**changes: Any) -> Seal:
    given = {"density": 1, "sealed_pressure": 0.5, "stroke": "out", "speeds": (1600.0,)}
    scheme = {"mesh": "uniform", "upwinding": 0.0, "arc_start": -34.0, "arc_end": 43.0}
    return Seal(**{**scheme, **given, **changes})


def cost(outcome: Outcome[FilmState]) -> int:
    """Factorisations of the contact."""
    return sum(s.factorisations or 0 for s in outcome.stages if s.where["stroke"] == "both")


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome[FilmState]]:
    """A folder with the one contact state of `case()`, and the run that left it."""
    folder = tmp_path_factory.mktemp("solved")
    return folder, run(case(), Silent(), contacts=folder)


@pytest.fixture
def contacts(solved: tuple[Path, Outcome[FilmState]], tmp_path: Path) -> Path:
    """A copy of that folder."""
    return shutil.copytree(solved[0], tmp_path / "contacts")


@cache
def plain(**changes: Any) -> Outcome[FilmState]:
    return run(case(**changes), Silent())


def test_every_parameter_either_matters_or_does_not() -> None:
    assert {*OTHER, *ROUGH, *THINNING} | OTHER_WORDS | {"tolerance"} == set(WITHOUT_INFLUENCE)
    assert contact_key(case(rod=50.5)) == contact_key(case(rod_diameter=50.5))
    assert contact_key(case(rod=50.5)) != contact_key(case())
    sections = {name: section for section in SECTIONS for name in dimensions(section)}
    known = {*CHANGED, *RUBBERS, *sections, "section", "outline", "cap_thickness", "materials"}
    assert known == set(Seal.model_fields) - set(WITHOUT_INFLUENCE)
    key = contact_key(case())
    assert {contact_key(case(**other)) for other in (OTHER, ROUGH, THINNING)} == {key}
    assert (
        contact_key(case(eyring_stress=0.01))
        == contact_key(case(carreau_rate=1e5, carreau_exponent=0.7))
        == key
    )
    graded = case(mesh="graded"), case(mesh="graded", tolerance=0.7)
    assert contact_key(graded[0]) == contact_key(graded[1])
    keys = {contact_key(case(**{name: value})) for name, value in CHANGED.items()}
    free = {"arc_start": None, "arc_end": None, "groove_width": 8.0}
    shapes = [contact_key(case(section=section, **free)) for section in SECTIONS]
    for name, section in sections.items():
        given = getattr(SECTIONS[section](), dimensions(section)[name])
        sized = {name: (1.01 if name == "nose_radius" else 0.99) * given}
        shapes.append(contact_key(case(section=section, **free, **sized)))
    capped = {"section": "rectangular", "cap_thickness": 0.8, **free}
    shapes += [
        contact_key(case(**capped)),
        contact_key(case(**capped, materials={"cap": {"mu": 10.0}})),
    ]
    assert len(set(shapes)) == len(shapes)
    rubbers = [contact_key(case(**given)) for cases in RUBBERS.values() for given in cases]
    assert len({key, *keys, *rubbers}) == 1 + len(CHANGED) + len(rubbers)


def test_a_second_curve_has_no_contact_path(
    solved: tuple[Path, Outcome[FilmState]], contacts: Path
) -> None:
    first = solved[1]
    assert cost(first) > 20
    second = run(case(stroke="both"), Silent(), contacts=contacts)
    assert second.converged, second.message
    assert cost(second) == 0
    assert second.stages[0].residual_histories[-1][-1] < 1e-8  # it was looked at
    assert second.states[0].h_star_um == pytest.approx(plain().states[0].h_star_um, rel=1e-10)
    assert first.states[0].h_star_um == plain().states[0].h_star_um


def test_a_state_holds_whatever_the_film_is(contacts: Path) -> None:
    def residual(of: Seal) -> float:
        system = build_system(of)
        problem = contact_problem(system, 0.5)
        return problem.norm(problem.residual(ContactStore(contacts).read(system)))

    assert max(residual(case()), residual(case(**OTHER))) < 1e-8
    (path,) = contacts.iterdir()
    path.rename(contacts / f"{contact_key(case(mu_2=0.62001))}.npz")
    assert residual(case(mu_2=0.62001)) > 1e-6


def test_a_coarser_state_is_prolonged(contacts: Path) -> None:
    fine = run(case(density=2), Silent(), contacts=contacts)
    assert 0 < cost(fine) <= 6
    expected = plain(density=2).states[0].h_star_um
    assert fine.states[0].h_star_um == pytest.approx(expected, rel=1e-10)
    assert ContactStore(contacts).densities(case(), (1, 2, 4)) == [2, 1]


def test_the_reference_takes_no_part(contacts: Path) -> None:
    reference = run(case(solver="monolithic"), Silent(), contacts=contacts)
    assert cost(reference) > 10


def cut(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(path.read_bytes()[:2000])


def overwrite(path: Path, rng: np.random.Generator) -> None:
    content = bytearray(path.read_bytes())
    content[500:600] = rng.bytes(100)
    path.write_bytes(bytes(content))


def empty(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(b"")


def shorten(path: Path, rng: np.random.Generator) -> None:
    parts = read_arrays(path)
    assert parts is not None
    write_arrays(path, parts | {"displacement": parts["displacement"][:-2]})


def falsify(path: Path, rng: np.random.Generator) -> None:
    parts = read_arrays(path)
    assert parts is not None
    write_arrays(path, {name: rng.normal(size=part.shape) for name, part in parts.items()})


def spoil(path: Path, rng: np.random.Generator) -> None:
    parts = read_arrays(path)
    assert parts is not None
    parts["rod"][3] = np.inf
    write_arrays(path, parts)


@pytest.mark.parametrize("damage", [cut, overwrite, empty, shorten, spoil])
def test_damage_is_seen(damage: Damage, contacts: Path, rng: np.random.Generator) -> None:
    system, store, (path,) = build_system(case()), ContactStore(contacts), contacts.iterdir()
    assert np.isfinite(store.read(system)).all()
    damage(path, rng)
    assert not np.isfinite(store.read(system)).all()


@pytest.mark.parametrize("damage", [overwrite, falsify])
def test_a_damaged_state_costs_little_and_is_replaced(
    damage: Damage, contacts: Path, rng: np.random.Generator
) -> None:
    (path,) = contacts.iterdir()
    before = path.read_bytes()
    damage(path, rng)
    outcome = run(case(), Silent(), contacts=contacts)
    assert cost(plain()) <= cost(outcome) <= cost(plain()) + 10
    assert outcome.states[0].h_star_um == plain().states[0].h_star_um
    assert path.read_bytes() == before


def test_a_stale_state_is_corrected(contacts: Path) -> None:
    changed = build_system(case(mu_2=0.63))
    (path,) = contacts.iterdir()
    path.rename(contacts / f"{contact_key(changed.parameters)}.npz")
    stage = stored_contact(changed)
    driver = PathDriver(Silent())
    driver.follow(stage, ContactStore(contacts).read(changed))
    (record,) = driver.records
    assert 0 < (record.factorisations or 0) <= 5
    assert record.residual_histories[-1][-1] < 1e-8


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    system = build_system(case())
    store = ContactStore(tmp_path / "file")
    store.keep(system, system.at_rest())
    assert store.densities(case(), (1, 2)) == []


def test_several_writers_never_show_half_a_state(tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    write_arrays(path, {"x": np.zeros(1000)})

    def write(value: float) -> None:
        for _ in range(100):
            write_arrays(path, {"x": np.full(1000, value)})

    writers = [threading.Thread(target=write, args=(float(n),)) for n in range(3)]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        parts = read_arrays(path)
        assert parts is not None
        assert np.ptp(parts["x"]) == 0.0
    assert list(tmp_path.iterdir()) == [path]


# --- A path of several legs -----------------------------------------------------------------------


def test_legs_end_at_the_sealed_pressure() -> None:
    p, mu = Seal(), Seal().shear_modulus
    assert legs_of(p) == [1.0]
    for ratio, count in ((2.0, 1), (2.2, 2), (3.8, 5), (7.9, 13)):
        legs = legs_of(p.model_copy(update={"sealed_pressure": ratio * mu}))
        assert len(legs) == count
        assert legs[-1] == ratio * mu
        assert legs[0] <= (FIRST_LEG + 1e-9) * mu
        assert np.diff(legs) == pytest.approx(LEG * mu)
    rubbing = p.model_copy(update={"sealed_pressure": 6.0 * mu, "housing_friction": 0.1})
    assert legs_of(rubbing) == [6.0 * mu]


def test_a_path_of_legs_leads_to_the_contact_of_one_path() -> None:
    p = Seal(density=1, sealed_pressure=2.3 * Seal().shear_modulus)
    solver = ContactSolver(PathDriver(Silent()))
    system, x = ContactMeshes(solver).contact(p)
    assert len(legs_of(p)) == 2
    kept = [state.pressure for state in solver.checkpoints]
    assert kept[-1] == pytest.approx(legs_of(p)[0])
    path = ContactSolver(PathDriver(Silent())).from_rest(system)
    np.testing.assert_allclose(x, path, rtol=0.0, atol=1e-6)
