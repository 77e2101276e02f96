"""A large block by multigrid, beside DOLFINx with PETSc: `python -m benchmarks.large PYTHON [N]`.

A cube of N^3 neo-Hookean hexahedra (40: 206 763 unknowns), clamped on one side and sheared by a
load on the other, in one step. PYTHON is the interpreter of an environment with DOLFINx (see
`benchmarks.problems`). Each tool runs twice, in a process of its own on one thread, kernels
compiled: processor seconds from mesh to solution and of its parts, largest memory, iterations of
Newton's method and of conjugate gradients to 1e-6, which multigrid preconditions that is told of
the rigid-body motions; the last ones of ours look whether the state is stable. This file is run by
both interpreters: nothing is imported before a tool is known.
"""

import json
import os
import resource
import subprocess
import sys
import time

MU, K, LOAD = 0.4225, 0.9154166666666667, 0.02
NEWTON, LINEAR = 1e-8, 1e-6
AGREEMENT = 1e-6
SCRIPT = os.path.abspath(__file__)
ONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
PARTS = ("assembly", "setup", "solution")


class Clock:
    """Seconds spent in each part; what a part does inside of another one counts once."""

    def __init__(self):
        self.spent = dict.fromkeys(PARTS, 0.0)

    def run(self, part, action, *given, **named):
        begin, others = time.process_time(), sum(self.spent.values())
        found = action(*given, **named)
        inside = sum(self.spent.values()) - others
        self.spent[part] += time.process_time() - begin - inside
        return found


def softehl(n, clock):
    """The block as a study; parts are timed where Newton's method asks for them."""
    from softehl import Mesh, Study
    from softehl.runtime.discretisation.problem import Problem
    from softehl.runtime.solve.linear import amg

    krylov = []

    def timed(owner, name, part):
        plain = getattr(owner, name)
        setattr(owner, name, lambda *a, **k: clock.run(part, plain, *a, **k))

    def counted(self, method, b, plain=amg.AmgFactors._solved):
        found = plain(self, method, b)
        krylov.append(found[1] - 1)
        return found

    amg.AmgFactors._solved = counted
    timed(Problem, "linearise", "assembly")
    timed(Problem, "measure", "assembly")
    timed(amg.AlgebraicMultigrid, "factorise", "setup")
    timed(amg, "hierarchy", "setup")
    timed(amg.AmgFactors, "_solved", "solution")

    def block(n):
        study = Study(Mesh.box((1, 1, 1), cells=(n, n, n)))
        study.add("rubber", material="neo_hooke", mu=MU, kappa=K)
        study.fix("left", u_x=0, u_y=0, u_z=0)
        study.load("right", u_y=LOAD)
        return study

    block(1)  # derives and compiles, which is not counted
    begin = time.process_time()
    result = block(n).solve(linear="amg")
    total = time.process_time() - begin
    return total, result.iterations, krylov, result.at((1, 1, 1))["u_y"]


