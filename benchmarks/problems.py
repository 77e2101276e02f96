"""Whole problems beside FElupe, scikit-fem and DOLFINx: `python -m benchmarks.problems PYTHON`.

PYTHON is the interpreter of an environment of its own in which those are installed (they are no
dependency of ours); what is missing there is left out. Each solves the same energy on the same
mesh in the same load steps (`benchmarks.rivals`), in a process of its own on one thread: total
time from mesh to solution, with kernels compiled and caches warm, and the least time of 30
assemblies of tangent and residual. Every answer must agree with ours.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp

from softehl import Definition, Mesh, Model, Newton, Study, element, kinematics, load_kernel
from softehl.runtime.results.result import Result
from softehl.runtime.solve.linear.direct import direct_solver

MU, K, LOAD = 0.4225, 0.9154166666666667, 1 / 16
STEPS = {"cook": 10, "block": 4}
SIZES = {"cook": 64, "block": 16}
TOOLS = ("felupe", "skfem", "dolfinx")
AGREEMENT = 1e-6
"""Of the answers, relative: the last residual of a step is 1e-8 of the first."""


@dataclass(frozen=True)
class Timing:
    """Of one tool: seconds from mesh to solution and of one assembly, iterations, the answer."""

    total: float
    assembly: float
    iterations: int
    value: float


def rubber(kind: str) -> Definition:
    """The energy of `benchmarks.rivals` on a quadrilateral in plane strain or a hexahedron."""
    cell = element(kind)
    m = Model(f"rubber_{kind}", nodes=len(cell.nodes), rule=cell.rule, unroll=kind == "quad4")
    axes = "xyz"[: cell.dimension]
    X = m.coordinates(*axes.upper())
    u = m.nodal_unknowns(*(f"u_{a}" for a in axes))
    mu, bulk = m.parameters(mu="shear modulus [MPa]", bulk="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace() + 3 - cell.dimension
    W = mu / 2 * (J ** sp.Rational(-2, 3) * I1 - 3) + bulk / 2 * (J - 1) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    m.offer(tasks=["residual", "tangent"])
    return m.finish()


def ours(problem: str, n: int) -> Timing:
    """The problem as a study."""
    kernel = load_kernel(rubber("quad4" if problem == "cook" else "hex8"))
    begin = time.perf_counter()
    if problem == "cook":
        mesh = Mesh.rectangle(48, 44, cells=(n, n)).map(
            lambda x: np.column_stack([x[:, 0], x[:, 1] + x[:, 0] / 48 * (44 - 28 / 44 * x[:, 1])])
        )
        study = Study(mesh)
        study.fix("left", u_x=0, u_y=0)
        study.load("right", u_y=LOAD)
    else:
        study = Study(Mesh.box((1, 1, 1), cells=(n, n, n)))
        study.fix("bottom", u_x=0, u_y=0, u_z=0)
        study.fix("top", u_x=0, u_y=0, u_z=-0.2)
    study.add("rubber", kernel, mu=MU, bulk=K)
    steps: list[Result] = []
    newton = Newton(linear=direct_solver("auto"), tolerance=1e-8)
    result = study.solve(steps=STEPS[problem], newton=newton, on_step=steps.append)
    total = time.perf_counter() - begin
    place, name = ((48, 60), "u_y") if problem == "cook" else ((1, 1, 0.5), "u_x")
    assemble = result.problem.assembler.linearise
    seconds = timed(lambda: assemble(result.x, result.problem.parameters))
    return Timing(total, seconds, sum(r.iterations for r in steps), result.at(place)[name])


def timed(action: Callable[[], object], rounds: int = 30) -> float:
    """Least of the seconds that it takes: the rest is other work of the machine."""
    found = []
    for _ in range(rounds):
        begin = time.perf_counter()
        action()
        found.append(time.perf_counter() - begin)
    return min(found)


def theirs(python: str, tool: str, problem: str, n: int) -> Timing | str:
    """Times of another tool; the last line of its error if it is not there."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [python, str(Path(__file__).with_name("rivals.py")), tool, problem, str(n)]
    for _ in range(2):  # the first run fills the caches of what is compiled
        done = subprocess.run(
            command, env={**os.environ, **one}, capture_output=True, text=True, check=False
        )
        if done.returncode:
            return (done.stderr.strip().splitlines() or ["?"])[-1]
    return Timing(**json.loads(done.stdout.strip().splitlines()[-1]))


def row(name: str, problem: str, found: Timing, best: Timing) -> str:
    """One line of the table."""
    cells = [
        *(problem, name, f"{1e3 * found.assembly:.1f}", f"{found.assembly / best.assembly:.1f}"),
        *(f"{found.total:.2f}", f"{found.total / best.total:.1f}", str(found.iterations)),
    ]
    return "| " + " | ".join([*cells, f"{found.value:.8f}"]) + " |"


def main(python: str, sizes: dict[str, int]) -> int:
    """Print the table; 1 where answers differ."""
    print("| problem | tool | assembly [ms] | ratio | whole [s] | ratio | iterations | answer |")
    print("|---|---|---|---|---|---|---|---|")
    wrong = 0
    for problem, n in sizes.items():
        best = ours(problem, n)
        print(row("softehl", problem, best, best), flush=True)
        for tool in TOOLS:
            found = theirs(python, tool, problem, n)
            if isinstance(found, str):
                print(f"{tool} is left out: {found}", file=sys.stderr)
                continue
            wrong += abs(found.value / best.value - 1) > AGREEMENT
            print(row(tool, problem, found, best), flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    sys.exit(main(sys.argv[1], SIZES))
