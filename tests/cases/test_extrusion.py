"""An open gap on the air side: the edge of the wall, the mesh at it, and how far contact goes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver, State
from softehl.cases.seal.solve.contact_stages import load_stage
from softehl.cases.seal.solve.failure_messages import explained
from softehl.cases.seal.solve.load_stages import PathDriver, StageError
from softehl.cases.seal.states.contacts import contact_numbers
from softehl.cases.seal.states.state import Silent
from softehl.runtime.solve.solution import Branch, Status


def found(**changes: Any) -> State:
    driver = PathDriver(Silent())
    p = Seal(**{"density": 1, "extrusion_gap": 0.1, **changes})
    return ContactMeshes(ContactSolver(driver)).contact(p)


def distance(places: np.ndarray, p: Seal) -> np.ndarray:
    """Distance of places (n, 2) from the wall and its rounded edge."""
    corner = np.array([0.5 * p.groove_width, 0.5 * p.rod_diameter + p.extrusion_gap])
    a = corner + p.corner_fillet - places
    outside = np.hypot(*np.maximum(a, 0.0).T) + np.minimum(a.max(axis=1), 0.0)
    return np.asarray(outside - p.corner_fillet)


def test_a_loaded_section_rests_on_the_wall_and_is_in_balance() -> None:
    system, x = found(sealed_pressure=4.0)
    p = system.parameters
    gap = distance(system.deformed(x)[system.mesh.boundary], p)
    touching = system.pressing("air_wall", x) > 0.0
    assert gap.min() > -1e-9
    assert abs(gap[touching]).max() < 1e-9
    assert touching.sum() > 3
    numbers = contact_numbers(system, x)
    assert abs(numbers["axial_sum_N"]) < 1e-10 * numbers["sealed_pressure_N"]


def sizes(system: SealSystem) -> np.ndarray:
    """Lengths of the segments of the boundary, from the sealed end of the arc."""
    boundary = system.mesh.points[system.mesh.boundary]
    return np.asarray(np.linalg.norm(np.diff(boundary, axis=0), axis=1))


def test_the_mesh_is_fine_where_the_section_meets_the_edge() -> None:
    """A quarter of the fillet: over the whole of the guide's edge, at the air end of the film."""
    p = Seal(density=2, extrusion_gap=0.1)
    guide = build_system(p.model_copy(update={"mesh": "uniform"}))
    centre = np.array([0.0, 0.5 * (p.inner_diameter + p.section_diameter)])
    z, r = (guide.mesh.points[guide.mesh.arc_nodes] - centre).T
    angle = np.degrees(np.arctan2(z, -r))
    edge = (angle[:-1] > 27.0) & (angle[1:] < 69.0)
    assert sizes(guide)[: guide.mesh.arc][edge].max() < 0.3 * p.corner_fillet
    system, _ = found(sealed_pressure=2.0)
    assert sizes(system)[system.mesh.arc] < 2 * 0.3 * p.corner_fillet  # density 1
    assert sizes(build_system(Seal(density=2))).min() > 0.3 * p.corner_fillet


def test_a_run_that_ends_in_the_gap_says_so() -> None:
    p = Seal(density=1, extrusion_gap=0.05, corner_fillet=0.2, sealed_pressure=9.0)
    stage = load_stage(build_system(p))
    failed = StageError(stage, Branch((), Status.STEP_TOO_SMALL, ""))
    text = explained(failed, p)[1]
    for word in ("9 MPa", "gap of 0.05 mm", "fillet 0.2 mm", "backup = true"):
        assert word in text


def test_a_closed_gap_is_the_wall_down_to_the_rod() -> None:
    closed, open_ = build_system(Seal(density=1)), build_system(Seal(extrusion_gap=0.1))
    kernels = [s.problem.assembler.block("air_wall").kernel.name for s in (closed, open_)]
    assert kernels == ["contact", "contact_corner"]
    assert Seal(backup=True) == Seal(backup=True, extrusion_gap=0.0)


@pytest.mark.slow
def test_contact_of_a_soft_ring_reaches_ten_megapascals_over_a_gap() -> None:
    system, x = found(density=2, sealed_pressure=10.0)
    assert system.deformed(x)[:, 0].max() > 0.5 * system.parameters.groove_width + 0.005
