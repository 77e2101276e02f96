"""Mesh files of other programs, and files that are written."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import MeshError

# --- Mesh files of Abaqus and CalculiX with all their sets; names in other formats, and back ------


FOLDER = Path(__file__).parent / "inp"

GROUPS: dict[str, dict[str, float]] = {
    "cae_assembly": {
        **{"Block-1": 1, "Block-2": 1, "Block-1.Set-1": 1, "Block-2.Set-1": 1},
    },
    "calculix_beam": {"Eall": 2, "LAST": 1, "E1": 1, "AGAIN": 2},
    "gmsh_plate": {"Surface1": 2.5, "body": 2.5},
    "heat_and_membranes": {"SOLID": 8, "MIXED": 8},
    "includes": {"TETS": 1 / 6, "ALL": 7 / 6},
    "plate_by_hand": {"QUADS": 2, "Body": 2.5},
    "quadratic": {"BRICK": 8, "TET": 2},
    "ring": {"SEAL": 1, "BACK UP": 1, "every": 2},
    "shells": {"SKIN": 1 + np.sqrt(2)},
    "spelling": {"left, lower": 1},
}
"""File -> group -> its volume, or its area of plane cells and shells."""
SIDES: dict[str, dict[str, tuple[float, tuple[float, ...]]]] = {
    "cae_assembly": {
        **{"Front": (2, (1.5, 0.5, 0.5)), "Free": (6, (2.5, 0.5, 0.5))},
        **{"Block-1.Upper": (1, (0.5, 0.5, 1)), "Block-2.Upper": (1, (2.5, 0.5, 1))},
        **{"Held": (5, (0.6, 0.4, 0.4)), "Set-1": (8, (0.5, 0.5, 0.5))},
        **{"Block-1.Set-1": (8, (0.5, 0.5, 0.5)), "Block-2.Set-1": (8, (2.5, 0.5, 0.5))},
    },
    "calculix_beam": {
        **{"TOP": (1, (0.5, 0.5, 2)), "SIDE": (2, (0.5, 0, 1)), "NODES": (8, (0.5, 0.5, 0))},
        **{"Nall": (32, (0.5, 0.5, 1)), "FIX": (8, (0.5, 0.5, 0))},
        **{"FIRST": (20, (0.5, 0.5, 0.5)), "BOTH": (20, (0.5, 0.5, 0.5))},
    },
    "gmsh_plate": {"Line1": (1, (0, 0.5)), "wall": (1, (0, 0.5)), "tip": (1, (3, 0.5))},
    "heat_and_membranes": {
        **{"FREE": (24, (1, 1, 1)), "SKIN": (4, (1, 1, 2)), "PLATE": (4, (1, 1, 0))},
        **{"BAR": (2, (0, 0, 1)), "MIXED": (2, (0, 0, 1))},
    },
    "includes": {
        **{"END": (1, (1 / 3, 1 / 3, 1)), "SLANTED": (np.sqrt(8), (0.5, 0.5, 1))},
        "BOTH": (1 + np.sqrt(8), (0.4, 0.4, 1)),
    },
    "plate_by_hand": {"wall": (1, (0, 0.5)), "NALL": (7, (9 / 7, 0.5)), "TIP": (1, (3, 0.5))},
    "quadratic": {
        **{"F1": (4, (0, 0, -1)), "F2": (4, (0, 0, 1)), "F3": (4, (0, -1, 0))},
        **{"F4": (4, (1, 0, 0)), "F5": (4, (0, 1, 0)), "F6": (4, (-1, 0, 0))},
        **{"T1": (2, (1, -1 / 3, -1 / 3)), "T2": (3, (2, -1 / 3, -1))},
        **{"T3": (np.sqrt(22), (2, -1 / 3, -1 / 3)), "T4": (3, (2, -1, -1 / 3))},
        "EDGE": (2, (0, -1, -1)),
    },
    "ring": {
        **{"BORE": (2, (1, 0.9)), "BASE": (1, (1.5, 0)), "Part of it": (1, (1.5, 0))},
        **{"LOW": (3, (1.5, 0)), "Inner": (4, (1, 0.875)), "FROM CELLS": (8, (1.5, 0.5))},
        "PART OF IT.nodes": (1, (1, 0)),
    },
    "shells": {
        **{"OUTER": (1 + np.sqrt(2), (1.1, 0.5, 1.3)), "INNER": (1 + np.sqrt(2), (1.1, 0.5, 1.3))},
        **{"RIM": (2, (1, 0.5, 1.5)), "PLAIN": (1, (0.5, 0.5, 1)), "RIB": (1, (0.5, 0, 1))},
        "LOWER": (2, (1 / 3, 0.5, 1)),
    },
    "spelling": {
        **{"two nodes": (3, (1 / 3, 2 / 3)), "WEIGHT": (1, (1, 1)), "all of it": (4, (0.5, 0.5))},
        **{"corner": (2, (0.5, 0.5)), "LOOP": (2, (0.5, 0.5))},
    },
}
"""File -> side -> its area or length, or number of nodes, and the mean place of the nodes of all
its faces.
"""
WARNINGS = {
    "cae_assembly": "'RP': nodes of none",
    "ring": "CAX4 are rings about y",
    "shells": "'CURVED': nodes of none",
}


def loaded(name: str) -> Mesh:
    path = FOLDER / f"{name}.inp"
    if name in WARNINGS:
        with pytest.warns(UserWarning, match=WARNINGS[name]):
            return Mesh.read(path)
    return Mesh.read(path)


@pytest.mark.parametrize("name", GROUPS)
def test_files_of_abaqus_and_calculix_have_all_their_sets(name: str) -> None:
    mesh = loaded(name)
    mesh.check()
    assert misplaced(mesh) < 1e-12
    sizes = {g: sum(volume(mesh, v, k) for k, v in mesh.cells_of(g).items()) for g in mesh.groups}
    assert sizes == pytest.approx(GROUPS[name])
    assert mesh.sides.keys() == SIDES[name].keys()
    for side, (size, centre) in SIDES[name].items():
        faces = mesh.faces(side)
        found = sum(len(v) if k == "point1" else volume(mesh, v, k) for k, v in faces.items())
        assert found == pytest.approx(size), side
        points = np.concatenate(
            [mesh.points[v].reshape(-1, mesh.dimension) for v in faces.values()]
        )
        assert points.mean(axis=0) == pytest.approx(np.array(centre), abs=1e-12), side


def test_rings_of_a_file_are_turned_as_the_warning_says() -> None:
    """A unit pressure on the base of a tube, of radii 1 and 2."""
    mesh = loaded("ring").map(lambda x: np.column_stack([-x[:, 1], x[:, 0]]))
    study = Study(mesh, geometry="axisymmetric")
    study.add("tube", material="hooke", E=1e9, nu=0.0)
    study.pressure("BASE", 1.0)
    study.fix(lambda x: x[:, 0] == -2.0, u_x=0)
    force = study.solve().reaction(lambda x: x[:, 0] == -2.0)["u_x"]
    assert force == pytest.approx(3 * np.pi)


def test_two_ways_to_write_a_plate_are_one_body() -> None:
    """A set over two kinds of elements, and in two pieces: no cell is lost."""
    forces = []
    for name, body, tip in (("gmsh_plate", "body", "tip"), ("plate_by_hand", "Body", "TIP")):
        study = Study(loaded(name))
        study.add("plate", material="hooke", cells=body, E=100.0, nu=0.3)
        study.fix("wall", u_x=0, u_y=0)
        study.fix(tip, u_y=0.1)
        forces.append(study.solve().reaction("wall")["u_y"])
    assert forces[0] == pytest.approx(forces[1], rel=1e-12)
    whole = Study(loaded("plate_by_hand"))
    whole.add("plate", material="hooke", E=100.0, nu=0.3)
    whole.fix("wall", u_x=0, u_y=0)
    whole.fix((3.0, 0.5), u_y=0.1)
    assert forces[0] == pytest.approx(whole.solve().reaction("wall")["u_y"], rel=1e-12)


def test_cells_without_elements_are_told() -> None:
    """A hole in the body; not where pages stand on nodes or sides alone."""
    mesh = Mesh.rectangle(3.0, 1.0, cells=(3, 1)).with_group("ring", lambda x: x[:, 0] < 2.0)
    study = Study(mesh.with_group("pad", lambda x: x[:, 0] > 2.0))
    study.add("ring", material="hooke", cells="ring", E=1.0, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load((1.0, 0.0), u_x=1.0)
    with pytest.warns(
        UserWarning, match="1 of 3 cells of the mesh have no elements, those of 'pad'"
    ):
        study.solve()
    study.add("pad", material="hooke", cells="pad", E=1.0, nu=0.0)
    study.solve()


NODES = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n"
QUAD = "*ELEMENT, TYPE=CPS4, ELSET=E\n1, 1, 2, 3, 4\n"
REFUSED = {
    "*NGEN, NSET=X\n1, 4\n": "line 8: *NGEN makes nodes by a rule, which is not read",
    "*ELGEN\n1, 2\n": "*ELGEN makes elements by a rule",
    "*SYSTEM\n0, 0, 0\n": "*SYSTEM makes a mesh by a rule",
    "*NODE, SYSTEM=C\n9, 1, 90\n": "SYSTEM=C is not read",
    "*ELEMENT, TYPE=C3D13\n2, 1\n": "elements C3D13 have no cell here; there are C3D8, C3D20",
    "*ELEMENT, TYPE=U1\n2, 1\n": "elements U1 have no cell here",
    "*ELEMENT, TYPE=CPS3\n2, 1, 2\n": "line 9: element 2 has 2 nodes, CPS3 has 3",
    "*ELEMENT, TYPE=CPS3\n2, 1, 2, 3, 4\n": "element 2 has 4 nodes, CPS3 has 3",
    "*ELEMENT, TYPE=CPS3\n2, 1, 2, 7\n": "element 2 has node 7, which is not in the file",
    "*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n": "element 1 is given again, as another one",
    "*ELEMENT\n1, 1, 2, 3\n": "*ELEMENT needs TYPE=",
    "*NODE\n1, 5, 5\n": "node 1 is given again, at another place",
    "*NODE\n7, five\n": "'five' is no number",
    "*NSET, NSET=X\n1, 9\n": "node 9, which is not in the file",
    "*NSET, NSET=X\nY\n": "there is no NSET 'Y'",
    "*NSET, NSET=X, INSTANCE=P\n1\n": "there is no instance 'P'",
    "*NSET, NSET=X, GENERATE\n1, 9, 0\n": "GENERATE in steps of 0",
    "*SURFACE, NAME=X\nE, S5\n": "a quad4 has no face 'S5'",
    "*SURFACE, NAME=X\nE, E1\n": "a quad4 has no face 'E1'",
    "*SURFACE, NAME=X\nNO, S1\n": "there is no ELSET 'NO'",
    "*INCLUDE, INPUT=none.inp\n": "line 8: there is no file 'none.inp' to include",
    "*INCLUDE, INPUT=part.inp\n": "part.inp includes itself",
    "*INSTANCE, NAME=A, PART=B\n": "there is no part 'B'",
}


@pytest.mark.parametrize("more", REFUSED)
def test_what_cannot_be_read_is_named(more: str, tmp_path: Path) -> None:
    path = tmp_path / "part.inp"
    path.write_text(NODES + QUAD + more)
    with pytest.raises(MeshError, match=re.escape(REFUSED[more])) as info:
        Mesh.read(path)
    assert "\n" not in str(info.value)
    path.write_text("*HEADING\nnothing\n")
    with pytest.raises(MeshError, match="there are no nodes or no elements"):
        Mesh.read(path)


def test_an_analytical_surface_is_said_to_be_left_out(tmp_path: Path) -> None:
    path = tmp_path / "part.inp"
    path.write_text(NODES + QUAD + "*SURFACE, NAME=RIGID, TYPE=SEGMENTS\nSTART, 0, 0\n")
    with pytest.warns(UserWarning, match=r"line 8: the surface 'RIGID' is left out, SEGMENTS"):
        Mesh.read(path)


def every_kind(shape: str, order: int) -> Mesh:
    if shape in ("quad", "triangle"):
        mesh = Mesh.rectangle(2.0, 1.0, cells=(2, 1), order=order, shape=shape)  # type: ignore[arg-type]
    else:
        mesh = Mesh.box((2.0, 1.0, 1.0), cells=(2, 1, 1), order=order, shape=shape)  # type: ignore[arg-type]
    mesh = mesh.with_group("low half", lambda x: x[:, 0] < 1.0)
    corners = {"point1": mesh.nodes(lambda x: x[:, 0] == 0.0)[:, None]}
    return Mesh(mesh.points, mesh.cells, mesh.groups, {**mesh.sides, "corners": corners})


def sorted_rows(rows: Any) -> list[list[int]]:
    return sorted(np.sort(rows, axis=1).tolist())


SHAPES = [("quad", 1), ("quad", 2), ("triangle", 1), ("triangle", 2), ("hex", 1), ("hex", 2)]
SHAPES += [("serendipity", 2), ("tetrahedron", 1), ("tetrahedron", 2), ("wedge", 1), ("wedge", 2)]
SHAPES += [("pyramid", 1), ("lagrange_wedge", 2)]
LACKING = {"unv": {"quad9", "hex27", "wedge18"}, "med": {"quad9", "hex27", "wedge18"}}
"""Kinds of cells that a format has not."""


@pytest.mark.parametrize(("shape", "order"), SHAPES)
@pytest.mark.parametrize("ending", ["inp", "msh", "unv", "vtu", "vtk", "med"])
def test_a_mesh_that_is_written_reads_back_with_its_names(
    shape: str, order: int, ending: str, tmp_path: Path
) -> None:
    if ending == "med":
        pytest.importorskip("h5py")
    mesh = every_kind(shape, order)
    path = tmp_path / f"part.{ending}"
    if set(mesh.cells) & LACKING.get(ending, set()):
        with pytest.raises(MeshError, match=r"(quad9|hex27|wedge18) has no type|has no cells"):
            mesh.write(path)
        return
    mesh.write(path)
    again = Mesh.read(path)
    np.testing.assert_array_equal(again.points, mesh.points)
    assert again.cells.keys() == mesh.cells.keys()
    for kind, nodes in mesh.cells.items():
        np.testing.assert_array_equal(again.cells[kind], nodes)
        np.testing.assert_array_equal(again.groups["low half"][kind], mesh.groups["low half"][kind])
    assert again.sides.keys() == mesh.sides.keys()
    for name in mesh.sides:
        faces = again.faces(name)
        assert faces.keys() == {k for k, v in mesh.faces(name).items() if len(v)}
        for kind, nodes in faces.items():
            assert sorted_rows(nodes) == sorted_rows(mesh.faces(name)[kind])


def test_shells_and_names_that_need_quotes_are_written(tmp_path: Path) -> None:
    mesh = loaded("shells")
    path = tmp_path / "part.inp"
    mesh.write(path)
    again = Mesh.read(path)
    assert again.sides.keys() == mesh.sides.keys()
    for name, side in mesh.sides.items():
        for kind, nodes in side.items():
            np.testing.assert_array_equal(again.sides[name][kind][:, :2], nodes[:, :2], name)
    mesh = Mesh.rectangle(1.0, 1.0, cells=(1, 1)).with_side("a, 1", lambda x: x[:, 0] == 0)
    mesh.write(path)
    assert "a, 1" in Mesh.read(path).sides
    assert "a, 1" in Mesh.read(path.rename(tmp_path / "all.msh")).sides  # as CalculiX's cgx says
    twice = mesh.with_side("LEFT", lambda x: x[:, 0] == 0)
    with pytest.raises(MeshError, match="'left' and 'LEFT' are one name in a file of Abaqus"):
        twice.write(path)


def test_sides_of_points_and_edges_stay_where_a_mesh_is_split_or_cut(tmp_path: Path) -> None:
    mesh = every_kind("hex", 1)
    edge = {"line2": mesh.cells["hex8"][:1, 1:3]}  # of both cells
    mesh = Mesh(mesh.points, mesh.cells, mesh.groups, {**mesh.sides, "edge": edge})
    split = mesh.split()
    split.check()
    np.testing.assert_array_equal(split.points[split.nodes("corners"), 0], [0.0] * 4)
    np.testing.assert_allclose(split.points[split.sides["edge"]["line2"]][..., 0], 1.0)
    assert split.sides["edge"]["line2"].shape == (2, 2)
    mesh.write(tmp_path / "part.npz", parts=2)
    parts = [np.load(tmp_path / f"part_{k}.npz") for k in (1, 2)]
    for name, kind in (("corners", "point1"), ("edge", "line2")):
        rows = np.concatenate([p["numbers"][p[f"side:{kind}:{name}"]] for p in parts])
        np.testing.assert_array_equal(rows, mesh.sides[name][kind])


@pytest.mark.parametrize("ending", ["bdf", "mesh", "off", "ply", "stl", "vol"])
def test_a_format_without_names_says_so(ending: str, tmp_path: Path) -> None:
    mesh = every_kind("triangle", 1)
    with pytest.warns(
        UserWarning, match=rf"part.{ending}: names are not written \(low half, left, right"
    ):
        mesh.write(tmp_path / f"part.{ending}")


UNV = """    -1
   164
         1  SI: Metre (newton)         2
    1.0D+0    1.0D+0    1.0D+0
    2.7315D+2
    -1
    -1
  2411
         3         1         1        11
   0.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         5         1         1        11
   2.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         7         1         1        11
   0.0000000000000000D+00   3.0000000000000000D+00   0.0000000000000000D+00
         9         1         1        11
   1.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
        10         1         1        11
   1.0000000000000000D+00   1.5000000000000000D+00   0.0000000000000000D+00
        11         1         1        11
   0.0000000000000000D+00   1.5000000000000000D+00   0.0000000000000000D+00
    -1
    -1
  2412
        40        42         1         1         7         6
         3         9         5        10         7        11
        41        24         1         1         7         3
         0         1         1
         3         9         5
    -1
    -1
  2467
         1         0         0         0         0         0         0         1
