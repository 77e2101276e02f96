"""The coupled system: declared once, counts of Table 2, loads, tangent of the whole."""

from fractions import Fraction

import numpy as np
import pytest

from softehl.cases.seal.equations.definition import PRESSURE, ROD, Block, blocks_of
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.scales import film_flux
from softehl.cases.seal.equations.system import SealSystem, build_system, seal_study
from softehl.cases.seal.section.section import seal_section
from tests.cases.oring_cases import oring

TABLE_2 = {1: (1076, 109), 2: (3587, 217), 4: (12929, 433), 8: (48893, 865), 16: (189941, 1729)}


@pytest.mark.parametrize("d", TABLE_2)
def test_unknowns_of_table_2(d: int) -> None:
    p = oring(density=1, mesh="uniform", arc_start=-34.0, arc_end=43.0)
    layout = SealSystem.of(p, seal_section(p, density=Fraction(d))).layout
    total, pressures = TABLE_2[d]
    assert layout.count(PRESSURE) == pressures == 108 * d + 1
    assert layout.total == pytest.approx(total, rel=0.03)


@pytest.mark.parametrize("m_p", range(1, 6))
def test_discontinuous_pressures_have_all_their_unknowns(m_p: int) -> None:
    system = build_system(oring(density=1, pressure_order=m_p, reynolds="dg"))
    assert system.pressure_count == 27 * (m_p + 1)
    first = system.layout.part("pressure").start
    assert system.film_ends.tolist() == [first, first + 27 * (m_p + 1) - 1]
    film, facet = (system.problem.assembler.block(name) for name in ("film", "facet"))
    assert np.unique(film.dofs[:, 4:]).size == 27 * (m_p + 1)
    assert facet.dofs.shape == (26, 6 + 2 * (m_p + 1))
    # a facet sees the displacements and pressures of the segments on its two sides
    assert np.array_equal(facet.dofs[:, :4], film.dofs[:-1, :4])
    assert np.array_equal(facet.dofs[:, 2:6], film.dofs[1:, :4])
    assert np.array_equal(facet.dofs[:, 6:], np.hstack([film.dofs[:-1, 4:], film.dofs[1:, 4:]]))


def test_sealed_pressure_acts_from_the_sealed_end_of_the_arc_to_the_crown() -> None:
    system = build_system(oring(density=4))
    block = system.problem.assembler.block("sealed_side")
    z = block.coordinates[:, [0, 2]].mean(axis=1)
    assert z.max() < 0.0
    r = block.coordinates[:, [1, 3]]
    assert r.max() == pytest.approx(28.725, abs=2e-3)  # the crown
    sealed_end = system.mesh.points[system.mesh.arc_nodes[0]]
    assert block.coordinates[-1, 2:] == pytest.approx(sealed_end)
    arc = system.problem.assembler.block("sealed_arc")
    assert arc.coordinates[0, :2] == pytest.approx(sealed_end)
    assert arc.coordinates[-1, 3] == system.mesh.points[system.mesh.arc_nodes, 1].min()


def test_axial_force_of_the_sealed_pressure_is_pressure_times_projected_area() -> None:
    system = build_system(oring(density=2))
    x = system.at_rest()
    force = 0.0
    for name in ("sealed_side", "sealed_arc"):
        block = system.problem.assembler.block(name)
        force -= block.residual(x, np.array([2.0]))[:, [0, 2]].sum()
    top, bottom = system.mesh.points[:, 1].max(), system.mesh.points[:, 1].min()
    assert force == pytest.approx(2.0 * np.pi * (top**2 - bottom**2), rel=2e-3)


def test_what_holds_the_rotation_is_a_pure_couple() -> None:
    """About the centroid of the mesh, which is not that of the circle where its nodes are not even.

    About the circle's own centre it would push the section along the rod.
    """
    system = build_system(oring(density=2))
    area, centroid, polar_moment = system.section.moments
    p = system.parameters
    radius = 0.5 * p.section_diameter
    assert area == pytest.approx(np.pi * radius**2, rel=3e-3)
    assert polar_moment == pytest.approx(0.5 * np.pi * radius**4, rel=6e-3)
    x = system.at_rest()
    x[system.layout.part("rotation")] = 1.0
    block = system.problem.assembler.block("rotation")

    def push(centre: np.ndarray) -> float:
        moments = block.residual(x, np.array([*centre, polar_moment, 0.0]))
        return abs(float(moments[:, [0, 2, 4, 6]].sum()))

    assert push(centroid) < 1e-12
    assert push(np.array([0.0, 0.5 * p.inner_diameter + radius])) > 1e-6


