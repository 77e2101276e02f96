"""What ParaView is given: stresses, stretches and pressures against closed forms, the gland."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from softehl.cases.harness.file_content import write_content
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report.paraview import PARTS, gland_outlines, write_paraview
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.section_view import principal_stretches, section_view
from softehl.cases.seal.states.state import Silent
from softehl.runtime.analyses.callbacks import read_series
from softehl.runtime.arrays import Array, Integers
from tests.cases.oring_cases import oring

DOCS = Path(__file__).parents[2] / "docs"
X_RING: dict[str, Any] = {
    **{"section": "x_ring", "lobe_radius": 0.9, "fillet_radius": 0.6},
    **{"housing_diameter": 56.4, "groove_width": 4.3},
}


def cells_of(path: Path) -> tuple[Array, Integers, dict[str, Array], dict[str, Array]]:
    """Points (n, 2), cells, point data and cell data of a section, by meshio."""
    mesh = meshio.read(path)
    data = {name: values[0] for name, values in mesh.cell_data.items()}
    return mesh.points[:, :2], mesh.cells_dict["quad"], dict(mesh.point_data), data


def pulled(axial: float, radial: float) -> tuple[SealSystem, Array]:
    """A section whose every place is stretched alike."""
    system = build_system(oring(density=1, solid="fbar"))
    x = system.at_rest()
    system.displacements(x)[:] = system.mesh.points * [axial - 1.0, radial - 1.0]
    return system, x


@pytest.mark.parametrize(("axial", "radial"), [(1.2, 0.93), (0.8, 1.1)])
def test_a_section_that_is_stretched_alike_everywhere(
    axial: float, radial: float, tmp_path: Path
) -> None:
    """Von Mises stress of a Mooney-Rivlin rubber in closed form; stretches as they were given."""
    system, x = pulled(axial, radial)
    mu_1, mu_2 = (system.parameters.rubber_values[name] for name in ("mu_1", "mu_2"))
    view = section_view(system, x, np.zeros(system.mesh.arc + 1))
    write_content(tmp_path / "s.vtu", view)
    *_, data = cells_of(tmp_path / "s.vtu")
    volume = axial * radial**2
    a, b = axial / volume ** (1 / 3), radial / volume ** (1 / 3)
    stress = abs(mu_1 * (a**2 - b**2) + mu_2 * (b**-2 - a**-2)) / volume
    np.testing.assert_allclose(data["von_mises"], stress, rtol=1e-9)
    np.testing.assert_allclose(data["stretch_1"], max(axial, radial), rtol=1e-12)
    np.testing.assert_allclose(data["stretch_2"], min(axial, radial), rtol=1e-12)
    np.testing.assert_allclose(data["stretch_hoop"], radial, rtol=1e-12)


def stretches_of_one(before: Array, after: Array) -> Array:
    """Principal stretches (3,) in the middle of a cell of these corners (4, 2), from scratch."""
    slopes = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
    gradient = np.eye(3)
    gradient[:2, :2] = np.linalg.solve(slopes @ before, slopes @ after).T
    gradient[2, 2] = after[:, 1].sum() / before[:, 1].sum()
    return np.asarray(np.sqrt(np.linalg.eigvalsh(gradient.T @ gradient)))


def volumes(points: Array, cells: Integers) -> Array:
    """Volumes of revolution of cells, per radian, by two triangles each."""
    total = np.zeros(len(cells))
    for corners in ([0, 1, 2], [0, 2, 3]):
        a, b, c = (points[cells[:, k]] for k in corners)
        (z_1, r_1), (z_2, r_2) = (b - a).T, (c - a).T
        total += (z_1 * r_2 - r_1 * z_2) * (a + b + c)[:, 1] / 6.0
    return total


def beside(x: Array, p: Array, at: Array) -> list[Array]:
    """p (n,) known at x (n,), at places (m,): between two points and on the line of either side.

    Behind the exit of a lobe pressure has a pit at a node, which no line across the node shows.
    """
    i = np.clip(np.searchsorted(x, at), 2, len(x) - 2)
    sides = [p[j] + (at - x[j]) * (p[j + 1] - p[j]) / (x[j + 1] - x[j]) for j in (i - 2, i)]
    return [np.interp(at, x, p), *sides]


@pytest.mark.parametrize(
    "changes",
    [
        {"density": 1},
        pytest.param({"density": 2, **X_RING}, marks=pytest.mark.slow),
    ],
    ids=["round", "x_ring"],
)
def test_what_a_run_writes_of_its_sections(changes: dict[str, Any], tmp_path: Path) -> None:
    p = Seal(speeds=(400.0,), stroke="out", error_estimate=False, **changes)
    (state,) = run(p, Silent()).states
    file = state.file_names()[1]
    write_content(tmp_path / file, state.section)
    write_paraview(p, tmp_path, [state])
    assert read_series(tmp_path / "section_out.pvd") == [(400.0, file)]
    assert not (tmp_path / "section_in.pvd").exists()
    points, cells, nodal, data = cells_of(tmp_path / file)
    page = (DOCS / "keys.md").read_text(encoding="utf-8")
    assert {name for name in (*nodal, *data) if f"`{name}`" not in page} == set()
    at_rest = points - nodal["displacement"]
    found = np.stack([data[f"stretch_{name}"] for name in ("1", "2", "hoop")], axis=1)
    k = int(np.argmax(found[:, 0]))
    expected = stretches_of_one(at_rest[cells[k]], points[cells[k]])
    assert found[k, 0] > 1.1
    np.testing.assert_allclose(np.sort(found[k]), expected, rtol=1e-10)
    ratio = volumes(points, cells) / volumes(at_rest, cells)
    np.testing.assert_allclose(found.prod(axis=1), ratio, rtol=0.02)
    nodes = np.flatnonzero(nodal["rod_pressure"])
    x, film = state.profile.x_mm, state.profile.p_MPa
    away = [nodal["rod_pressure"][nodes] - near for near in beside(x, film, points[nodes, 0])]
    assert np.abs(away).min(axis=0).max() < 0.02 * film.max()
    np.testing.assert_array_less(points[nodes, 1], 0.5 * p.rod_diameter + 0.5)  # beside the rod


def test_stretches_of_the_way_back_are_others() -> None:
    """What compares stretches with one cell computed from scratch sees F^-1 in place of F."""
    system, x = pulled(1.2, 0.93)
    before, after, cells = system.mesh.points, system.deformed(x), system.mesh.quads
    wrong = principal_stretches(after, before, cells)
    found = np.sort([wrong[name][0] for name in wrong])
    expected = stretches_of_one(before[cells[0]], after[cells[0]])
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_the_gland_is_that_of_the_model(gap: float, tmp_path: Path) -> None:
    p = Seal(extrusion_gap=gap, corner_fillet=0.2)
    write_content(tmp_path / "gland.vtu", gland_outlines(p))
    mesh = meshio.read(tmp_path / "gland.vtu")
    lines, part = mesh.cells_dict["line"], mesh.cell_data["part"][0]
    rod, groove, housing = (
        mesh.points[np.unique(lines[part == k])][:, :2] for k in range(len(PARTS))
    )
    wall = p.groove_centre + 0.5 * p.groove_width
    assert set(rod[:, 1]) == {0.5 * p.rod_diameter}
    assert groove[:, 1].max() == 0.5 * p.housing_diameter
    assert groove[0, 0] == wall - p.groove_width
    assert groove[:4, 0].max() == pytest.approx(wall)
    assert groove[-1] == pytest.approx(housing[-1])
    if not gap:
        assert groove[-1] == pytest.approx([wall, 0.5 * p.rod_diameter])
        return
    assert groove[-1] == pytest.approx([wall + 0.2, 0.5 * p.rod_diameter + gap])
    centre = [wall + 0.2, 0.5 * p.rod_diameter + gap + 0.2]
    assert np.hypot(*(groove[3:] - centre).T) == pytest.approx(np.full(17, 0.2))
