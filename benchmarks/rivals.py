"""Cook's membrane and a squeezed block by FElupe, scikit-fem, DOLFINx: see `benchmarks.problems`.

Run in an environment of its own, where these packages are: `python rivals.py TOOL PROBLEM N`
prints one line of JSON. Nothing of softehl is imported here. All solve the same energy,
mu / 2 (J^(-2/3) I1 - 3) + K / 2 (J - 1)^2, on the same mesh in the same load steps, until the
residual of the free unknowns is below 1e-8 of that of the first iterate of the step.
"""

import json
import sys
import time

import numpy as np

MU, K, LOAD = 0.4225, 0.9154166666666667, 1 / 16
STEPS = {"cook": 10, "block": 4}
TOLERANCE = 1e-8
PACKAGES = {
    "felupe": ("felupe", "scipy.sparse.linalg"),
    "skfem": ("skfem", "scipy.sparse.linalg"),
    "dolfinx": ("dolfinx.fem.petsc", "ufl"),
}


def tapered(x):
    y = x[1] + x[0] / 48 * (44 - 28 / 44 * x[1])
    return np.array([x[0], y, *x[2:]])


def newton(assemble, solve, u, free):
    """Iterations of one load step; assemble(u) -> (K, r), solve(K, r) -> correction."""
    first = None
    for iteration in range(30):
        matrix, r = assemble(u)
        size = np.linalg.norm(r[free])
        first = size if first is None else first
        if iteration and size <= TOLERANCE * first:
            return iteration
        u -= solve(matrix, r)
    raise RuntimeError("no convergence")


def timed(action, rounds=30):
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        action()
        found.append(time.perf_counter() - start)
    return min(found)


def free_solver(free):
    """Correction of the free unknowns by SciPy's direct solver."""
    from scipy.sparse.linalg import spsolve

    def solve(matrix, r):
        du = np.zeros(len(r))
        du[free] = spsolve(matrix.tocsr()[free][:, free].tocsc(), r[free])
        return du

    return solve


def path(problem, u, fixed, values, force, assemble, solve):
    """All load steps; returns the iterations."""
    free = np.setdiff1d(np.arange(len(u)), fixed)
    total = 0
    for step in range(1, STEPS[problem] + 1):
        t = step / STEPS[problem]
        u[fixed] = t * values

        def at(x, t=t):
            matrix, r = assemble(x)
            return matrix, r - t * force

        total += newton(at, solve(free), u, free)
    return total


def supports(problem, x, dim):
    """Numbers and final values of prescribed unknowns, node by node; x (dim, nodes)."""
    fixed, values = [], []
    if problem == "cook":
        sides = [(np.flatnonzero(x[0] < 1e-9), np.zeros(dim))]
    else:
        sides = [
            (np.flatnonzero(x[2] < 1e-9), np.zeros(dim)),
            (np.flatnonzero(x[2] > 1 - 1e-9), np.array([0, 0, -0.2])),
        ]
    for nodes, value in sides:
        for c in range(dim):
            fixed += [dim * nodes + c]
            values += [np.full(len(nodes), value[c])]
    return np.concatenate(fixed), np.concatenate(values)


def dead_load(x, dim, right):
    """Nodal forces of a vertical load on the edge x = 48, whose nodes are equally far apart."""
    force = np.zeros(dim * x.shape[1])
    order = right[np.argsort(x[1, right])]
    share = np.full(len(order), 16 / (len(order) - 1))
    share[[0, -1]] /= 2
    force[dim * order + 1] = LOAD * share
    return force


def probe(problem, x):
    """The node and component that are compared."""
    place = (48, 60) if problem == "cook" else (1, 1, 0.5)
    distance = np.linalg.norm(x.T - np.array(place), axis=1)
    return int(distance.argmin()), 1 if problem == "cook" else 0


def felupe(problem, n):
    import felupe as fem

    if problem == "cook":
        mesh = fem.Rectangle(b=(48, 44), n=n + 1)
        mesh.update(points=tapered(mesh.points.T).T)
        field = fem.FieldContainer([fem.FieldPlaneStrain(fem.RegionQuad(mesh), dim=2)])
    else:
        mesh = fem.Cube(n=n + 1)
        field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
    x, dim = mesh.points.T, mesh.dim
    body = fem.SolidBody(fem.NeoHooke(mu=MU, bulk=K), field)
    right = np.flatnonzero(x[0] > 48 - 1e-9)
    force = dead_load(x, dim, right) if problem == "cook" else np.zeros(x.size)
    u = field[0].values.ravel()

    def assemble(values):
        field[0].values[:] = values.reshape(-1, dim)
        matrix = body.assemble.matrix(field)
        return matrix, body.assemble.vector(field).toarray().ravel()

    return x, u.copy(), force, assemble, free_solver