plate
         8        40         0         0
         2         0         0         0         0         0         0         3
foot
         8        41         0         0         7         7         0         0
         7         5         0         0
    -1
"""
"""A triangle of six nodes, its lower edge as a beam, with a group of each and of two nodes."""


def test_a_universal_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "part.unv"
    path.write_text(UNV)
    mesh = Mesh.read(path)
    mesh.check()
    assert misplaced(mesh) == 0.0
    assert volume(mesh, mesh.cells_of("plate")["tri6"], "tri6") == pytest.approx(3.0)
    assert mesh.points[mesh.sides["foot"]["line3"][0]].tolist() == [[0, 0], [2, 0], [1, 0]]
    assert mesh.points[mesh.sides["foot"]["point1"].ravel()].tolist() == [[2, 0], [0, 3]]


OTHER = {
    "dataset 780 is an older form of 2412, which is read": ("  2412\n", "   780\n"),
    "element 40: type 43 has no cell here; there are 161 (point1), 21": (
        "        42",
        "        43",
    ),
    "element 40 has 6 nodes, type 41 (tri3) has 3": ("        42", "        41"),
    "a line3 has node 8, which is not in the file": ("9         5\n    -1", "9         8\n    -1"),
    "node 5 is given again": ("         3         1         1", "         5         1         1"),
    "element 40 is given again": ("        41        24", "        40        24"),
    "group 'plate' has element 44, which is not in": ("8        40", "8        44"),
    "group 'foot' has node 4, which is not in": ("         7         7", "         7         4"),
    "dataset 2467 ends in the middle": ("         7         5         0         0\n", ""),
    "there are no nodes (dataset 2411) or no elements (2412)": ("  2412\n", "  2400\n"),
    "nodes are in coordinate system 1: save them in the global one": (
        "  2411\n",
        "  2420\n         1\npart\n         1         1         8\nbore\n"
        + "1 0 0\n0 1 0\n0 0 1\n0 0 0\n    -1\n    -1\n  2411\n",
    ),
}


@pytest.mark.parametrize("words", OTHER)
def test_what_a_universal_file_lacks_is_named(words: str, tmp_path: Path) -> None:
    path = tmp_path / "part.unv"
    old, new = OTHER[words]
    assert old in UNV
    path.write_text(UNV.replace(old, new, 1))
    with pytest.raises(MeshError, match=re.escape(words)) as info:
        Mesh.read(path)
    assert "\n" not in str(info.value)


def test_older_groups_and_long_names_of_universal_files(tmp_path: Path) -> None:
    path = tmp_path / "part.unv"
    path.write_text(UNV.replace("  2467\n", "  2432\n"))
    with pytest.warns(UserWarning, match="groups of dataset 2432 are left out; those of 2435"):
        assert not Mesh.read(path).groups
    mesh = Mesh.rectangle(1.0, 1.0, cells=(1, 1)).with_group("a" * 41, lambda x: x[:, 0] > 0)
    with pytest.raises(MeshError, match=r"cannot be a name in a \.unv file: at most 40"):
        mesh.write(path)


def test_numbers_of_cells_become_names(tmp_path: Path) -> None:
    """Physical groups in a .vtu that meshio made, properties of Nastran."""
    points = Mesh.rectangle(3.0, 1.0, cells=(3, 1)).points
    blocks = [("quad", [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]]), ("line", [[4, 0]])]
    numbers = [np.array([1, 2, 1]), np.array([7])]
    data = {"gmsh:physical": numbers, "number": [np.array([1, 2, 3]), np.array([4])]}
    points = np.pad(points, ((0, 0), (0, 1)))
    meshio.write(tmp_path / "part.vtu", meshio.Mesh(points, blocks, cell_data=data))
    meshio.write(
        tmp_path / "part.bdf", meshio.Mesh(points, blocks, cell_data={"nastran:ref": numbers})
    )
    for ending, name in (("vtu", "physical"), ("bdf", "property")):
        mesh = Mesh.read(tmp_path / f"part.{ending}")
        assert set(mesh.groups) == {f"{name} 1", f"{name} 2"}
        np.testing.assert_array_equal(mesh.groups[f"{name} 1"]["quad4"], [0, 2])
        assert mesh.points[mesh.nodes(f"{name} 7"), 0].tolist() == [0.0, 0.0]


def test_files_that_meshio_cannot_read_give_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "part.bdf"
    path.write_text("GRID,1,,0.,0.,0.\n")
    with pytest.raises(MeshError, match=r'part\.bdf: "BEGIN BULK" statement not found'):
        Mesh.read(path)
    path = tmp_path / "part.med"
    path.write_text("")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MeshError, match=r"reads \.med with the package h5py: pip install h5py"):
        Mesh.read(path)
    with pytest.raises(MeshError, match="the package h5py: pip install h5py"):
        Mesh.rectangle(1.0, 1.0, cells=(1, 1)).write(path)


def test_families_of_med_become_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As meshio hands them on; its cells are the other way round."""
    mesh = Mesh.box((2.0, 1.0, 1.0), cells=(2, 1, 1))
    faces = mesh.faces("left")["quad4"]
    found = meshio.Mesh(
        mesh.points,
        [("hexahedron", mesh.cells["hex8"][:, [0, 3, 2, 1, 4, 7, 6, 5]]), ("quad", faces)],
        cell_data={"cell_tags": [np.array([-1, -2]), np.array([-3])]},
        point_data={"point_tags": np.arange(len(mesh.points)) % 2},
    )
    found.cell_tags = {-1: ["soft"], -2: ["soft", "end"], -3: ["held"]}
    found.point_tags = {1: ["odd"]}
    (tmp_path / "part.med").write_text("")
    monkeypatch.setattr(meshio, "read", lambda path: found)
    again = Mesh.read(tmp_path / "part.med")
    again.check()
    assert {name: v["hex8"].tolist() for name, v in again.groups.items()} == {
        "soft": [0, 1],
        "end": [1],
    }
    np.testing.assert_array_equal(again.nodes("odd"), np.arange(1, len(mesh.points), 2))
    np.testing.assert_array_equal(again.nodes("held"), mesh.nodes("left"))


