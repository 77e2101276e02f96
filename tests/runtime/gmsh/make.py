"""Write the mesh files beside this script with a real Gmsh: `pip install gmsh`, then run it.

A square or cube of side 2 is two halves, "low" (x < 1) and "high", both of which are "all". The
curve or surface at x = 0 is "left" and "held", that at x = 2 is "right". Numbers of groups are
those of their dimension: "low" and "left" have the same.
"""

from __future__ import annotations

from pathlib import Path

import gmsh

HERE = Path(__file__).parent
VERSIONS = {
    "22": (2.2, 0),
    "22_binary": (2.2, 1),
    "40": (4.0, 0),
    "41": (4.1, 0),
    "41_binary": (4.1, 1),
}
"""Name of a version -> its number, and whether it is binary."""


def halves(dimension: int, *, hexahedra: bool) -> None:
    """Geometry, groups and cells of two halves side by side."""
    occ, model = gmsh.model.occ, gmsh.model
    if dimension == 2:
        parts = [(2, occ.addRectangle(x, 0, 0, 1, 2)) for x in (0, 1)]
    else:
        parts = [(3, occ.addBox(x, 0, 0, 1, 2, 2)) for x in (0, 1)]
    occ.fragment(parts[:1], parts[1:])
    occ.synchronize()
    by_place = sorted(model.getEntities(dimension), key=lambda e: occ.getCenterOfMass(*e)[0])
    low, high = (tag for _, tag in by_place)
    model.addPhysicalGroup(dimension, [low], 1, "low")
    model.addPhysicalGroup(dimension, [high], 2, "high")
    model.addPhysicalGroup(dimension, [low, high], 3, "all")
    for name, number, x in (("left", 1, 0.0), ("held", 2, 0.0), ("right", 3, 2.0)):
        there = [
            tag
            for d, tag in model.getEntities(dimension - 1)
            if abs(occ.getCenterOfMass(d, tag)[0] - x) < 1e-9
        ]
        model.addPhysicalGroup(dimension - 1, there, number, name)
    if hexahedra:
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        for _, tag in model.getEntities(1):
            model.mesh.setTransfiniteCurve(tag, 2)
        for _, tag in model.getEntities(2):
            model.mesh.setTransfiniteSurface(tag)
        for _, tag in model.getEntities(3):
            model.mesh.setTransfiniteVolume(tag)
    gmsh.option.setNumber("Mesh.MeshSizeMin", dimension)
    gmsh.option.setNumber("Mesh.MeshSizeMax", dimension)


def written(name: str, dimension: int, *, order: int = 1, **given: bool) -> None:
    """One mesh, in every version."""
    gmsh.clear()
    gmsh.option.restoreDefaults()
    gmsh.option.setNumber("General.Terminal", 0)
    save_all = given.pop("save_all", False)
    serendipity = given.pop("serendipity", False)
    halves(dimension, hexahedra=given.pop("hexahedra", False))
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", int(serendipity))
    gmsh.model.mesh.generate(dimension)
    gmsh.model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.SaveAll", int(save_all))
    for version, (number, binary) in VERSIONS.items():
        if save_all and number < 4:
            continue  # such a file has no groups
        gmsh.option.setNumber("Mesh.MshFileVersion", number)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(HERE / f"{name}_{version}.msh"))


def in_parts() -> None:
    """A plate of two materials, whole and in three files, one for each partition."""
    gmsh.clear()
    gmsh.option.restoreDefaults()
    gmsh.option.setNumber("General.Terminal", 0)
    occ, model = gmsh.model.occ, gmsh.model
    soft, hard = occ.addRectangle(0, 0, 0, 2, 1), occ.addRectangle(2, 0, 0, 1, 1)
    occ.fragment([(2, soft)], [(2, hard)])
    occ.synchronize()
    model.addPhysicalGroup(2, [soft], 1, "soft")
    model.addPhysicalGroup(2, [hard], 2, "hard")
    for number, (name, x) in enumerate((("left", 0.0), ("middle", 2.0), ("right", 3.0)), start=1):
        there = [t for d, t in model.getEntities(1) if abs(occ.getCenterOfMass(d, t)[0] - x) < 1e-9]
        model.addPhysicalGroup(1, there, number, name)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    model.mesh.generate(2)
    gmsh.write(str(HERE / "parts_all.msh"))
    model.mesh.partition(3)
    gmsh.option.setNumber("Mesh.PartitionSplitMeshFiles", 1)
    gmsh.write(str(HERE / "parts.msh"))


if __name__ == "__main__":
    gmsh.initialize()
    written("square", 2)
    written("square_tri6", 2, order=2)
    written("square_all", 2, save_all=True)
    written("quads", 2, order=2, hexahedra=True)
    written("cube_tet10", 3, order=2)
    written("cube_hex20", 3, order=2, hexahedra=True, serendipity=True)
    written("cube_hex27", 3, order=2, hexahedra=True)
    in_parts()
    gmsh.finalize()
