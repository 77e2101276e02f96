"""Residual and tangent of hex8 by another program: see `benchmarks.hex8`.

Run in an environment of its own: `python hex8_rivals.py TOOL N FILE` writes the residual and a
product of the tangent to FILE and prints the least CPU seconds of one evaluation. Nothing of
softehl is imported here. All take mu / 2 (J^(-2/3) I1 - 3) + K / 2 (J - 1)^2 on the same distorted
cube of N^3 hexahedra with 2 x 2 x 2 points and the same displacements.
"""

import os
import sys
import time
from contextlib import suppress

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import numpy as np
from hex8_cube import MU, SIGNS, K, cube, direction, displacement, mapped

SAMPLES = 7


def of_elements(x, cells, evaluate):
    """An evaluation that gives arrays of elements: as the others, by summing them once."""

    def results():
        R, A = (np.asarray(a) for a in evaluate())
        R, A = R.reshape(-1, 8, 3), A.reshape(-1, 24, 24)
        r, product = np.zeros(x.shape), np.zeros(x.shape)
        np.add.at(r, cells, R)
        v = direction(x)[cells].reshape(-1, 24)
        np.add.at(product, cells, np.einsum("eij,ej->ei", A, v).reshape(-1, 8, 3))
        return r, product

    return x, evaluate, results


def shape_gradients():
    """(points, 8, 3)."""
    points = SIGNS / np.sqrt(3)
    factors = 1 + points[:, None, :] * SIGNS
    return np.stack(
        [SIGNS[:, k] * np.prod(np.delete(factors, k, axis=2), axis=2) / 8 for k in range(3)], axis=2
    )


