"""Problems for any engine and any number of processes, and what is compared of their results.

    mpiexec -n 2 python -m tests.mpi.problems ENGINE FOLDER NAME...

prints a JSON object on process 0, with an entry for each problem; a single problem has its files in
FOLDER, several have a folder each there.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

import softehl
from softehl import Mesh, Study
from softehl.codegen.language.fields import Fields
from softehl.runtime.analyses.motion import Motion
from softehl.runtime.analyses.time_integrators import INTEGRATORS
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.loads import Amount
from softehl.runtime.parallel.petsc import Petsc
from softehl.runtime.results.result import Result

DOCS = Path(__file__).parents[2] / "docs"
OGDEN: dict[str, Any] = {"mu_1": 0.63, "mu_2": -0.01, "alpha_1": 1.3, "alpha_2": -2.0, "lame": 20.0}
STEEL: dict[str, Any] = {"G": 80193.8, "K": 164206.0, "sy": 450.0, "H": 20000.0}


def cube(n: int) -> Study:
    """n^3 Ogden hexahedra whose top is lifted by 0.3 and turned by 0.6."""
    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[c - 1, -s, 0.0], [s, c - 1, 0.0], [0.0, 0.0, 0.0]])

    def top(axis: int) -> Callable[[Array, float], Array]:
        lift = [0.0, 0.0, 0.3][axis]
        return lambda x, t: np.asarray(t * ((x - [0.5, 0.5, 1.0]) @ turn[axis] + lift))

    study = Study(Mesh.box((1, 1, 1), cells=(n, n, n)))
    study.add("cube", DOCS / "models" / "ogden.py", **OGDEN)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_x=top(0), u_y=top(1), u_z=top(2))
    return study


def contact() -> Study:
    """A ring of the shipped rubber pressed onto a plane by its own contact page."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(16, 8)).map(lambda x: x + np.array([0.05, 10.0])))
    study.add("body", "solid_q4", mu_1=1.0, mu_2=0.2, kappa=200.0)
    wall: dict[str, Any] = {"n_z": 1.0, "n_r": 0.0, "c": 0.0, "area": 8.0, "rho": 10.0}
    study.add("wall", "contact", on="left", offset=0.0, force_weight=1.0, **wall)
    study.fix("right", u_z=-0.3, u_r=0)
    return study