def test_obstacles_touch_the_free_section_where_they_should() -> None:
    system = build_system(oring(density=2))
    points = system.mesh.points
    gaps = {name: obstacle.gap(points).min() for name, obstacle in system.obstacles.items()}
    assert gaps["rod"] == pytest.approx(0.195, abs=1e-3)
    assert gaps["housing"] == pytest.approx(28.15 - 28.725, abs=1e-3)
    assert gaps["sealed_wall"] == pytest.approx(1.87 - 1.765, abs=5e-3)
    assert gaps["air_wall"] == pytest.approx(1.87 - 1.765, abs=5e-3)


@pytest.mark.parametrize("solid", ["taylor", "fbar", "q4"])
@pytest.mark.parametrize("stroke", ["out", "in"])
def test_tangent_of_the_whole_problem(solid: str, stroke: str, rng: np.random.Generator) -> None:
    system = build_system(oring(density=1, solid=solid))
    layout = system.layout
    film = FilmLoads(1.0, stroke, 400.0, np.zeros(28))  # type: ignore[arg-type]
    problem = system.film_problem(film)
    x = 1e-3 * rng.normal(size=layout.total)
    system.pressures(x)[:] = rng.uniform(0.5, 3.0, system.pressure_count)
    x[problem.fixed] = problem.values
    direction = rng.normal(size=layout.total)
    direction[problem.fixed] = 0.0
    direction[layout.part("displacement")] *= 1e-3
    step = 1e-4
    difference = problem.residual(x + step * direction) - problem.residual(x - step * direction)
    r, K = problem.linearise(x)
    exact = np.asarray(K @ direction)
    for name in ("displacement", "pressure", "rotation", "housing"):
        part = layout.part(name)
        error = difference[part] / (2 * step) - exact[part]
        assert np.linalg.norm(error) < 1e-5 * np.linalg.norm(exact[part]) + 1e-12
    assert r == pytest.approx(problem.residual(x), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("moment", [None, 0.0, 2.5])
def test_the_film_acts_on_a_held_section_or_on_one_with_a_given_moment(
    moment: float | None,
) -> None:
    system = build_system(oring(density=1))
    film = FilmLoads(1.0, "out", 400.0, np.zeros(28), moment=moment)
    problem = system.film_problem(film)
    prescribed = dict(zip(problem.fixed.tolist(), problem.values.tolist(), strict=True))
    assert prescribed.get(int(system.layout.dofs("rotation")[0])) == moment


def test_fluxes_are_measured_by_what_rounding_leaves_of_them() -> None:
    system = build_system(oring(density=1))
    gap = np.full(28, 1e-3)
    thin = system.flux_scales(25.0, gap)
    assert thin == pytest.approx(np.full(109, film_flux(25.0)), rel=1e-3)
    gap[0] = 0.1  # the film of the first segment, four of whose pressures are its own
    scales = system.flux_scales(25.0, gap)
    assert scales[5:] == pytest.approx(thin[5:])
    dx = np.linalg.norm(np.diff(system.mesh.points[system.mesh.arc_nodes[:2]], axis=0))
    flux = 1e-4 * 4**2 * 0.1**3 / (12.0 * system.parameters.viscosity * dx)
    assert scales[:5] == pytest.approx(np.full(5, film_flux(25.0) + flux))


def test_a_pressure_is_rounded_to_far_less_than_the_tolerance() -> None:
    """A last digit of 5 MPa drives through a film of 0.1 mm less than 1e-9 of its scale."""
    system = build_system(oring(density=8))
    scale = system.flux_scales(25.0, np.full(217, 0.1)).max()
    dx = 2.37 / 216 / 4  # of the four intervals of a segment, mm
    rounding = 0.1**3 / (12.0 * system.parameters.viscosity) * np.spacing(5.0) / dx
    assert rounding < 1e-9 * scale
    assert rounding > 1e-9 * film_flux(25.0)


# --- declared once --------------------------------------------------------------------------------


def test_a_kernel_that_asks_for_what_nobody_gives_is_named() -> None:
    stranger = Block("stranger", "contact", "arc_nodes", (ROD,), "film")
    p = oring(density=1)
    with pytest.raises(
        KeyError, match=r"'stranger' asks for offset; cases/seal/equations/definition.py gives"
    ):
        seal_study(p, seal_section(p), (*blocks_of(p), stranger))