def jax(n):
    """Arrays of elements: moduli at the points by `jax.hessian`, pulled back; one jitted call."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    x, cells = cube(n)
    X, u = (jnp.asarray(a) for a in (mapped(x)[cells], displacement(x)[cells]))
    dN = jnp.asarray(shape_gradients())

    def energy(F):
        J = jnp.linalg.det(F)
        return MU / 2 * (J ** (-2 / 3) * jnp.sum(F * F) - 3) + K / 2 * (J - 1) ** 2

    def element(u, X):
        jacobian = jnp.einsum("qak,ai->qik", dN, X)
        B = jnp.einsum("qak,qki->qai", dN, jnp.linalg.inv(jacobian))
        volume = jnp.linalg.det(jacobian)
        F = jnp.eye(3) + jnp.einsum("qak,ai->qik", B, u)
        P, A = jax.vmap(jax.grad(energy))(F), jax.vmap(jax.hessian(energy))(F)
        R = jnp.einsum("q,qik,qak->ai", volume, P, B)
        return R, jnp.einsum("q,qikjl,qak,qbl->aibj", volume, A, B, B)

    jitted = jax.jit(jax.vmap(element))
    return of_elements(x, cells, lambda: jax.block_until_ready(jitted(u, X)))


def tatva(n):
    """Arrays of elements: its operator integrates the energy of an element, JAX differentiates."""
    import jax
    import jax.numpy as jnp
    from tatva import Mesh, Operator, element

    jax.config.update("jax_enable_x64", True)
    x, cells = cube(n)
    X, u = (jnp.asarray(a) for a in (mapped(x)[cells], displacement(x)[cells]))

    def energy(u, X):
        mesh = Mesh(coords=X, elements=jnp.arange(8)[None])
        op = Operator(mesh, element.Hexahedron8())
        F = jnp.eye(3) + op.grad(u)
        J = jnp.linalg.det(F)
        I1 = jnp.sum(F * F, axis=(-2, -1))
        return op.integrate(MU / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2)

    both = jax.jit(jax.vmap(lambda u, X: (jax.grad(energy)(u, X), jax.hessian(energy)(u, X))))
    return of_elements(x, cells, lambda: jax.block_until_ready(both(u, X)))


def warp(n):
    """Arrays of elements: a kernel of the residual by hand, and its tangent by hand.

    Loops stay loops and no adjoint is made: else it compiles for more than three minutes.
    """
    import warp as wp

    wp.config.quiet = True
    wp.init()
    wp.set_module_options({"enable_backward": False, "max_unroll": 3})
    x, cells = cube(n)
    dN = wp.array(shape_gradients().reshape(64, 3), dtype=wp.vec3d, device="cpu")
    X = wp.array(mapped(x)[cells].reshape(-1, 3), dtype=wp.vec3d, device="cpu")
    u = wp.array(displacement(x)[cells].reshape(-1, 3), dtype=wp.vec3d, device="cpu")
    R = wp.zeros(len(cells) * 8, dtype=wp.vec3d, device="cpu")
    A = wp.zeros((len(cells) * 8, 8), dtype=wp.mat33d, device="cpu")

    @wp.kernel
    def both(
        dN: wp.array(dtype=wp.vec3d),
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        R: wp.array(dtype=wp.vec3d),
        A: wp.array2d(dtype=wp.mat33d),
        mu: wp.float64,
        bulk: wp.float64,
    ):
        e = wp.tid()
        for a in range(8):
            R[8 * e + a] = wp.vec3d()
            for b in range(8):
                A[8 * e + a, b] = wp.mat33d()
        one, third = wp.float64(1.0), wp.float64(1.0) / wp.float64(3.0)
        two = wp.float64(2.0)
        for q in range(8):
            jacobian = wp.mat33d()
            for a in range(8):
                jacobian += wp.outer(X[8 * e + a], dN[8 * q + a])
            inverse = wp.inverse(jacobian)
            volume = wp.determinant(jacobian)
            F = wp.identity(n=3, dtype=wp.float64)
            for a in range(8):
                F += wp.outer(u[8 * e + a], wp.transpose(inverse) * dN[8 * q + a])
            J = wp.determinant(F)
            G = wp.transpose(wp.inverse(F))
            I1 = wp.ddot(F, F)
            m = mu * wp.pow(J, -two * third)
            P = m * (F - I1 * third * G) + bulk * (J - one) * J * G
            to_volume = two / wp.float64(9.0) * m * I1 + bulk * (two * J - one) * J
            turned = m * I1 * third - bulk * (J - one) * J
            for a in range(8):
                Ba = wp.transpose(inverse) * dN[8 * q + a]
                Fa, Ga = F * Ba, G * Ba
                R[8 * e + a] += volume * (P * Ba)
                for b in range(8):
                    Bb = wp.transpose(inverse) * dN[8 * q + b]
                    Fb, Gb = F * Bb, G * Bb
                    block = m * wp.dot(Ba, Bb) * wp.identity(n=3, dtype=wp.float64)
                    block -= two * third * m * (wp.outer(Fa, Gb) + wp.outer(Ga, Fb))
                    block += to_volume * wp.outer(Ga, Gb) + turned * wp.outer(Gb, Ga)
                    A[8 * e + a, b] += volume * block

    def evaluate():
        wp.launch(both, dim=len(cells), inputs=[dN, X, u, R, A, MU, K], device="cpu")
        blocks = A.numpy().reshape(-1, 8, 8, 3, 3).transpose(0, 1, 3, 2, 4)
        return R.numpy(), blocks

    return of_elements(x, cells, evaluate)


def torchfem(n):
    """Assembled: its hyperelastic solid, of which it differentiates the energy."""
    import torch
    from torchfem import Solid
    from torchfem.materials import Hyperelastic3D

    torch.set_num_threads(1)
    torch.set_default_dtype(torch.float64)
    x, cells = cube(n)

    def energy(F, parameters):
        J = torch.linalg.det(F)
        mu, bulk = parameters
        return mu / 2 * (J ** (-2 / 3) * (F * F).sum() - 3) + bulk / 2 * (J - 1) ** 2

    material = Hyperelastic3D(energy, [MU, K]).vectorize(len(cells))
    body = Solid(torch.tensor(mapped(x)), torch.tensor(cells), material)
    body.K = torch.empty(0)
    u, none = torch.tensor(displacement(x)), torch.empty(0, dtype=torch.int64)
    zeros = torch.zeros(body.n_int, body.n_elem, 3, 3)
    start = (torch.zeros_like(u), zeros + torch.eye(3), zeros, zeros[:, :, :0, 0], u, zeros[0], 0)

    def evaluate():
        k, f, *_ = body.integrate_material(*start)
        return body.assemble_rhs(f), body.assemble_matrix(k, none)

    def results():
        r, A = evaluate()
        product = A @ torch.tensor(direction(x)).ravel()
        return r.numpy().reshape(-1, 3), product.numpy().reshape(-1, 3)

    return x, evaluate, results


def mfem(n):
    """Assembled: its neo-Hooke in a nonlinear form, whose gradient is a sparse matrix."""
    import mfem.ser as mf

    mesh = mf.Mesh.MakeCartesian3D(n, n, n, mf.Element.HEXAHEDRON, 1.0, 1.0, 1.0, False)
    mesh.SetCurvature(1, False, 3, mf.Ordering.byVDIM)
    nodes = mesh.GetNodes().GetDataArray()
    x = nodes.reshape(-1, 3).copy()
    nodes[:] = mapped(x).ravel()
    collection = mf.H1_FECollection(1, 3)
    space = mf.FiniteElementSpace(mesh, collection, 3, mf.Ordering.byVDIM)
    model = mf.NeoHookeanModel(MU, K)
    integrator = mf.HyperelasticNLFIntegrator(model)
    integrator.SetIntRule(mf.IntRules.Get(mf.Geometry.CUBE, 3))
    form = mf.NonlinearForm(space)
    form.AddDomainIntegrator(integrator)
    moved = mf.Vector((mapped(x) + displacement(x)).ravel())
    r, v, product = (mf.Vector(a.ravel()) for a in (0 * x, direction(x), 0 * x))

    def evaluate():
        form.Mult(moved, r)
        return form.GetGradient(moved)

    def results():
        evaluate().Mult(v, product)
        # what is in MFEM's hands lives as long as these results
        results.kept = mesh, collection, space, model, integrator
        return tuple(a.GetDataArray().reshape(-1, 3).copy() for a in (r, product))

    return x, evaluate, results


def ngsolve(n):
    """Assembled: a compiled symbolic energy, applied and linearised."""
    import ngsolve as ng
    from ngsolve.meshes import MakeHexMesh

    where = lambda x, y, z: tuple(mapped(np.array([[x, y, z]]))[0])  # noqa: E731
    lattice = MakeHexMesh(nx=n, ny=n, nz=n)
    x = np.array([lattice[v].point for v in lattice.vertices])
    mesh = MakeHexMesh(nx=n, ny=n, nz=n, mapping=where)
    space = ng.VectorH1(mesh, order=1)
    u = space.TrialFunction()
    F = ng.Id(3) + ng.Grad(u)
    J = ng.Det(F)
    W = MU / 2 * (J ** (-2 / 3) * ng.InnerProduct(F, F) - 3) + K / 2 * (J - 1) ** 2
    form = ng.BilinearForm(space, symmetric=False)
    dx = ng.dx(
        intrules={
            ng.HEX: ng.IntegrationRule(
                [tuple((p / np.sqrt(3) + 1) / 2) for p in SIGNS], [1 / 8] * 8
            )
        }
    )
    form += ng.Variation(W.Compile(realcompile=True, wait=True) * dx)
    state, r, v, product = (ng.GridFunction(space).vec for _ in range(4))
    state.FV().NumPy()[:] = displacement(x).T.ravel()
    v.FV().NumPy()[:] = direction(x).T.ravel()

    def evaluate():
        form.Apply(state, r)
        form.AssembleLinearization(state)

    def results():
        evaluate()
        product.data = form.mat * v
        return tuple(a.FV().NumPy().reshape(3, -1).T for a in (r, product))

    return x, evaluate, results


def felupe(n):
    """Assembled: its neo-Hooke, vector and matrix of a solid body."""
    import felupe as fem

    mesh = fem.Cube(n=n + 1)
    x = mesh.points.copy()
    mesh.update(points=mapped(x))
    field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
    body = fem.SolidBody(fem.NeoHooke(mu=MU, bulk=K), field)
    field[0].values[:] = displacement(x)

    def evaluate():
        return body.assemble.vector(field), body.assemble.matrix(field)

    def results():
        r, A = evaluate()
        return r.toarray().reshape(-1, 3), (A @ direction(x).ravel()).reshape(-1, 3)

    return x, evaluate, results


def dolfinx(n):
    """Assembled: forms of FFCx into a vector and a matrix of PETSc."""
    with suppress(ImportError):  # the wheel dolfinx-solver-real finds its MPI by it
        import dolfinx_solver  # noqa: F401
    import ufl
    from dolfinx import fem, mesh
    from dolfinx.fem import petsc
    from mpi4py import MPI

    cell = mesh.CellType.hexahedron
    domain = mesh.create_box(MPI.COMM_SELF, [[0] * 3, [1] * 3], [n] * 3, cell)
    V = fem.functionspace(domain, ("Lagrange", 1, (3,)))
    x = V.tabulate_dof_coordinates().copy()
    domain.geometry.x[:] = mapped(domain.geometry.x)
    u = fem.Function(V)
    F = ufl.Identity(3) + ufl.grad(u)
    J, I1 = ufl.det(F), ufl.tr(F.T * F)
    W = MU / 2 * (J ** (-2 / 3) * I1 - 3) + K / 2 * (J - 1) ** 2
    first = ufl.derivative(W * ufl.dx(metadata={"quadrature_degree": 3}), u, ufl.TestFunction(V))
    options = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
    r = fem.form(first, jit_options=options)
    a = fem.form(ufl.derivative(first, u, ufl.TrialFunction(V)), jit_options=options)
    A, vector = petsc.create_matrix(a), fem.create_vector(V)
    u.x.array[:] = displacement(x).ravel()

    def evaluate():
        A.zeroEntries()
        petsc.assemble_matrix(A, a)
        A.assemble()
        vector.array[:] = 0
        fem.assemble_vector(vector.array, r)

    def results():
        evaluate()
        v, product = A.createVecs()
        v.array[:] = direction(x).ravel()
        A.mult(v, product)
        return vector.array.reshape(-1, 3).copy(), product.array.reshape(-1, 3)

    return x, evaluate, results


PROGRAMS = (jax, tatva, warp, torchfem, mfem, ngsolve, felupe, dolfinx)
TOOLS = {f.__name__: f for f in PROGRAMS}


def main(tool, n, file):
    x, evaluate, results = TOOLS[tool](n)
    r, product = results()
    order = np.lexsort(np.round(x, 9).T)
    np.savez(file, r=r[order], product=product[order])
    seconds = []
    for _ in range(SAMPLES):
        start = time.process_time()
        evaluate()
        seconds.append(time.process_time() - start)
    print(min(seconds))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
