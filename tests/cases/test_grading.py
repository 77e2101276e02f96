"""Graded meshes: contact edges, shape of the elements, the contact and the film on them."""

from functools import cache
from math import inf, radians

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.meshing.o_grid import MOST_LAYERS, SHORT, STEEPEST_GROWTH
from softehl.cases.seal.meshing.section_mesh import corner_jacobians
from softehl.cases.seal.meshing.spacing import Spacing, Spot, graded
from softehl.cases.seal.section.layout import Layout, uniform_layout
from softehl.cases.seal.solve.arc_meshing import contact_layout
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.arrays import Array
from tests.cases.oring_cases import oring

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