@pytest.mark.parametrize("title", ["Nodes", "ParametricNodes"])
def test_parametric_nodes_of_gmsh(title: str, tmp_path: Path) -> None:
    """With the entity of each node, and its parameters on curves and surfaces."""
    more = ["0 1", "1 1 0.5", "2 1 0.5 0.25", "3 1"]
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    lines = [
        f"{k} {x}" + f" {m}" * (title != "Nodes")
        for k, (x, m) in enumerate(zip(places, more, strict=True), start=1)
    ]
    path = tmp_path / "part.msh"
    path.write_text(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
        f"${title}\n4\n" + "\n".join(lines) + f"\n$End{title}\n"
        "$Elements\n1\n1 3 2 1 1 1 2 3 4\n$EndElements\n"
    )
    np.testing.assert_array_equal(Mesh.read(path).points, [[0, 0], [1, 0], [1, 1], [0, 1]])


# --- Files that a real Gmsh wrote (`tests/runtime/gmsh/make.py`): every cell once, with every -----


GMSH = Path(__file__).parent / "gmsh"
VOLUMES = {"low": 0.5, "high": 0.5, "all": 1.0}
PLACES = {"left": 0.0, "held": 0.0, "right": 2.0}


def volume(mesh: Mesh, nodes: np.ndarray, kind: str) -> float:
    """By the shape functions: wrong where a cell stands twice or its nodes are out of order."""
    cell = CELLS[kind]
    points, weights = cell.rule(4)
    slopes = np.einsum("qkd,nkc->nqcd", cell.gradient(points), mesh.points[nodes])
    metric = np.einsum("nqci,nqcj->nqij", slopes, slopes)
    return float((np.sqrt(np.linalg.det(metric)) @ weights).sum())


