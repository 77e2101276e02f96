"""Axes of the crossings: each feature is one line; `Problem` is one of each.

The body is a block 2 x 1 (x 1), held on its left side. `Problem.study` writes it down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from softehl import Kernel, MatrixFree, Mesh, SolverOptions, Study, initial_weights, load_kernel
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result
from tests.crossings import pages

SIZE = (2.0, 1.0, 1.0)
FAST = 1e-9
"""Density [t/mm^3] at which a load that grows over one unit of time is slow."""


@dataclass(frozen=True)
class Cell:
    """A kind of cell: arguments of the structured mesh, and the number of cells along each axis."""

    shape: str
    order: int = 1
    cells: tuple[int, ...] = (4, 2)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.cells)

    def mesh(self) -> Mesh:
        """The block."""
        options: Any = {"cells": self.cells, "order": self.order, "shape": self.shape}
        if self.dimension == 2:
            return Mesh.rectangle(*SIZE[:2], **options)
        return Mesh.box(SIZE, **options)


CELLS = {
    "quad4": Cell("quad"),
    "quad8": Cell("serendipity", 2, (2, 1)),
    "quad9": Cell("quad", 2, (2, 1)),
    "quad16": Cell("quad", 3, (2, 1)),
    "quad25": Cell("quad", 4, (2, 1)),
    "quad36": Cell("quad", 5, (2, 1)),
    "quad49": Cell("quad", 6, (2, 1)),
    "tri3": Cell("triangle"),
    "tri6": Cell("triangle", 2, (2, 1)),
    "hex8": Cell("hex", 1, (2, 1, 1)),
    "hex20": Cell("serendipity", 2, (2, 1, 1)),
    "hex27": Cell("hex", 2, (2, 1, 1)),
    "hex64": Cell("hex", 3, (1, 1, 1)),
    "tet4": Cell("tetrahedron", 1, (2, 1, 1)),
    "tet10": Cell("tetrahedron", 2, (2, 1, 1)),
    "wedge6": Cell("wedge", 1, (2, 1, 1)),
    "wedge15": Cell("wedge", 2, (2, 1, 1)),
    "wedge18": Cell("lagrange_wedge", 2, (2, 1, 1)),
    "pyramid5": Cell("pyramid", 1, (2, 1, 1)),
}
"""Kinds of cells."""


@dataclass(frozen=True, eq=False)
class Law:
    """A way to write the body: a page or a material, its constants, what is known of it."""

    given: dict[str, Any]
    page: Any = None
    material: Any = None
    small: bool = False
    history: bool = False
    parameter: str = "mu"

    def constants(self, stress: float = 1.0) -> dict[str, Any]:
        """Arguments of `Study.add` in another unit of stress."""
        pure = {"nu", "alpha_1", "alpha_2", "alpha_3", "W", "U", "share", "rate"}
        return {n: v if n in pure else stress * v for n, v in self.given.items()}

    def add(
        self,
        study: Study,
        name: str = "body",
        cells: str | None = None,
        *,
        again: bool = False,
        **constants: float,
    ) -> None:
        """The body on all cells or on a group; again: read the page again, as derivatives need."""
        given: dict[str, Any] = {**self.given, **constants}
        (kind,) = study.mesh.cells
        if again and self.page is None:
            study.add(name, material=self.material, cells=cells, **given)
        else:
            source = self.page if again else self.kernel(kind, study.geometry)
            study.add(name, source, cells=cells, **given)

    @cached_property
    def offering(self) -> Law:
        """The law with products by sum factorisation; the law itself where it is given by name."""
        source = self.material if self.page is None else self.page
        if isinstance(source, str) or self.page is pages.product:
            return self
        page = source.page() if self.page is None else source
        return replace(self, page=pages.offering(page), material=None)

    @cache  # noqa: B019
    def kernel(self, cell: str, geometry: str | None) -> Kernel:
        """The body on a kind of cell; tests of one process share it."""
        source, law = (self.material, True) if self.page is None else (self.page, False)
        return load_kernel(source, cell=cell, geometry=geometry, materials=law)


@dataclass(frozen=True, eq=False)
class LawAtPoints(Law):
    """A law whose `lame` is given at the points of the quadrature."""

    def add(
        self,
        study: Study,
        name: str = "body",
        cells: str | None = None,
        *,
        again: bool = False,
        **constants: float,
    ) -> None:
        """See `Law`."""
        lame: Any = constants.get("lame", self.given["lame"])
        given: Any = {**constants, "lame": lambda x: np.full(len(x), lame)}
        super().add(study, name, cells, again=again, **given)

    @cache  # noqa: B019
    def kernel(self, cell: str, geometry: str | None) -> Kernel:
        """See `Law`."""
        moved = {"lame": "point data"}
        return load_kernel(self.page, cell=cell, geometry=geometry, varying=moved)


@dataclass(frozen=True, eq=False)
class UnitCells(Law):
    """A cell of the law at every point."""

    def add(
        self,
        study: Study,
        name: str = "body",
        cells: str | None = None,
        *,
        again: bool = False,
        **constants: float,
    ) -> None:
        """See `Law`."""
        plane = study.mesh.dimension == 2
        mesh = Mesh.rectangle(1, 1, cells=(2, 1)) if plane else Mesh.box((1, 1, 1), cells=(2, 1, 1))
        cell = Study(mesh)
        given: dict[str, Any] = dict(constants)
        super().add(cell, again=again, **given)
        pairs = [("left", "right"), ("bottom", "top"), ("front", "back")]
        study.add(name, cell=cell.periodic(*pairs[: mesh.dimension]), cells=cells)


_RUBBER = {"mu": 0.4, "lame": 0.6}
_MIXED = {"mu": 0.4, "K": 5.0}
_OGDEN = {"mu_1": 0.5, "alpha_1": 1.6, "mu_2": -0.04, "alpha_2": -2.0, "mu_3": 0.01, "alpha_3": 4.0}
_STRETCHES = np.linspace(0.4, 2.2, 19)
_WEIGHTS = initial_weights(1, (3,), convex=True, monotone=True, seed=2)
_WEIGHTS[-1][1][:] = -np.log(2.0) * _WEIGHTS[-1][0].sum()  # no energy at rest
_LEARNED = {
    **_RUBBER,
    "W": _WEIGHTS,
    "U": (_STRETCHES, (_STRETCHES - 1.0) ** 2),
}
_MODELS = Path(__file__).parents[2] / "docs" / "models"

LAWS = {
    "energy": Law(_RUBBER, pages.energy),
    "weak form": Law(_RUBBER, pages.weak_form),
    "whole element": Law(_RUBBER, pages.whole),
    "loops over points": Law(_RUBBER, pages.point),
    "product": Law(_RUBBER, pages.product),
    "points": LawAtPoints(_RUBBER, pages.energy),
    "energy of a material": Law(_RUBBER, material=pages.energy_law),
    "stress of a material": Law(_RUBBER, material=pages.stress_law),
    "local unknown": Law(_RUBBER, pages.local_stretch),
    "neo_hooke": Law({"mu": 0.4, "kappa": 0.9}, material="neo_hooke"),
    "ogden": Law({**_OGDEN, "kappa": 0.9}, material="ogden", parameter="mu_1"),
    "hooke": Law({"E": 1.0, "nu": 0.3}, material="hooke", small=True, parameter="E"),
    "learned": Law(_LEARNED, pages.learned),
    "softened": Law(
        {**_RUBBER, "share": [0.6, 0.4], "rate": [0.5, 2.0]}, material=pages.softened, history=True
    ),
    "mixed": Law(_MIXED, pages.mixed),
    "condensed": Law(_MIXED, pages.condensed),
    "taylor-hood": Law(_MIXED, pages.taylor_hood),
    "enhanced": Law(_RUBBER, str(_MODELS / "enhanced.py")),
    "split": Law({"G": 0.4, "L": 0.6}, material=pages.split, parameter="G"),
    "plastic": Law(
        {"G": 0.4, "K": 0.9, "sy": 0.02, "H": 0.1},
        material=pages.plastic,
        small=True,
        history=True,
        parameter="G",
    ),
    "unit cells": UnitCells(_RUBBER, pages.energy),
}
"""Ways to write the body."""

Ramp = Callable[[float], float]


def smooth(t: float) -> float:
    """From 0 to 1 without a jump of the velocity at either end."""
    return float(np.sin(0.5 * np.pi * min(t, 1.0)) ** 2)


def _push(study: Study, at: Problem, where: Any, axis: int, size: float) -> None:
    """A dead load along an axis of the block, which may be turned."""
    direction = at.turned(np.eye(at.dimension)[axis])
    parts = {n: float(d) for n, d in zip(at.axes, direction, strict=True) if d != 0.0}
    study.load(where, **{n: _constant(at.ramp, d * size) for n, d in parts.items()})


def _constant(ramp: Ramp, size: float) -> Callable[[Array, float], Array]:
    return lambda x, t: np.full(len(x), size * ramp(t))


def _traction(study: Study, at: Problem) -> None:
    _push(study, at, "right", 1, 0.004 * at.stress)


def _tension(study: Study, at: Problem) -> None:
    _push(study, at, "right", 0, 0.05 * at.stress)


def _pressure(study: Study, at: Problem) -> None:
    study.pressure("top", _constant(at.ramp, 0.004 * at.stress))


def _force(study: Study, at: Problem) -> None:
    _push(study, at, at.corner, 1, 0.004 * at.stress * at.length ** (at.dimension - 1))


def _weight(study: Study, at: Problem) -> None:
    size = 0.003 * at.stress / at.length
    force = size * at.turned(np.eye(at.dimension)[1])
    named = zip(at.axes, force, strict=True)
    given: Any = {f"w{name[1:]}": _grown(at.ramp, f) for name, f in named}
    (kind,) = study.mesh.cells
    products = at.solver in WITHOUT_MATRIX
    study.add("weight", _weight_kernel(kind, study.geometry, products), **given)


@cache
def _weight_kernel(cell: str, geometry: str | None, products: bool) -> Kernel:
    page = pages.offering(pages.weight) if products else pages.weight
    return load_kernel(page, cell=cell, geometry=geometry)


def _grown(ramp: Ramp, size: float) -> Callable[[float], float]:
    return lambda t: size * ramp(t)


def _prescribed(study: Study, at: Problem) -> None:
    study.fix("right", u_y=_constant(at.ramp, 0.1 * at.length))


LOADS: dict[str, Callable[[Study, Problem], None]] = {
    "traction": _traction,
    "tension": _tension,
    "pressure": _pressure,
    "force": _force,
    "weight": _weight,
    "prescribed": _prescribed,
}
"""What moves the body; each grows with `Problem.ramp` and `Problem.scale`."""


def _clamped(study: Study, at: Problem) -> None:
    """Nothing beside the left side."""


def _spring(study: Study, at: Problem) -> None:
    study.spring("right", u_y=0.02 * at.stress * at.length ** (at.dimension - 2))


def _tied(study: Study, at: Problem) -> None:
    study.tie("top", "bottom", "u_x")


def _sliding(study: Study, at: Problem) -> None:
    study.fix("bottom", u_y=0)


def _rigid(study: Study, at: Problem) -> None:
    study.rigid("right", name="grip", rotations="small" if at.properties.small else "finite")


CONSTRAINTS: dict[str, Callable[[Study, Problem], None]] = {
    "clamped": _clamped,
    "spring": _spring,
    "tied sides": _tied,
    "sliding side": _sliding,
    "rigid side": _rigid,
}
"""What holds the body, beside its left side."""

GEOMETRIES = {"plane strain": None, "axisymmetric": "axisymmetric"}
"""Name -> argument of `Study`; a body in 3-D is neither."""

DEVICE = {"emulated": "double", "mixed precision": "mixed"}
"""Solvers on an emulated device: precision of their multigrid."""

SOLVERS = ("auto", "superlu", "amg", "matrix-free", *DEVICE)
"""Values of `linear`, and solvers on a device."""

WITHOUT_MATRIX = ("matrix-free", *DEVICE)
"""Solvers for which a law must offer products."""


@dataclass(frozen=True)
class Problem:
    """One feature of each axis.

    length, stress: units. turn: angle by which block and loads are turned. radius: inner one of a
    ring.
    """

    cell: str = "quad4"
    law: str = "energy"
    load: str = "traction"
    constraint: str = "clamped"
    geometry: str = "plane strain"
    solver: str = "auto"
    analysis: str = "solve"
    length: float = 1.0
    stress: float = 1.0
    turn: float = 0.0
    radius: float = 1.0
    bodies: tuple[str, ...] = ("body",)

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return CELLS[self.cell].dimension

    @property
    def ramp(self) -> Ramp:
        """Growth of the load over load factor or time; smooth in time."""
        marches = isinstance(ANALYSES[self.analysis], March)
        return (lambda t: smooth(t / self.span)) if marches else (lambda t: t)

    @property
    def span(self) -> float:
        """Load factor or time at the end."""
        return ANALYSES[self.analysis].span

    @property
    def corner(self) -> tuple[float, ...]:
        """A place at the end of the body."""
        place = np.array(SIZE[: self.dimension])
        return tuple(self._placed(place[None])[0].tolist())

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the displacements."""
        return ("u_x", "u_y", "u_z")[: self.dimension]

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of an analysis: the linear solver."""
        if self.solver in DEVICE:
            engine = MatrixFree(device="emulated", precision=DEVICE[self.solver])
            return {"options": SolverOptions(engine=engine)}
        return {} if self.solver == "auto" else {"linear": self.solver}

    @property
    def properties(self) -> Law:
        """Of the law; with products where the solver needs them."""
        law = LAWS[self.law]
        return law.offering if self.solver in WITHOUT_MATRIX else law

    @property
    def steps(self) -> int:
        """Load steps: more where the path counts."""
        return 8 if self.properties.history else 2

    def turned(self, vector: Array) -> Array:
        """Vectors (..., dim) turned about z, and in 3-D about x."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        Q = np.eye(self.dimension)
        Q[:2, :2] = [[c, -s], [s, c]]
        if self.dimension == 3:
            Q = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ Q
        return vector if self.turn == 0.0 else np.asarray(vector @ Q.T)

    def _placed(self, x: Array) -> Array:
        if self.geometry == "axisymmetric":
            x = x + np.array([0.0, self.radius])
        return self.length * self.turned(x)

    def mesh(self) -> Mesh:
        """The block."""
        return CELLS[self.cell].mesh().map(self._placed)

    def study(self, mesh: Mesh | None = None, *, again: bool = False, **constants: float) -> Study:
        """The problem written down; on another mesh, or with other constants; again: see `Law`."""
        study = Study(self.mesh() if mesh is None else mesh, geometry=GEOMETRIES[self.geometry])
        given: Any = {**self.properties.constants(self.stress), **constants}
        self.properties.add(study, again=again, **given)
        self.hold(study)
        return study

    def hold(self, study: Study) -> None:
        """Supports and loads."""
        study.fix("left", **dict.fromkeys(self.axes, 0.0))
        CONSTRAINTS[self.constraint](study, self)
        LOADS[self.load](study, self)

    def run(self, study: Study | None = None) -> Result:
        """The state under the whole load, by the analysis; of the problem itself, once for all
        relations that begin with it or compare with it.
        """
        return _state(self) if study is None else ANALYSES[self.analysis](self, study)