def tied() -> Study:
    """A sheared strip whose sides are tied, on springs, with loads on a side and at a node."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(12, 6)).map(lambda x: x + np.array([0.0, 5.0])))
    study.add("body", "solid_q4", mu_1=1.0, mu_2=0.2, kappa=50.0)
    study.tie("left", "right", "u_z", "u_r")
    study.spring("bottom", u_r=40.0)
    study.fix((0.0, 5.0), u_z=0.0)
    study.pressure("top", lambda x, t: 0.05 * t * x[:, 0], of=("u_z", "u_r"))
    study.load("top", u_r=0.2, u_z=lambda x, t: 0.1 * t * x[:, 0])
    study.load((1.0, 6.0), u_r=-0.5)
    return study


def yielding(pull: Amount = 0.2) -> Study:
    """A strip with a hole of a metal that hardens: points remember plastic strain."""

    def quarter(x: Array) -> Array:
        angle, far = x[:, 1] * np.pi / 2, np.column_stack([1 - x[:, 1], x[:, 1]])
        inner = 5.0 * np.column_stack([np.cos(angle), np.sin(angle)])
        return inner + x[:, :1] * (np.minimum(1, 2 * far) * [10.0, 18.0] - inner)

    mesh = Mesh.rectangle(1, 1, cells=(4, 8), shape="serendipity", order=2).map(quarter)
    study = Study(mesh.with_side("end", lambda x: x[:, 1] > 18.0 - 1e-9))
    study.add("steel", DOCS / "gallery" / "models" / "j2.py", **STEEL)
    study.fix("bottom", u_y=0)
    study.fix("top", u_x=0)
    study.fix("end", u_y=pull)
    return study


@softehl.page
def rubber(m: Fields) -> None:
    """Compressible neo-Hooke with products."""
    u = m.vector("u")
    mu, lam = m.parameters(mu="shear modulus [MPa]", lam="Lame's constant [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3) - mu * sp.log(J))
    m.minimise(lam / 4 * (J**2 - 1 - 2 * sp.log(J)))
    m.fields(J=J)
    m.offer(product=True)


def pushed() -> Study:
    """A block of order 2 that is held below, lowered and pushed above, on springs."""
    mesh = Mesh.box((1, 1, 1), cells=(3, 2, 3), order=2)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(3 * x[:, ::-1])))
    study.add("body", rubber, mu=1.0, lam=8.0)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_z=-0.02)
    study.load("top", u_x=0.02)
    study.spring("back", u_y=0.1)
    return study


def warm(cells: int = 40) -> Study:
    """Heat in a bar: rates, and values of steps before."""
    study = Study(Mesh.line(1.0, cells=cells))
    study.add("bar", DOCS / "models" / "heat.py", k=1.0, c=1.0)
    study.start(T=lambda x: np.sin(np.pi * x[:, 0]))
    study.fix("left", T=0)
    study.fix("right", T=0)
    return study


@softehl.page
def moving(m: Fields) -> None:
    """Compressible neo-Hooke with its inertia."""
    u = m.vector("u")
    rho, mu, lam = m.parameters(rho="density", mu="shear modulus", lam="Lame's constant")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3) - mu * sp.log(J) + lam / 2 * sp.log(J) ** 2)
    m.weak(rho * m.rate(u, order=2), u)


@softehl.page
def mixed(m: Fields) -> None:
    """Neo-Hooke with a pressure of lower order."""
    u, p = m.vector("u"), m.scalar("p", order=1)
    mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * K))


def swinging(method: str, engine: Any) -> dict[str, float]:
    """A tied strip on springs that is thrown and pressed, and a beam with inertia of its page."""
    push: dict[str, Any] = {"u_r": lambda x: 0.3 * (x[:, 1] - 5.0)}
    rho = np.linspace(0.5, 1.5, 72)
    mass = {"body": {"rho": rho, "of": ["u_z", "u_r"]}}
    given: dict[str, Any] = {"method": method, "engine": engine}
    *_, strip = tied().march(dt=0.1, until=0.3, mass=mass, velocity=push, **given)
    study = Study(Mesh.rectangle(4.0, 1.0, cells=(6, 2)))
    study.add("body", moving, rho=1.0, mu=1.0, lam=2.0)
    study.fix("left", u_x=0, u_y=lambda x, t: np.full(len(x), 0.01 * t + 0.02 * t**2))
    *_, beam = study.march(dt=0.2, until=0.6, velocity={"u_y": lambda x: 0.02 * x[:, 0]}, **given)
    *_, beam = study.march(dt=0.2, until=1.0, start=beam, **given)
    found: dict[str, float] = {}
    for name, result in (("strip", strip), ("beam", beam)):
        assert isinstance(result, Motion)
        kinds = numbers(result, "body")
        known = list(result.system.everywhere.numbering.nodal)
        rates = {n: float(np.abs(result.velocity(n)).sum()) for n in known}
        rates |= {f"{n}, second": float(np.abs(result.acceleration(n)).sum()) for n in known}
        every = {**kinds, **rates, **result.energy}
        if method == "explicit":
            every["stable"] = result.stable_step
        found |= {f"{method}, {name}, {key}": value for key, value in every.items()}
    return found


def column() -> Study:
    """A slender column with a pressure of lower order, pressed at its end."""
    study = Study(Mesh.rectangle(10.0, 1.0, cells=(10, 2), order=2))
    study.add("body", mixed, mu=1.0, K=50.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=-1.0)
    return study


def vibrating(engine: Any) -> dict[str, float]:
    """Modes of a body on springs, of one that is tied, of a loaded one with pressures as unknowns;
    and linear buckling of this.
    """
    free = Study(Mesh.rectangle(3.0, 1.0, cells=(9, 3)))
    free.add("body", moving, rho=1.0, mu=1.0, lam=2.0)
    free.spring("left", u_x=1e-3, u_y=2e-3)
    strip, slender = tied().solve(until=0.0, engine=engine), column()
    pressed = slender.solve(until=0.002, engine=engine)
    told = {
        "free": free.solve(until=0.0, engine=engine).modes(4),
        "strip": strip.modes(4, mass={"body": {"rho": 1.0, "of": ["u_z", "u_r"]}}),
        "pressed": pressed.modes(3, mass={"body": {"rho": 2.0}}),
    }
    found = {"force": 1.0}
    for name, modes in told.items():
        found |= {f"{name} {k}": float(w) for k, w in enumerate(modes.squares)}
        found |= {f"{name} {k}, shape": float(np.abs(s.x).sum()) for k, s in enumerate(modes)}
    buckling = slender.buckling(2, start=pressed, engine=engine)
    found |= {f"factor {k}": float(f) for k, f in enumerate(buckling.factors)}
    shapes = enumerate(buckling.shapes)
    return {**found, **{f"factor {k}, shape": float(np.abs(s.x).sum()) for k, s in shapes}}


def condensed() -> Study:
    """A cantilever of enhanced quadrilaterals, whose modes are unknowns of single elements."""
    mesh = Mesh.rectangle(4.0, 1.0, cells=(10, 4)).map(_skewed)
    study = Study(mesh)
    study.add("body", DOCS / "models" / "enhanced.py", mu=1.0, lame=30.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=0.01)
    return study


def thick(cells: int, *, spread: bool = False) -> Study:
    """A cube of enhanced hexahedra, held on one side and loaded on the other."""
    study = Study(Mesh.box((1, 1, 1), cells=(cells,) * 3, spread=spread))
    study.add("body", DOCS / "models" / "enhanced.py", mu=1.0, lame=1.5)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.load("right", u_y=0.05)
    return study


def jumps() -> Study:
    """Poisson's equation on cells that share no nodes, by interior penalty and Nitsche's method."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(9, 7)).split())
    file = DOCS / "models" / "interior_penalty.py"
    study.add("body", file, model="poisson")
    study.add("facets", file, model="facets", on="interior", gamma=10)
    for side in ("left", "right", "bottom", "top"):
        study.add(side, file, model="facets", on=side, gamma=10)
    return study