def dolfinx(n, clock):
    """The block in UFL, conjugate gradients with GAMG."""
    import dolfinx_solver  # noqa: F401 - loads MPI first
    import numpy as np
    import ufl
    from dolfinx import fem, mesh
    from dolfinx.fem import petsc
    from mpi4py import MPI
    from petsc4py import PETSc

    begin = time.process_time()
    domain = mesh.create_box(MPI.COMM_SELF, [[0] * 3, [1] * 3], [n] * 3, mesh.CellType.hexahedron)
    V = fem.functionspace(domain, ("Lagrange", 1, (3,)))
    u, x = fem.Function(V), V.tabulate_dof_coordinates()
    F = ufl.Identity(3) + ufl.grad(u)
    J, I1 = ufl.det(F), ufl.tr(F.T * F)
    W = MU / 2 * (J ** (-2 / 3) * I1 - 3) + K / 4 * (J**2 - 1 - 2 * ufl.ln(J))
    right = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[0], 1))
    sides = mesh.meshtags(domain, 2, np.sort(right), np.ones(len(right), dtype=np.int32))
    ds = ufl.Measure("ds", domain, subdomain_data=sides)
    Pi = W * ufl.dx(metadata={"quadrature_degree": 3}) - LOAD * u[1] * ds(1)
    first = ufl.derivative(Pi, u, ufl.TestFunction(V))
    given = {"jit_options": {"cffi_extra_compile_args": ["-O3", "-march=native"]}}
    r = fem.form(first, **given)
    a = fem.form(ufl.derivative(first, u, ufl.TrialFunction(V)), **given)
    held = fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], 0))
    bcs = [fem.dirichletbc(np.zeros(3), held, V)]
    A, b = petsc.create_matrix(a), petsc.create_vector(V)
    near = rigid(np, PETSc, A, x)
    ksp = solver(PETSc, A)

    def assemble():
        A.zeroEntries()
        petsc.assemble_matrix(A, a, bcs=bcs)
        A.assemble()
        A.setNearNullSpace(near)

    def residual():
        b.array[:] = 0
        petsc.assemble_vector(b, r)
        b.array.reshape(-1, 3)[held] = 0
        return np.linalg.norm(b.array)

    size = start = clock.run("assembly", residual)
    krylov, step = [], b.duplicate()
    while size > NEWTON * start:
        clock.run("assembly", assemble)
        clock.run("setup", ksp.setUp)
        clock.run("solution", ksp.solve, b, step)
        krylov.append(ksp.getIterationNumber())
        u.x.array[:] -= step.array
        size = clock.run("assembly", residual)
    total = time.process_time() - begin
    corner = int(np.abs(x - 1).sum(axis=1).argmin())
    return total, len(krylov), krylov, float(u.x.array[3 * corner + 1])


def solver(PETSc, A):
    """Conjugate gradients with GAMG as PETSc has it."""
    options = PETSc.Options()
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.setTolerances(rtol=LINEAR)
    ksp.getPC().setType("gamg")
    for text in os.environ.get("GAMG", "").split():
        name, _, value = text.partition("=")
        options[name] = value
    ksp.setFromOptions()
    return ksp


def rigid(np, PETSc, A, x):
    """The six rigid-body motions of nodes x (n, 3)."""
    motions = np.zeros((6, len(x), 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        motions[i, :, i] = 1
        motions[3 + i, :, j], motions[3 + i, :, k] = -x[:, k], x[:, j]
    flat = np.linalg.qr(motions.reshape(6, -1).T)[0].T
    vectors = []
    for values in flat:
        vector = A.createVecRight()
        vector.array[:] = values
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors)


def one(tool, n):
    """Run a tool and print what was found, as JSON."""
    clock = Clock()
    total, newton, krylov, answer = {"softehl": softehl, "dolfinx": dolfinx}[tool](n, clock)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    found = {"total": total, **clock.spent, "memory": memory, "newton": newton}
    print(json.dumps({**found, "krylov": krylov, "answer": answer}))


def row(tool, found):
    """One line of the table."""
    seconds = [f"{found[name]:.1f}" for name in ("total", *PARTS)]
    krylov = "+".join(map(str, found["krylov"]))
    cells = [*seconds, f"{found['memory']:.2f}", str(found["newton"]), krylov]
    return f"| {tool} | " + " | ".join([*cells, f"{found['answer']:.8f}"]) + " |"


def main(python, n):
    """Print the table; 1 where answers differ."""
    load = os.getloadavg()[0]
    print(f"{n}^3 hexahedra, {3 * (n + 1) ** 3} unknowns, load {load:.1f}")
    print("| tool | whole [s] | assembly | setup | solution | memory [GB] | Newton | CG | answer |")
    print("|---|---|---|---|---|---|---|---|---|")
    answers = []
    for tool, interpreter in (("softehl", sys.executable), ("dolfinx", python)) * 2:
        command = [interpreter, SCRIPT, "--one", tool, str(n)]
        done = subprocess.run(
            command, env={**os.environ, **ONE}, capture_output=True, text=True, check=False
        )
        if done.returncode:
            print(f"{tool} is left out: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            continue
        found = json.loads(done.stdout.strip().splitlines()[-1])
        answers.append(found["answer"])
        print(row(tool, found), flush=True)
    return int(max(answers) - min(answers) > AGREEMENT * abs(answers[0]))


if __name__ == "__main__":
    if sys.argv[1] == "--one":
        one(sys.argv[2], int(sys.argv[3]))
    else:
        sys.exit(main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 40))