@lru_cache(maxsize=8)
def _state(at: Problem) -> Result:
    return ANALYSES[at.analysis](at, at.study())


class Analysis(Protocol):
    """A way to the state under the whole load, which is there at `span`."""

    @property
    def span(self) -> float:
        """Load factor or time at the end."""

    def __call__(self, at: Problem, study: Study) -> Result:
        """The state."""


@dataclass(frozen=True)
class Steps:
    """Load steps, `factor` times as many as the problem needs; halves: in two paths."""

    factor: int = 1
    halves: bool = False
    span = 1.0

    def __call__(self, at: Problem, study: Study) -> Result:
        """See `Analysis`."""
        steps, half = self.factor * at.steps, None
        if self.halves:
            steps //= 2
            half = study.solve(steps=steps, until=0.5, record=True, **at.options)
        return study.solve(steps=steps, start=half, record=True, **at.options)


@dataclass(frozen=True)
class Follow:
    """Arc length beyond the load factor 1, and a step back to it."""

    span = 1.0

    def __call__(self, at: Problem, study: Study) -> Result:
        """See `Analysis`."""
        path = study.follow(step=2.0 / at.steps, until=lambda r: r.t > 0.6, **at.options)
        return study.solve(start=path.results[-1], **at.options)


@dataclass(frozen=True)
class March:
    """Steps in time; rho: density of the bodies, None for methods without inertia."""

    method: str
    steps: int
    span: float = 1.0
    rho: float | None = None
    tolerance: float | None = None

    def __call__(self, at: Problem, study: Study) -> Result:
        """See `Analysis`."""
        options: dict[str, Any] = dict(at.options)
        if self.rho is not None:
            bodies = at.bodies
            options["mass"] = {name: {"rho": self.rho} for name in bodies}
        else:
            options["record"] = True
        if self.tolerance is not None:
            options["tolerance"] = self.tolerance
        dt = self.span / self.steps
        *_, last = study.march(dt=dt, until=self.span, method=self.method, **options)  # type: ignore[arg-type]
        return last


