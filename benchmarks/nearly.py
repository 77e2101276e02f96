"""A nearly incompressible block by three solvers: `python -m benchmarks.nearly SOLVER N`.

A cube of N^3 hexahedra of order 2, lambda / mu = 1000, is held at its lower face and pushed
sideways at its upper one, in one step. SOLVER is `matrix-free`, `amg` (pyamg on the assembled
tangent) or `gamg` (PETSc's on the assembled one; needs petsc4py). Conjugate gradients end at 1e-4
of the right side; `amg` may take 1000 iterations, where it stops at 150 by itself. Prints a line
of a table: unknowns, processor seconds and seconds from mesh to solution with kernels compiled,
Newton steps, iterations of each linear solution, GB, answer.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import time
from collections.abc import Sequence
from typing import Any

import sympy as sp

import softehl
from softehl import Mesh, Study
from softehl.runtime.parallel.matrix_free import TOLERANCE, MatrixFree

LOAD, RATIO = 0.005, 1000


@softehl.page
def block(m: Any) -> None:
    """Compressible neo-Hooke."""
    u = m.vector("u")
    mu, lam = m.parameters(mu="shear modulus [MPa]", lam="Lame's constant [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    volume = lam / 4 * (J**2 - 1 - 2 * sp.log(J))
    m.minimise(mu / 2 * ((F.T * F).trace() - 3) - mu * sp.log(J) + volume)
    m.offer(product=True)


def solved(n: int, solver: str) -> tuple[Any, list[int]]:
    """The result, and iterations of every linear solution."""
    study = Study(Mesh.box((1, 1, 1), cells=(n, n, n), order=2))
    study.add("body", block, mu=1.0, lam=float(RATIO))
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.load("top", u_x=LOAD)
    if solver == "matrix-free":
        engine = MatrixFree()
        return study.solve(engine=engine), engine.iterations
    counts: list[int] = []
    if solver == "gamg":
        from softehl.runtime.parallel import petsc, petsc_matrix

        _count(petsc_matrix.PetscSolver, "solve", counts, lambda self, _: self.times.iterations)
        options = {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": TOLERANCE}
        result = study.solve(engine=petsc.Petsc(options))
        return result, [b - a for a, b in zip([0, *counts], counts, strict=False)]
    from softehl.runtime.solve.linear import amg

    _count(amg.AmgFactors, "_solved", counts, lambda _, found: found[1] - 1)
    plain = amg.AlgebraicMultigrid.factorise

    def patient(self: Any, K: Any) -> Any:
        self.tolerance, self.most = TOLERANCE, MatrixFree().most
        return plain(self, K)

    amg.AlgebraicMultigrid.factorise = patient  # type: ignore[method-assign]
    return study.solve(linear="amg"), counts


def _count(owner: Any, name: str, counts: list[int], number: Any) -> None:
    plain = getattr(owner, name)

    def counted(self: Any, *given: Any, **named: Any) -> Any:
        found = plain(self, *given, **named)
        counts.append(number(self, found))
        return found

    setattr(owner, name, counted)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.nearly", description=__doc__)
    parser.add_argument("solver", choices=("matrix-free", "amg", "gamg"))
    parser.add_argument("n", type=int, help="cells along an edge")
    parser.add_argument("--seconds", type=int, help="processor seconds it may take")
    given = parser.parse_args(arguments)
    unknowns = 3 * (2 * given.n + 1) ** 3
    solved(1, given.solver)  # derives and compiles, which is not counted
    if given.seconds:
        signal.signal(signal.SIGXCPU, lambda *_: os._exit(1))
        limit = int(time.process_time()) + given.seconds
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
    begin, began = time.process_time(), time.perf_counter()
    result, counts = solved(given.n, given.solver)
    spent, waited = time.process_time() - begin, time.perf_counter() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    told = ", ".join(map(str, counts))
    row = [unknowns, given.solver, f"{spent:.1f}", f"{waited:.1f}", result.iterations, told]
    row += [f"{memory:.2f}", f"{result.at((1, 1, 1))['u_x']:.8f}"]
    print(f"| {' | '.join(map(str, row))} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