def misplaced(mesh: Mesh) -> float:
    """How far nodes of cells with straight sides are from where their corners say."""
    worst = 0.0
    for kind, nodes in mesh.cells.items():
        cell = CELLS[kind]
        flat = {3: "tri3", 4: "quad4" if cell.dimension == 2 else "tet4", 6: "wedge6", 8: "hex8"}[
            cell.corners
        ]
        expected = np.einsum(
            "ak,nkc->nac", CELLS[flat].shape(cell.nodes), mesh.points[nodes[:, : cell.corners]]
        )
        worst = max(worst, float(np.abs(mesh.points[nodes] - expected).max()))
    return worst


def test_every_file_has_each_cell_once_with_all_its_names() -> None:
    files = [f for f in sorted(GMSH.glob("*.msh")) if not f.name.startswith("parts")]
    assert len(files) == 33
    for file in files:
        mesh = Mesh.read(file)
        mesh.check()
        whole = 2.0**mesh.dimension
        assert misplaced(mesh) < 1e-9, file.name
        assert set(mesh.groups) == set(VOLUMES), file.name
        for name, share in VOLUMES.items():
            ((kind, nodes),) = mesh.cells_of(name).items()
            assert volume(mesh, nodes, kind) == pytest.approx(share * whole), (
                file.name,
                name,
            )
        assert set(mesh.sides) == set(PLACES), file.name
        for name, x in PLACES.items():
            ((kind, faces),) = mesh.faces(name).items()
            assert volume(mesh, faces, kind) == pytest.approx(whole / 2.0), (
                file.name,
                name,
            )
            np.testing.assert_allclose(mesh.points[faces][..., 0], x, atol=1e-9)


SQUARE = (GMSH / "square_41.msh").read_text()
DAMAGED = {
    "cells of Gmsh's type 19 are not known": re.sub(r"\n2 1 2 (\d)\n", r"\n2 1 19 \1\n", SQUARE),
    "a section is shorter than it says": SQUARE.replace("$Elements\n4 ", "$Elements\n9 "),
    "version 3: save it as 4.1 or 2.2": SQUARE.replace("4.1 0 8", "3 0 8"),
    "no nodes or no cells": SQUARE[: SQUARE.index("$Elements")],
    "the file ends in": SQUARE[: SQUARE.index("$EndElements")],
}


@pytest.mark.parametrize("words", DAMAGED)
def test_a_damaged_file_is_named(words: str, tmp_path: Path) -> None:
    file = tmp_path / "damaged.msh"
    file.write_text(DAMAGED[words])
    with pytest.raises(MeshError, match=words) as error:
        Mesh.read(file)
    assert "\n" not in str(error.value)