ANALYSES: dict[str, Analysis] = {
    "solve": Steps(),
    "many steps": Steps(4),
    "start": Steps(halves=True),
    "follow": Follow(),
    "euler": March("euler", 8),
    "bdf2": March("bdf2", 8),
    "adaptive": March("euler", 8, tolerance=0.5),
    "newmark": March("newmark", 32, rho=FAST),
    "generalised-alpha": March("generalised-alpha", 32, rho=FAST),
    "midpoint": March("midpoint", 32, rho=FAST),
    "explicit": March("explicit", 4, 40.0, 1e-3),
}
"""Ways to a state under the whole load; all are slow enough to be static."""

AXES: dict[str, tuple[str, ...]] = {
    "cell": tuple(CELLS),
    "law": tuple(LAWS),
    "load": tuple(LOADS),
    "constraint": tuple(CONSTRAINTS),
    "geometry": tuple(GEOMETRIES),
    "solver": SOLVERS,
    "analysis": tuple(ANALYSES),
}
"""Features by axis; the first one is the default."""

ALIKE: dict[str, dict[str, tuple[str, ...]]] = {
    "cell": {
        "quad4": (),
        "quad8": ("quad9", "quad16", "quad25", "quad36", "quad49"),
        "tri6": ("tri3",),
        "hex20": ("hex8", "hex27", "hex64"),
        "tet10": ("tet4",),
        "wedge15": ("wedge6", "wedge18", "pyramid5"),
    },
    "law": {
        "energy": ("weak form", "whole element", "loops over points", "product"),
        "points": (),
        "stress of a material": (
            *("energy of a material", "neo_hooke", "ogden", "hooke", "learned", "split"),
        ),
        "plastic": ("softened", "local unknown"),
        "taylor-hood": ("mixed",),
        "condensed": ("enhanced",),
        "unit cells": (),
    },
    "load": {"traction": ("tension", "force"), "pressure": (), "weight": (), "prescribed": ()},
    "constraint": {
        "clamped": ("sliding side",),
        "spring": (),
        "tied sides": (),
        "rigid side": (),
    },
    "geometry": {"plane strain": (), "axisymmetric": ()},
    "solver": {
        "auto": ("superlu",),
        "amg": (),
        "matrix-free": (),
        "emulated": ("mixed precision",),
    },
    "analysis": {
        "solve": ("many steps",),
        "start": (),
        "follow": (),
        "bdf2": ("euler", "adaptive"),
        "generalised-alpha": ("newmark", "midpoint"),
        "explicit": (),
    },
}
"""Axis -> feature -> others that pass through the same layer of the program as it does.

Pairs of features are tried with the first of each layer. Layers: the reference cell (hexahedra,
simplices, ...), the way of a law to its C and its state (history, unknowns of elements), dead and
following loads, constraints by values, by rows and by bodies, linear solver, time scheme.
"""