def _skewed(x: Array) -> Array:
    return np.column_stack([x[:, 0] + 0.1 * np.sin(3 * x[:, 1]), x[:, 1] + 0.05 * x[:, 0]])


def numbers(result: Result, block: str) -> dict[str, Any]:
    """What is compared: norm and largest unknown, iterations, sums of fields and reactions."""
    known = result.system.everywhere.blocks[block].kernel.fields
    fields = result.fields(block) if known else {}
    side = "bottom" if "bottom" in result.system.mesh.sides else "left"
    return {
        "norm": result.norm(),
        "largest": float(np.abs(result.x).max()),
        "t": result.t,
        "iterations": result.iterations,
        **{f"field {name}": float(np.abs(values).sum()) for name, values in fields.items()},
        **{f"force {name}": value for name, value in result.reaction(side).items()},
        **{f"state {name}": float(np.abs(v).sum()) for name, v in result.state.items()},
    }


def solved(name: str, engine: Any, folder: Path) -> dict[str, Any]:
    """A problem by name, solved."""
    if name.startswith("cube"):
        return numbers(cube(int(name[4:])).solve(steps=10, engine=engine), "cube")
    if name in ("contact", "tied"):
        study = contact() if name == "contact" else tied()
        result = study.solve(steps=4, engine=engine, progress=True)
        for file in ("whole.vtu", "parts.pvtu"):
            result.write(folder / file)
        return numbers(result, "body")
    if name in ("condensed", "jumps"):
        return numbers(
            {"condensed": condensed, "jumps": jumps}[name]().solve(engine=engine), "body"
        )
    if name == "yielding":
        study = yielding()
        half = study.solve(steps=10, until=0.5, engine=engine)
        return numbers(study.solve(steps=10, start=half, engine=engine), "steel")
    if name == "adaptive":
        path = list(warm().march(dt=1e-3, until=0.1, tolerance=1e-3, engine=engine))
        return numbers(path[-1], "bar")
    if name == "pushed":
        if engine == "petsc":
            engine = Petsc({"ksp_rtol": 1e-10}, matrix_free=True)
        result = pushed().solve(engine=engine)
        krylov = engine.times.iterations if isinstance(engine, Petsc) else 0
        return {**numbers(result, "body"), "krylov": krylov}
    if name == "vibrating":
        return vibrating(engine)
    if name == "swinging":
        return {
            k: v for method in list(INTEGRATORS)[2:] for k, v in swinging(method, engine).items()
        }
    if name in ("march", "restart", "slow"):
        return _marched(name, engine, folder)
    if name == "split":
        return numbers(contact().solve(steps=4, engine=Petsc(SPLIT)), "body")
    if name in ("gamg", "thick"):
        if engine == "petsc":
            engine = Petsc({"ksp_type": "gmres", "pc_type": "gamg", "ksp_rtol": 1e-10})
        thin, block = (cube(4), "cube") if name == "gamg" else (thick(4), "body")
        result = thin.solve(steps=10 if name == "gamg" else 1, engine=engine)
        krylov = engine.times.iterations if isinstance(engine, Petsc) else 0
        return {**numbers(result, block), "krylov": krylov}
    study = FAILING[name]()
    return numbers(study.solve(engine=engine), "cube")


