"""Relations of the crossings: each computes one physical quantity by two routes.

A relation takes a `Problem` and returns pairs of arrays that must be equal. `over` are the axes it
is tried on: in the quick tests one feature at a time differs from the first of its axis, in the
slow ones two of them (`pairs`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from softehl import Mesh, Plane, Study
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.mesh import Predicate
from softehl.runtime.mesh.readers.meshio import import_meshio
from softehl.runtime.results.result import Result
from tests.crossings.features import FAST, GEOMETRIES, LAWS, SIZE, WITHOUT_MATRIX, Problem
from tests.runtime.contact_laws import cohesion

Pairs = Iterator[tuple[Array | float, Array | float]]

INERTIA = ("newmark", "generalised-alpha", "midpoint", "explicit")
ONE_BODY = tuple(name for name, law in LAWS.items() if law.given == LAWS["energy"].given)
ONE_BODY = tuple(name for name in ONE_BODY if name != "enhanced")
"""Laws that write one and the same body."""

BASE = Problem()


@dataclass(frozen=True)
class Relation:
    """Two routes to one quantity.

    over: axes of which every feature is tried alone. pairs: axes of which every two features are
    tried together. base: the problem whose features are replaced. quick: axes of `over` that the
    quick tests try. tolerance: of the largest value; looser: the same for some features. of: what
    the relation has a meaning for.
    """

    routes: Callable[[Problem], Pairs]
    over: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...] = ()
    base: Problem = BASE
    quick: tuple[str, ...] = ("analysis", "law", "load", "constraint", "geometry", "solver")
    tolerance: float = 1e-8
    looser: Mapping[str, float] = field(default_factory=dict)
    of: Callable[[Problem], bool] = lambda at: True


def displacements(result: Result) -> Array:
    """All displacements at nodes, (n, dim)."""
    names = ("u_x", "u_y", "u_z")[: result.system.mesh.dimension]
    return np.stack([result.values(name) for name in names], axis=1)


def force(result: Result, where: object = None) -> Array:
    """Sum of the reactions on all nodes, or on those of a side, (dim,)."""
    everywhere = (lambda x: np.ones(len(x), dtype=bool)) if where is None else where
    found = result.reaction(everywhere)  # type: ignore[arg-type]
    return np.array([found[n] for n in ("u_x", "u_y", "u_z")[: result.system.mesh.dimension]])


def static(at: Problem) -> Pairs:
    """Every analysis of a slow load ends in the static state."""
    result, known = at.run(), replace(at, analysis="many steps").run()
    yield displacements(result), displacements(known)
    yield force(result, "left"), force(known, "left")


def equilibrium(at: Problem) -> Pairs:
    """Reactions balance the loads."""
    result = at.run()
    if at.load == "prescribed":
        yield force(result, "left"), -force(result, "right")
    else:
        yield force(result), -applied(at, result)


def applied(at: Problem, result: Result) -> Array:
    """Sum of the loads, from their definition and the size of the block."""
    volume = float(np.prod(SIZE[: at.dimension]))
    area = volume / SIZE[0]
    x, y = np.eye(at.dimension)[:2]
    if at.load == "pressure":  # of the chord from end to end: the integral of the normal
        moved = result.deformed(at.axes)
        a, b = (moved[result.system.mesh.node_at(np.array([x, 1.0]))] for x in (0.0, 2.0))
        return np.array([0.004 * (b - a)[1], -0.004 * (b - a)[0]])
    sizes = {"traction": 0.004 * area * y, "tension": 0.05 * area * x, "force": 0.004 * y}
    return np.asarray({**sizes, "weight": 0.003 * volume * y}[at.load])


def control(at: Problem) -> Pairs:
    """A force gives a displacement; this displacement gives the force."""
    loaded = at.run()
    moved = loaded.at(at.corner)["u_y"]
    study = Study(at.mesh())
    at.properties.add(study)
    study.fix("left", **dict.fromkeys(at.axes, 0.0))
    study.fix(at.corner, u_y=lambda x, t: moved * at.ramp(t))
    pulled, corner = at.run(study), np.array(at.corner)
    yield displacements(pulled), displacements(loaded)
    yield pulled.reaction(lambda x: np.linalg.norm(x - corner, axis=1) < 1e-9)["u_y"], 0.004


def turned(at: Problem) -> Pairs:
    """A turned block with turned loads has turned displacements."""
    known, result = at.run(), replace(at, turn=0.7).run()
    yield displacements(result), replace(at, turn=0.7).turned(displacements(known))


def units(at: Problem) -> Pairs:
    """Lengths in metres and stresses in pascals give the same in other units."""
    other = replace(at, length=1e-3, stress=1e6)
    known, result = at.run(), other.run()
    yield displacements(result), 1e-3 * displacements(known)
    size = 2 if at.geometry == "axisymmetric" else at.dimension - 1
    yield force(result, "left"), 1e6 * 1e-3**size * force(known, "left")


def renumbered(at: Problem) -> Pairs:
    """Nodes and cells in another order are the same body; so are two groups of its cells."""
    mesh, rng = at.mesh(), np.random.default_rng(7)
    ((kind, cells),) = mesh.cells.items()
    order = rng.permutation(len(mesh.points))
    number = np.argsort(order)
    shuffled = number[rng.permutation(cells)]
    sides = {s: {k: number[f] for k, f in faces.items()} for s, faces in mesh.sides.items()}
    other = Mesh(mesh.points[order], {kind: shuffled}, sides=sides)
    known = at.run()
    result = at.run(at.study(other))
    yield displacements(result)[number], displacements(known)


def grouped(at: Problem) -> Pairs:
    """Two groups of cells with one law are one body."""
    result, known = in_groups(at), at.run()
    yield displacements(result), displacements(known)


def in_groups(at: Problem, factor: float = 1.0) -> Result:
    """The state of two groups of cells; factor: of a constant of the second one."""
    middle = at.mesh().points[:, 0].mean()
    mesh = at.mesh().with_group("near", lambda x: x[:, 0] < middle)
    mesh = mesh.with_group("far", lambda x: x[:, 0] >= middle)
    study = Study(mesh, geometry=GEOMETRIES[at.geometry])
    parameter, given = at.properties.parameter, at.properties.given
    at.properties.add(study, "near", "near")
    at.properties.add(study, "far", "far", **{parameter: factor * given[parameter]})
    at.hold(study)
    return replace(at, bodies=("near", "far")).run(study)


def tied(at: Problem) -> Pairs:
    """Two halves that are tied are one body."""
    mesh = at.mesh()
    ((kind, cells),) = mesh.cells.items()
    far = mesh.points[cells].mean(axis=1)[:, 0] > 0.5 * SIZE[0]
    halves = []
    for chosen in (cells[~far], cells[far]):
        used, nodes = np.unique(chosen, return_inverse=True)
        halves.append(Mesh(mesh.points[used], {kind: nodes.reshape(chosen.shape)}))
    both = Mesh.union(near=halves[0], far=halves[1])
    at_side = _side_planes(at.dimension)
    for name, (axis, value) in at_side.items():
        both = both.with_side(name, _plane(axis, value))
    both = both.with_side("end", lambda x: abs(x[:, 0] - 0.5 * SIZE[0]) < 1e-9)
    cut = np.unique(np.concatenate([f.ravel() for f in both.sides["end"].values()]))
    near = np.unique(both.cells_of("near")[kind])
    first, second = cut[np.isin(cut, near)], cut[~np.isin(cut, near)]
    study = Study(both)
    at.properties.add(study)
    at.hold(study)
    study.tie(second, first, *at.axes, *(["p"] if at.law == "taylor-hood" else []))
    result, known = at.run(study), at.run()
    place = [mesh.node_at(x) for x in both.points]
    yield displacements(result), displacements(known)[place]


def _side_planes(dimension: int) -> dict[str, tuple[int, float]]:
    names = ["left", "right", "bottom", "top"]
    if dimension == 3:
        names[2:2] = ["front", "back"]
    return {n: (k // 2, (0.0, SIZE[k // 2])[k % 2]) for k, n in enumerate(names)}


def _plane(axis: int, value: float) -> Predicate:
    return lambda x: np.asarray(abs(x[:, axis] - value) < 1e-9)


def one_body(at: Problem) -> Pairs:
    """All ways to write the body give one state."""
    result, known = at.run(), replace(at, law="energy", solver="auto").run()
    yield displacements(result), displacements(known)


def without_matrix(at: Problem) -> Pairs:
    """A solver that needs products finds the state of one that factorises, in two regions."""
    result, known = (in_groups(a, 3.0) for a in (at, replace(at, solver="auto")))
    yield displacements(result), displacements(known)
    yield force(result, "left"), force(known, "left")


def condensed(at: Problem) -> Pairs:
    """A pressure that is condensed is the one that is an unknown."""
    result, known = replace(at, law="condensed").run(), replace(at, law="mixed").run()
    yield displacements(result), displacements(known)
    one, other = (np.append(r.fields("body")["p"], 0.004) for r in (result, known))
    yield one, other  # relative to the load where pressures vanish


def ring(at: Problem) -> Pairs:
    """A ring of large radius is in plane strain."""
    wide = replace(at, geometry="axisymmetric", radius=1e5)
    yield displacements(wide.run()), displacements(at.run())


_SOLID = {"quad4": "hex8", "quad8": "hex20", "quad9": "hex27", "quad16": "hex64", "tri3": "wedge6"}


def slab(at: Problem) -> Pairs:
    """A slab between two planes is in plane strain."""
    flat = at.mesh()
    cell = _SOLID[at.cell]
    order = {"quad4": 1, "tri3": 1, "quad16": 3}.get(at.cell, 2)
    shape = {"quad8": "serendipity", "tri3": "wedge"}.get(at.cell, "hex")
    counts = (4, 2, 1) if order == 1 else (2, 1, 1)
    mesh = Mesh.box(SIZE, cells=counts, order=order, shape=shape)  # type: ignore[arg-type]
    assert cell in mesh.cells
    study = Study(_renamed(mesh))
    at.properties.add(study)
    replace(at, cell=cell).hold(study)
    study.fix(lambda x: np.ones(len(x), dtype=bool), u_z=0.0)
    result, known = at.run(study), at.run()
    there = [flat.node_at(x[:2]) for x in study.mesh.points]
    yield displacements(result)[:, :2], displacements(known)[there]


def _renamed(mesh: Mesh) -> Mesh:
    """A box whose sides along y are called as in the plane."""
    sides = dict(mesh.sides)
    sides["bottom"], sides["top"] = mesh.sides["front"], mesh.sides["back"]
    return Mesh(mesh.points, mesh.cells, sides=sides)


def sensitivity(at: Problem) -> Pairs:
    """Derivatives by a constant of the law are those of other runs."""
    name = at.properties.parameter
    size = at.properties.given[name]

    def value(change: float) -> Array:
        constants: Any = {name: size * (1.0 + change)}
        result = at.run(at.study(**constants))
        return np.array([result.at(at.corner)["u_y"], result.reaction("left")["u_y"]])

    result, by = at.run(at.study(again=True)), {"body": [name]}
    slopes = [
        result.sensitivity("u_y", at=at.corner, by=by)["body", name],
        result.sensitivity("u_y", reaction="left", by=by)["body", name],
    ]
    step = 1e-4
    known = (value(step) - value(-step)) / (2.0 * step * size)
    yield np.array(slopes, dtype=np.float64), known


def hessian(at: Problem) -> Pairs:
    """Second derivatives by a constant of the law are differences of first ones."""
    name = at.properties.parameter
    size, by = at.properties.given[name], {"body": [name]}

    def slopes(change: float) -> Array:
        constants: Any = {name: size * (1.0 + change)}
        result = at.run(at.study(again=True, **constants))
        asked: Any = ({"at": at.corner}, {"reaction": "left"})
        return np.array([result.sensitivity("u_y", by=by, **a)["body", name] for a in asked])

    result, step, pair = at.run(at.study(again=True)), 1e-4, (("body", name), ("body", name))
    values = [
        result.hessian("u_y", at=at.corner, by=by)[pair],
        result.hessian("u_y", reaction="left", by=by)[pair],
    ]
    known = (slopes(step) - slopes(-step)) / (2.0 * step * size)
    yield np.array(values, dtype=np.float64), known


def begun(at: Problem) -> Pairs:
    """A path goes on from a result, or from initial values of unknowns and history."""
    study, again = at.study(), at.study()
    half = study.solve(steps=at.steps, until=0.5, **at.options)
    for name in half.system.numbering.nodal:
        values = half.values(name)
        nodes = np.flatnonzero(~np.isnan(values))
        given: Any = {name: values[nodes]}
        again.initial(nodes, **given)
    for block, state in half.state.items():
        names = half.system.blocks[block].kernel.point_data
        columns: Any = {name: state[:, :, k] for k, name in enumerate(names)}
        again.initial(block=block, **columns)
    yield again.solve(**at.options).x, study.solve(start=half, **at.options).x


def restarted(at: Problem) -> Pairs:
    """A march that is interrupted and restarted is the one that is not."""
    study = at.study()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "checkpoint.npz"
        options: Any = {"method": at.analysis, **at.options}
        *_, known = study.march(dt=0.125, until=1.0, **options)
        for _ in study.march(dt=0.125, until=0.5, checkpoint=file, **options):
            pass
        *_, result = study.march(dt=0.125, until=1.0, restart=file, **options)
    yield result.x, known.x


def energies(at: Problem) -> Pairs:
    """A slow motion has the energy that the loads and supports put into the body."""
    result = at.run()
    energy = result.energy  # type: ignore[attr-defined]
    yield energy["balance"] + energy["external"], energy["external"]
    yield energy["internal"], energy["external"]
    body = result.system.blocks["body"].kernel
    alone = at.constraint != "spring" and at.load != "weight"
    if "energy" in body.tasks and not body.history and alone:
        yield result.integral("energy", block="body"), energy["internal"]


def stable(at: Problem) -> Pairs:
    """A body that is pulled is stable, however it is written."""
    count = at.run().unstable
    yield float("nan") if count is None else float(count), 0.0


def frequencies(at: Problem) -> Pairs:
    """Frequencies of the body do not depend on the kind of its cells."""
    modes = at.study().solve(until=0.0, **at.options).modes(2, mass={"body": {"rho": FAST}})
    reference = replace(at, cell="quad25" if at.dimension == 2 else "hex64", solver="auto")
    law = "energy" if at.properties.given == LAWS["energy"].given else at.law
    state = replace(reference, law=law).study().solve(until=0.0)
    known = state.modes(2, mass={"body": {"rho": FAST}})
    yield modes.frequencies, known.frequencies


def refined(at: Problem) -> Pairs:
    """The end of the body moves alike, whatever the kind of its cells."""
    reference = replace(at, cell="quad25" if at.dimension == 2 else "hex64")
    ends = [result.at(at.corner) for result in (at.run(), reference.run())]
    one, other = (np.array([end[name] for name in at.axes]) for end in ends)
    yield one, other


def homogeneous(at: Problem) -> Pairs:
    """A periodic cell of one law: its tangent is the slope of its stress."""
    study = Study(at.mesh())
    at.properties.add(study)
    pairs = [("left", "right"), ("bottom", "top")]
    if at.dimension == 3:
        pairs.insert(1, ("front", "back"))
    cell = study.periodic(*pairs)
    F = np.eye(at.dimension) + 0.02 * np.arange(at.dimension**2).reshape(at.dimension, -1)
    step = 1e-5
    slopes = []
    for k in range(2):
        change = np.zeros_like(F)
        change[k, 1] = step
        slopes.append((cell.solve(F + change).P - cell.solve(F - change).P) / (2 * step))
    state = cell.solve(F)
    yield np.array([state.A[:, :, k, 1] for k in range(2)]), np.array(slopes)


def pressed(at: Problem, **contact: Any) -> Pairs:
    """Two bodies in contact: what is loaded, what touches and what holds are one force."""
    if at.dimension == 2:
        upper = Mesh.rectangle(1, 1, cells=(2, 2)).map(lambda x: x + np.array([0, 1]))
        lower = Mesh.rectangle(1, 1, cells=(3, 2))
    else:
        upper = Mesh.box((1, 1, 1), cells=(1, 1, 1)).map(lambda x: x + np.array([0, 0, 1]))
        lower = Mesh.box((1, 1, 1), cells=(2, 2, 1))
    study = Study(Mesh.union(upper=upper, lower=lower))
    for name in ("upper", "lower"):
        at.properties.add(study, name, name)
    study.contact("upper:bottom", "lower:top", **contact)
    down = at.axes[-1]
    study.fix("lower:bottom", **{down: 0.0})
    for name in at.axes[:-1]:
        study.fix(lambda x: np.ones(len(x), dtype=bool), **{name: 0.0})
    push = {down: lambda x, t: np.full(len(x), -0.03 * at.ramp(t))}
    study.load("upper:top", **push)
    result = replace(at, bodies=("upper", "lower")).run(study)
    fields = result.fields("contact")
    yield float((fields["pressure"] * fields["area"]).sum()), 0.03
    yield result.reaction("lower:bottom")[down], 0.03


def pressed_by_law(at: Problem) -> Pairs:
    """The same by a law of contact."""
    return pressed(at, law=cohesion, s=1.0, d=0.1)


def on_plane(at: Problem) -> Pairs:
    """A body on a rigid plane is the one whose side slides; the plane has its force."""
    study, known = (Study(at.mesh()) for _ in range(2))
    up, down = np.eye(at.dimension)[-1], at.axes[-1]
    for one in (study, known):
        at.properties.add(one)
        one.fix("left", **dict.fromkeys(at.axes[:-1], 0.0))
        push = {down: lambda x, t: np.full(len(x), -0.02 * at.ramp(t))}
        one.load("top", **push)
    known.fix("bottom", **{down: 0.0})
    study.contact("bottom", Plane(0.0 * up, up))
    result, sliding = at.run(study), at.run(known)
    fields = result.fields("contact")
    yield float((fields["pressure"] * fields["area"]).sum()), 0.02 * SIZE[0]
    yield displacements(result), displacements(sliding)


def written(at: Problem) -> Pairs:
    """A file has what the result has."""
    meshio = import_meshio()
    result = at.run()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "body.vtu"
        result.write(path)
        found = meshio.read(path)
    yield found.point_data["u"][:, : at.dimension], displacements(result)


_ALL = ("law", "cell", "load", "constraint", "geometry", "solver")
_COARSE = {
    **{"quad4": 0.3, "tri3": 0.7, "hex8": 0.6, "tet4": 1.2, "wedge6": 0.8, "pyramid5": 0.6},
    **dict.fromkeys(
        ("quad8", "quad9", "tri6", "hex20", "hex27", "tet10", "wedge15", "wedge18"), 0.15
    ),
}
"""What coarse meshes of orders 1 and 2 may be off by."""
RELATIONS: dict[str, Relation] = {
    "static state": Relation(
        static,
        ("analysis", *_ALL),
        tuple(("analysis", axis) for axis in _ALL if axis != "cell"),
        tolerance=1e-6,
        looser={"midpoint": 1e-2, "explicit": 3e-3, "adaptive": 1e-5, "plastic": 3e-2},
    ),
    "equilibrium": Relation(
        equilibrium,
        ("load", "analysis", *_ALL),
        (("analysis", "load"), ("load", "cell"), ("load", "constraint")),
        quick=("load", "analysis", "constraint"),
        tolerance=1e-7,
        looser={"midpoint": 1e-2, "explicit": 3e-3, "newmark": 1e-5, "generalised-alpha": 1e-5},
        of=lambda at: (
            at.geometry == "plane strain" and (at.load != "pressure" or at.dimension == 2)
        ),
    ),
    "force and displacement": Relation(
        control,
        ("analysis", "law", "cell", "solver"),
        base=replace(Problem(), load="force"),
        quick=("analysis",),
        tolerance=1e-6,
        looser={"midpoint": 2e-2, "explicit": 3e-3, "plastic": 3e-2},
    ),
    "turned": Relation(
        turned,
        ("law", "cell", "load", "analysis", "solver"),
        quick=("law", "load"),
        tolerance=1e-7,
        looser={"midpoint": 1e-5, "explicit": 1e-5},
        of=lambda at: at.load != "prescribed",
    ),
    "units": Relation(
        units,
        ("law", "cell", "load", "constraint", "solver", "geometry"),
        (("law", "constraint"),),
        quick=("law", "load", "constraint"),
        tolerance=1e-6,
    ),
    "renumbered": Relation(
        renumbered,
        ("law", "cell", "load", "constraint", "analysis", "solver", "geometry"),
        (("law", "constraint"),),
        quick=("load", "constraint"),
        tolerance=1e-7,
        looser={"explicit": 1e-5, "midpoint": 1e-6},
    ),
    "groups": Relation(
        grouped,
        ("law", "cell", "load", "constraint", "analysis", "solver"),
        (("law", "constraint"), ("analysis", "constraint")),
        quick=("load", "constraint"),
        tolerance=1e-7,
        looser={"explicit": 1e-5, "midpoint": 1e-6},
        of=lambda at: at.cell != "hex64",
    ),
    "tied halves": Relation(
        tied,
        ("law", "cell", "load", "constraint", "analysis", "solver"),
        (("analysis", "constraint"),),
        quick=("law", "load", "analysis", "constraint"),
        tolerance=1e-6,
        looser={"explicit": 1e-4, "midpoint": 1e-4},
        of=lambda at: at.cell != "hex64",
    ),
    "one body": Relation(
        one_body,
        ("law", "analysis"),
        tuple(("law", axis) for axis in ("analysis", "load", "constraint", "solver", "geometry")),
        quick=("law",),
        tolerance=1e-7,
        looser={"midpoint": 1e-2, "explicit": 1e-5},
        of=lambda at: at.law in ONE_BODY,
    ),
    "without a matrix": Relation(
        without_matrix,
        ("solver", "law", "load", "constraint", "analysis", "geometry"),
        (("law", "solver"),),
        base=replace(Problem(), solver="emulated"),
        quick=("solver", "constraint"),
        tolerance=1e-9,
        of=lambda at: at.solver in WITHOUT_MATRIX,
    ),
    "condensed": Relation(
        condensed,
        ("cell", "load", "constraint", "analysis", "geometry"),
        (("analysis", "constraint"),),
        quick=("load", "analysis", "constraint"),
        tolerance=1e-6,
        looser={"midpoint": 1e-2},
    ),
    "large ring": Relation(
        ring,
        ("law", "cell", "load", "constraint", "analysis"),
        (("cell", "load"),),
        quick=("load", "constraint"),
        tolerance=1e-4,
        looser={"tri6": 1e-3},  # rules of rings have a higher degree
        # a rigid ring moves along its axis alone
        of=lambda at: (
            at.dimension == 2
            and at.load != "force"
            and at.constraint not in ("spring", "rigid side")
        ),
    ),
    "slab": Relation(
        slab,
        ("law", "cell", "load", "analysis"),
        (("cell", "load"),),
        quick=("load",),
        tolerance=1e-6,
        looser={"midpoint": 1e-4, "explicit": 1e-4},
        of=lambda at: at.cell in _SOLID and at.load != "force",
    ),
    "sensitivity": Relation(
        sensitivity,
        ("law", "load", "constraint", "analysis", "solver"),
        (("law", "analysis"), ("law", "constraint"), ("analysis", "load")),
        quick=("load", "constraint", "analysis"),
        tolerance=1e-4,
    ),
    "hessian": Relation(
        hessian,
        ("law", "load", "constraint", "analysis", "solver"),
        (("law", "analysis"), ("law", "constraint"), ("analysis", "load")),
        quick=("analysis",),
        tolerance=1e-5,
    ),
    "initial values": Relation(
        begun,
        ("law", "cell", "constraint", "geometry", "solver"),
        quick=("law",),
        tolerance=1e-6,
        # history of a number for each term, and states of unit cells, are not given so
        of=lambda at: at.law not in ("softened", "unit cells"),
    ),
    "restart": Relation(
        restarted,
        ("law", "load", "constraint", "solver"),
        base=replace(Problem(), analysis="bdf2"),
        quick=("law",),
        tolerance=1e-14,
    ),
    "energies": Relation(
        energies,
        ("law", "load", "constraint", "geometry", "analysis"),
        (("load", "constraint"), ("analysis", "load"), ("analysis", "law")),
        replace(Problem(), analysis="midpoint"),
        quick=("load", "constraint"),
        tolerance=2e-2,
        of=lambda at: at.analysis in INERTIA,
    ),
    "stability": Relation(
        stable,
        ("law", "cell", "load", "constraint", "analysis", "solver"),
        (("law", "constraint"),),
        quick=("law", "constraint"),
        tolerance=1e-12,
        # a pressure has no energy, and without a matrix there are no factors
        of=lambda at: at.load != "pressure" and at.solver not in WITHOUT_MATRIX,
    ),
    "frequencies": Relation(
        frequencies,
        ("cell", "law", "constraint"),
        (("cell", "constraint"),),
        quick=("constraint",),
        tolerance=0.03,
        looser=_COARSE,
        of=lambda at: at.constraint != "spring",  # one at each node
    ),
    "refinement": Relation(
        refined,
        ("cell", "load", "constraint", "geometry"),
        (("cell", "load"),),
        quick=("load",),
        tolerance=0.03,
        looser=_COARSE,
        of=lambda at: at.load != "force" and at.constraint != "spring",
    ),
    "periodic cell": Relation(homogeneous, ("law", "cell"), quick=("law",), tolerance=1e-5),
    "contact": Relation(
        pressed,
        ("analysis", "law", "solver"),
        (("analysis", "law"),),
        quick=("analysis",),
        tolerance=1e-6,
        looser={"midpoint": 1e-2, "newmark": 3e-3, "generalised-alpha": 3e-3, "explicit": 1e-2},
    ),
    "law of contact": Relation(
        pressed_by_law,
        ("analysis", "law", "solver"),
        (("analysis", "law"),),
        quick=("analysis",),
        tolerance=1e-6,
    ),
    "rigid surface": Relation(
        on_plane,
        ("analysis", "law", "solver"),
        (("analysis", "law"),),
        quick=("analysis",),
        tolerance=1e-6,
        looser={"midpoint": 1e-2, "newmark": 3e-3, "generalised-alpha": 3e-3, "explicit": 1e-2},
    ),
    "files": Relation(written, ("cell", "law"), quick=(), tolerance=1e-12),
}
"""Relations by name."""