def skfem(problem, n):
    import skfem as fem

    if problem == "cook":
        ticks = np.linspace(0, 48, n + 1), np.linspace(0, 44, n + 1)
        mesh = fem.MeshQuad.init_tensor(*ticks)
        mesh = fem.MeshQuad(tapered(mesh.p), mesh.t)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=3)
    else:
        mesh = fem.MeshHex.init_tensor(*(np.linspace(0, 1, n + 1),) * 3)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=3)
    x, dim = mesh.p, mesh.dim()
    one = np.eye(dim)[:, :, None, None]

    def kinematics(w):
        F = w["u"].grad + one
        J = np.linalg.det(np.moveaxis(F, (0, 1), (2, 3)))
        G = np.moveaxis(np.linalg.inv(np.moveaxis(F, (0, 1), (2, 3))), (2, 3), (1, 0))
        I1 = np.einsum("ij...,ij...", F, F) + (3 - dim)
        return F, G, J, I1, MU * J ** (-2 / 3)

    @fem.LinearForm
    def residual(v, w):
        F, G, J, I1, m = kinematics(w)
        P = m * (F - I1 / 3 * G) + K * (J - 1) * J * G
        return np.einsum("ij...,ij...", P, v.grad)

    @fem.BilinearForm
    def tangent(u, v, w):
        F, G, J, I1, m = kinematics(w)
        du, dv = u.grad, v.grad
        Fu, Fv, Gu, Gv = (np.einsum("ij...,ij...", a, b) for a in (F, G) for b in (du, dv))
        turn = np.einsum("kj...,ij...,il...,kl...->...", du, G, dv, G, optimize=True)
        flat = np.einsum("ij...,ij...", du, dv)
        iso = m * (flat - 2 / 3 * (Fu * Gv + Gu * Fv) + 2 / 9 * I1 * Gu * Gv + I1 / 3 * turn)
        return iso + K * ((2 * J - 1) * J * Gu * Gv - (J - 1) * J * turn)

    order = basis.nodal_dofs.T.ravel()  # node by node
    back = np.argsort(order)
    right = np.flatnonzero(x[0] > 48 - 1e-9)
    force = dead_load(x, dim, right) if problem == "cook" else np.zeros(x.size)

    def assemble(values):
        w = basis.interpolate(values[back])
        matrix = tangent.assemble(basis, u=w)
        return matrix.tocsr()[order][:, order], residual.assemble(basis, u=w)[order]

    return x, np.zeros(x.size), force, assemble, free_solver


def dolfinx(problem, n):
    import ufl
    from dolfinx import fem, mesh
    from dolfinx.fem import petsc
    from mpi4py import MPI
    from petsc4py import PETSc

    if problem == "cook":
        corners = [[0, 0], [48, 44]]
        cell = mesh.CellType.quadrilateral
        domain = mesh.create_rectangle(MPI.COMM_SELF, corners, [n, n], cell)
        domain.geometry.x[:, :2] = tapered(domain.geometry.x[:, :2].T).T
    else:
        cell = mesh.CellType.hexahedron
        domain = mesh.create_box(MPI.COMM_SELF, [[0] * 3, [1] * 3], [n] * 3, cell)
    dim = domain.geometry.dim
    V = fem.functionspace(domain, ("Lagrange", 1, (dim,)))
    x = V.tabulate_dof_coordinates()[:, :dim].T
    u = fem.Function(V)
    F = ufl.Identity(dim) + ufl.grad(u)
    J, I1 = ufl.det(F), ufl.tr(F.T * F) + (3 - dim)
    W = MU / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2
    dx = ufl.dx(metadata={"quadrature_degree": 3})
    first = ufl.derivative(W * dx, u, ufl.TestFunction(V))
    options = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
    r = fem.form(first, jit_options=options)
    a = fem.form(ufl.derivative(first, u, ufl.TrialFunction(V)), jit_options=options)
    matrix, vector = petsc.create_matrix(a), fem.create_vector(V)
    right = np.flatnonzero(x[0] > 48 - 1e-9)
    force = dead_load(x, dim, right) if problem == "cook" else np.zeros(x.size)

    def assemble(values):
        u.x.array[:] = values
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, a)
        matrix.assemble()
        vector.array[:] = 0
        fem.assemble_vector(vector.array, r)
        return matrix, vector.array.copy()

    def solver(free):
        rows = PETSc.IS().createGeneral(free.astype(np.int32), MPI.COMM_SELF)
        ksp = PETSc.KSP().create(MPI.COMM_SELF)
        ksp.setType("preonly")
        ksp.getPC().setType("lu")

        def solve(K, r):
            part = K.createSubMatrix(rows, rows)
            ksp.setOperators(part)
            rhs, du = part.createVecs()
            rhs.array[:] = r[free]
            ksp.solve(rhs, du)
            whole = np.zeros(len(r))
            whole[free] = du.array
            return whole

        return solve

    return x, np.zeros(x.size), force, assemble, solver


def main(tool, problem, n):
    for package in PACKAGES[tool]:
        __import__(package)  # is not counted
    start = time.perf_counter()
    x, u, force, assemble, solve = {"felupe": felupe, "skfem": skfem, "dolfinx": dolfinx}[tool](
        problem, n
    )
    fixed, values = supports(problem, x, len(x))
    iterations = path(problem, u, fixed, values, force, assemble, solve)
    total = time.perf_counter() - start
    node, component = probe(problem, x)
    found = {
        "total": total,
        "assembly": timed(lambda: assemble(u)),
        "iterations": iterations,
        "value": float(u[len(x) * node + component]),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
