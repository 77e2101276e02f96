"""Meshes in parts against the whole ones: the largest differences, relative to the largest value.

    mpiexec -n 2 python -m tests.mpi.parts FOLDER NAME...

prints a JSON object on process 0, with an entry for each problem. Every process also solves the
whole, with the serial engine.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softehl import Mesh, SoftehlError, Study
from softehl.runtime.analyses.motion import Motion
from softehl.runtime.arrays import Array
from softehl.runtime.mpi import world
from softehl.runtime.results.result import Result
from tests.mpi.problems import DOCS, STEEL, thick

SIZE = (1.0, 1.3, 0.7)
SHAPES = {
    **{"hex": ("hex", 2), "serendipity": ("serendipity", 2), "wedge": ("wedge", 1)},
    "tetrahedron": ("tetrahedron", 2),
}
GMSH = Path(__file__).parents[1] / "runtime" / "gmsh" / "parts.msh"


def box(shape: str, *, spread: bool) -> Mesh:
    """A box with a group, and a side on a part of its boundary."""
    kind, order = SHAPES[shape]
    mesh = Mesh.box(SIZE, cells=(3, 2, 4), shape=kind, order=order, spread=spread)  # type: ignore[arg-type]
    mesh = mesh.with_group("hot", lambda x: x[:, 2] > 0.35)
    return mesh.with_side("strip", lambda x: (x[:, 0] == 1.0) & (x[:, 2] > 0.3))


def study(mesh: Mesh) -> Study:
    """Every kind of load and support, and a field on one part of the cells alone."""
    found = Study(mesh)
    found.add("body", DOCS / "models" / "rubber_fields.py", mu=1.0, kappa=3.0)
    found.add("heat", DOCS / "models" / "heat_fields.py", cells="hot", k=1.0, c=1.0)
    found.start(T=0.5)
    found.fix("top", T=lambda x, t: t * x[:, 0])
    found.fix((0.0, 0.0, 0.35), T=0.0)
    found.fix("bottom", u_x=0, u_y=0, u_z=0)
    found.fix(lambda x: (x[:, 0] == 0.0) & (x[:, 2] > 0.4), u_x=0.02)
    found.spring("left", u_y=0.5)
    found.load("top", u_x=0.05, u_z=lambda x, t: 0.02 * t * x[:, 0])
    found.load(SIZE, u_z=0.01)
    found.pressure("strip", 0.03)
    return found


def two(mesh: Mesh) -> Study:
    """A plate of two materials, whose common side is loaded."""
    found = Study(mesh)
    for name, stiff in (("soft", 1.0), ("hard", 10.0)):
        file = DOCS / "models" / "rubber_fields.py"
        found.add(name, file, cells=name, mu=stiff, kappa=3.0)
    found.fix("left", u_x=0, u_y=0)
    found.fix("right", u_y=0.1)
    found.load("middle", u_x=0.05)
    found.spring("middle", u_y=0.1)
    return found


def bar(*, spread: bool) -> Study:
    """Heat in a bar with a source at one node."""
    found = Study(Mesh.line(1.0, cells=7, order=2, spread=spread))
    found.add("body", DOCS / "models" / "heat_fields.py", k=1.0, c=1.0)
    found.fix("left", T=1.0)
    found.load("right", T=0.3)
    found.load((0.5,), T=0.2)
    return found


def pulled(*, spread: bool) -> Study:
    """A block that yields: its points remember plastic strain."""
    mesh = Mesh.rectangle(6.0, 8.0, cells=(6, 8), order=2, shape="serendipity", spread=spread)
    found = Study(mesh)
    found.add("body", DOCS / "gallery" / "models" / "j2.py", **STEEL)
    found.fix("left", u_x=0, u_y=0)
    found.fix("right", u_x=lambda x, t: np.full(len(x), 0.1 * t))
    return found


def compared(parts: Result, whole: Result, block: str, side: str) -> dict[str, Any]:
    """Differences of what results have; nodes are matched by their places."""
    mesh, share = whole.system.mesh, parts.system.comm
    mine = parts.system.mesh.points
    places = np.stack([share.gather_nodes(column) for column in mine.T], axis=1)
    here, there = (np.lexsort(np.round(x, 9).T) for x in (places, mesh.points))
    found = {"places": _apart(places[here], mesh.points[there])}
    for name in whole.system.numbering.nodal:
        found[name] = _apart(parts.gathered(name)[here], whole.values(name)[there])
    known = whole.system.blocks[block].kernel.fields
    for name, values in (whole.at_nodes(block) if known else {}).items():
        shown = share.gather_nodes(parts.at_nodes(block)[name])
        found[f"{name} at nodes"] = _apart(shown[here], values[there])
    middle = tuple(mesh.points.mean(axis=0) + 0.01)
    found["at"] = _dicts(parts.at(middle), whole.at(middle))
    found["reaction"] = _dicts(parts.reaction(side), whole.reaction(side))
    found["norm"] = abs(parts.norm() / whole.norm() - 1.0)
    largest = max(world().allgather(len(mine)))
    return {"apart": found, "largest part": largest / len(mesh.points)}


def _apart(a: Array, b: Array) -> float:
    assert a.shape == b.shape, (a.shape, b.shape)
    assert np.array_equal(np.isnan(a), np.isnan(b))
    return float(np.nanmax(np.abs(a - b)) / (np.nanmax(np.abs(b)) or 1.0))


def _dicts(a: Mapping[str, float], b: Mapping[str, float]) -> float:
    assert a.keys() == b.keys()
    return _apart(np.array(list(a.values())), np.array([b[name] for name in a]))


def solved(name: str, folder: Path) -> dict[str, Any]:
    """A problem by name, in parts and whole."""
    if name == "gmsh":
        parts = two(Mesh.read(GMSH, spread=True)).solve(engine="petsc")
        whole = two(Mesh.read(GMSH.with_name("parts_all.msh"))).solve()
        return compared(parts, whole, "hard", "left")
    if name == "inner":
        parts, whole = thick(4, spread=True).solve(engine="petsc"), thick(4).solve()
        return compared(parts, whole, "body", "left")
    if name == "motion":
        given: dict[str, Any] = {"method": "newmark", "mass": {"body": {"rho": 1.0}}}
        *_, moved = thick(4, spread=True).march(dt=0.3, until=0.9, engine="petsc", **given)
        *_, end = thick(4).march(dt=0.3, until=0.9, **given)
        assert isinstance(moved, Motion)
        assert isinstance(end, Motion)
        told = compared(moved, end, "body", "left")
        told["apart"]["energy"] = _dicts(moved.energy, end.energy)
        return told
    if name == "line":
        parts, whole = bar(spread=True).solve(engine="petsc"), bar(spread=False).solve()
        return compared(parts, whole, "body", "left")
    if name == "march":
        file = folder / "steps.pvd"
        steps = pulled(spread=True).march(dt=0.5, until=1.0, engine="petsc", write=file)
        whole_steps = pulled(spread=False).march(dt=0.5, until=1.0)
        return compared([*steps][-1], [*whole_steps][-1], "body", "left")
    whole = study(mesh := box("hex" if name in ("files", "wrong") else name, spread=False)).solve()
    if name in SHAPES:
        mine = box(name, spread=True)
    else:
        file = folder / "box.npz"
        if world().rank == 0:
            mesh.write(file, parts=4)
        world().Barrier()
        mine = Mesh.read(file, spread=True)
    posed = study(mine)
    if name == "wrong":
        posed.load("left", u_x=1e-6)
    parts = posed.solve(engine="petsc", write=folder / "steps.pvd")
    return compared(parts, whole, "body", "bottom")


def _box() -> Study:
    found = study(box("wedge", spread=True))
    found.start(T=0.0)
    return found


REFUSED: dict[str, Callable[[Path], object]] = {
    "serial": lambda folder: _box().solve(),
    "tie": lambda folder: _box().tie("left", "right", "u_x"),
    "contact": lambda folder: _box().contact("left", "right"),
    "split": lambda folder: _box().mesh.split(),
    "checkpoint": lambda folder: next(
        _box().march(dt=1.0, until=1.0, engine="petsc", checkpoint=folder / "no.npz")
    ),
    "nowhere": lambda folder: _box().fix(lambda x: x[:, 0] > 5.0, u_x=0),
    "no place": lambda folder: _box().fix((3.0, 3.0, 3.0), u_x=0),
    "outside": lambda folder: _box().solve(engine="petsc").at((3.0, 3.0, 3.0)),
    "whole file": lambda folder: _box().solve(engine="petsc").write(folder / "no.vtu"),
    "too many": lambda folder: Mesh.line(1.0, cells=1, spread=True),
    "no file": lambda folder: Mesh.read(folder / "none.msh", spread=True),
}
"""Calls that are refused."""


def messages(folder: Path) -> dict[str, str]:
    """Message of every refused call on process 0; empty unless all processes refuse it."""
    found = {}
    for name, call in REFUSED.items():
        try:
            call(folder)
            said = ""
        except (SoftehlError, OSError) as error:
            said = str(error)
        every = world().allgather(said)
        found[name] = every[0] if all(every) else ""
    return found


def main() -> None:
    place, *names = sys.argv[1:]
    found = {}
    for name in names:
        folder = Path(place) / name
        if world().rank == 0:
            folder.mkdir(exist_ok=True)
        world().Barrier()
        found[name] = messages(folder) if name == "refused" else solved(name, folder)
    if world().rank == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