def _marched(name: str, engine: Any, folder: Path) -> dict[str, Any]:
    file = folder / "march.npz"
    restart = file if name == "restart" else None
    in_time = yielding(lambda x, t: np.full(len(x), 0.2 * t))
    path = in_time.march(
        dt=0.05, until=1.0, checkpoint=file, restart=restart, engine=engine, progress=True
    )
    results = []
    for result in path:
        results.append(result)
        time.sleep(0.3 if name == "slow" else 0.0)
    return numbers(results[-1], "steel")


def one_fails() -> Study:
    """A support that fails on the last process alone."""

    def value(x: Array, t: float) -> Array:
        if t > 0 and _rank() == _ranks() - 1:
            raise ValueError("no value for the support")
        return np.zeros(len(x))

    study = cube(2)
    study.fix("bottom", u_x=value)
    return study


def all_fail() -> Study:
    """A cube that nothing holds."""
    study = Study(Mesh.box((1, 1, 1), cells=(2, 2, 2)))
    study.add("cube", DOCS / "models" / "ogden.py", **OGDEN)
    study.fix("bottom", u_z=0)
    study.load("top", u_x=0.1)
    return study


def misspelt() -> Study:
    """A side that is not there."""
    study = cube(2)
    study.fix("ceiling", u_z=0)
    return study


SPLIT = {
    "ksp_type": "fgmres",
    "ksp_rtol": 1e-10,
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "full",
    "fieldsplit_u_ksp_type": "preonly",
    "fieldsplit_u_pc_type": "lu",
    "fieldsplit_u_pc_factor_mat_solver_type": "mumps",
    "fieldsplit_lambda_ksp_type": "gmres",
    "fieldsplit_lambda_ksp_rtol": 1e-10,
    "fieldsplit_lambda_pc_type": "none",
}
"""The displacements of `contact` by factors, its multipliers on the Schur complement."""
FAILING = {"one fails": one_fails, "all fail": all_fail, "misspelt": misspelt}


def _ranks() -> int:
    from softehl.runtime.mpi import world

    return int(world().size)


def _rank() -> int:
    from softehl.runtime.mpi import world

    return int(world().rank)


def main() -> None:
    engine, place, *names = sys.argv[1:]
    alone = engine == "serial"
    found = {}
    for name in names:
        folder = Path(place) / (name if len(names) > 1 else "")
        folder.mkdir(exist_ok=True)
        found[name] = solved(name, engine, folder)
    if alone or _rank() == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
