"""What the shear stress of an instroke moves: the edge of contact, the mesh for it, its films."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.scales import film_flux
from softehl.cases.seal.solve import grading
from softehl.cases.seal.solve.contact import contact_problem, lies_in_corner
from softehl.cases.seal.solve.contact_route import ContactRoute
from softehl.cases.seal.solve.drag import dragged, pushed
from softehl.cases.seal.solve.film import film_on, start_speed
from softehl.cases.seal.solve.grading import (
    COVERED,
    FINEST,
    MULTIPLE,
    PASSED,
    REACH,
    SWEPT,
    film_thickness,
    inlet_length,
    placed_layout,
    sweeps,
)
from softehl.cases.seal.solve.path import PathDriver, PathSettings, StageFailed
from softehl.cases.seal.solve.pressure_newton import roughly
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton
from tests.cases.gland_matrix import drawn

SETTINGS = PathSettings()


@cache
def contact(pressure: float | None = None) -> tuple[SealSystem, Array]:
    """Gland 224 of the sample (3.1 shear moduli) on a coarse mesh, or under another pressure."""
    p = drawn(224).model_copy(update={"density": 1})
    if pressure is not None:
        p = p.model_copy(update={"sealed_pressure": pressure})
    found = ContactRoute(SETTINGS, PathDriver(Silent()).follow).contact(p)
    assert not isinstance(found, StageFailed)
    return found


def moved(system: SealSystem, x: Array) -> float:
    return dragged(system, SETTINGS, SETTINGS.offset, x, Newton().linear)


def pulled(system: SealSystem, x: Array, share: float, stroke: Stroke = "in") -> Array:
    """The contact state under a share of the shear stress of a film, solved in full: of the slowest
    one of the instroke, of the first one of the outstroke.
    """
    p, slow = system.parameters, stroke == "in"
    edge = contact_edges(system, x)[-1 if slow else 0]
    speed = min(p.speeds) if slow else start_speed(system, SETTINGS)
    thin = MULTIPLE * film_thickness(p, [edge], speed)
    film = replace(film_on(system, stroke, x, speed * SETTINGS.offset / thin), shear=share)
    problem = contact_problem(system, SETTINGS, p.sealed_pressure)
    solution = Newton().solve(system.sheared(problem, film), x)
    assert solution.converged
    return solution.x


def test_the_edge_moves_as_one_linear_solution_says() -> None:
    system, x = contact()
    share = 0.02  # within one segment: between two of them the edge is not smooth
    way = contact_edges(system, pulled(system, x, share))[-1].place
    way -= contact_edges(system, x)[-1].place
    assert moved(system, x) > 0.0
    assert way / share == pytest.approx(moved(system, x), rel=0.1)
    # another share is told from it
    assert way / (2.0 * share) != pytest.approx(moved(system, x), rel=0.1)


def test_it_moves_by_as_many_inlets_at_every_speed() -> None:
    system, x = contact()
    p = system.parameters
    faster = replace(system, parameters=p.model_copy(update={"speeds": (1000.0,)}))
    rises = contact_edges(system, x)[-1].rise
    lengths = [inlet_length(s.parameters, rises) for s in (system, faster)]
    assert moved(faster, x) / lengths[1] == pytest.approx(moved(system, x) / lengths[0], rel=1e-6)


def test_it_hardly_moves_where_no_pressure_holds_the_section_in_the_corner() -> None:
    inlets = {}
    for pressure in (1.0, None):
        system, x = contact(pressure)
        length = inlet_length(system.parameters, contact_edges(system, x)[-1].rise)
        inlets[pressure] = moved(system, x) / length
        assert lies_in_corner(system) is (pressure is None)
        for ratio in (0.9, 1.1):
            assert sweeps(system, x, ratio * SWEPT * length) is (ratio > 1.0)
    assert inlets[1.0] < 0.5 * SWEPT
    assert inlets[None] > 0.9 * SWEPT


def test_what_it_sweeps_is_as_fine_as_the_inlets_there() -> None:
    system, x = contact()
    p = system.parameters.model_copy(update={"density": 2})
    edge, way = contact_edges(system, x)[-1], 3.0 * moved(system, x)
    inlet = inlet_length(p, edge.rise)
    found = {}
    for name, drag in (("with", way), ("without", 0.0)):
        layout = placed_layout(system, x, p, dragged=drag)
        first, _ = layout.bounds(system.section.layout)
        s = layout.mesh(2).arc_places
        beyond = 0.5 * (s[1:] + s[:-1]) - (edge.place - first) - way
        # the film of 100 mm/s has its edge 10^0.4 times as far, and its inlet is as much longer
        faster = np.argmin(np.abs(beyond - (10.0**0.4 - 1.0) * way))
        found[name] = np.diff(s)[faster] / (10.0**0.4 * inlet)
    assert found["with"] < 1.2 * COVERED
    assert found["without"] > 2.0 * found["with"]
    assert FINEST < COVERED < SWEPT


def test_where_its_exit_dip_passes_segments_grow_slowly() -> None:
    system, x = contact()
    p = system.parameters.model_copy(update={"density": 2})
    edge, way = contact_edges(system, x)[0], 3.0 * moved(system, x)
    growth = {}
    for name, drag in (("with", way), ("without", 0.0)):
        layout = placed_layout(system, x, p, dragged=drag)
        first, _ = layout.bounds(system.section.layout)
        s = layout.mesh(2).arc_places
        outside = (s >= edge.place - first - 0.1) & (s <= edge.place - first - 0.02)  # mm
        sizes, outer = np.diff(s[outside]), s[outside]
        growth[name] = (sizes[0] - sizes[-1]) / (outer[-1] - outer[0])
    assert edge.sealed
    assert growth["with"] == pytest.approx(PASSED * growth["without"], rel=0.1)


def test_a_state_on_the_way_is_right_to_a_per_cent_of_a_thin_film_too() -> None:
    newton = Newton()
    for h in (1e-4, 1e-5, 2e-6):  # mm
        flux, speed = 0.5 * 10.0 * h, 10.0
        allowed = [
            film_flux(speed) * found.tolerance for found in (roughly(newton, h), roughly(newton))
        ]
        assert allowed[0] == pytest.approx(0.01 * flux)
        assert allowed[1] > 0.09 * flux
    assert roughly(newton, 0.005) == roughly(newton, 0.0) == roughly(newton)
    assert roughly(newton, 1e-12).tolerance == newton.tolerance


def test_the_outstroke_pushes_as_one_linear_solution_says() -> None:
    system, x = contact()
    share, arc = 0.02, system.mesh.arc_nodes
    full = pulled(system, x, share, "out")
    way = float((system.deformed(full) - system.deformed(x))[arc, 0].max())
    found = pushed(system, SETTINGS, x, Newton().linear)
    assert found > 0.001
    assert way / share == pytest.approx(found, rel=0.05)
    assert way / (2.0 * share) != pytest.approx(found, rel=0.05)


@pytest.mark.parametrize(
    ("closed", "upward", "found"), [(0.1, True, 0.1), (0.03, True, REACH), (0.03, False, 0.03)]
)
def test_an_arc_that_ends_narrow_at_a_wall_goes_up_the_wall(
    closed: float, upward: bool, found: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, x = contact()
    (_, h), s, mesh = system.arc_film(x), system.section.places, system.mesh
    end = float(np.interp(closed, h[-4:], s[-4:]))
    monkeypatch.setattr(grading, "_way_out", lambda *at: end if at[3] == 1 else 0.0)
    layout = placed_layout(system, x, system.parameters, upward=upward)
    outline = system.deformed(x)[mesh.boundary, 1] - system.rod_radius
    places = np.append(s, s[-1] + mesh.places[mesh.arc + 1 :] - mesh.places[mesh.arc])
    last = layout.bounds(system.section.layout)[1]
    assert np.interp(last, places, outline) == pytest.approx(found, rel=1e-6)


def test_no_segment_of_the_arc_lies_on_a_wall() -> None:
    system, x = contact()
    z, _ = system.arc_film(x)
    assert np.diff(z).min() > 0.0
