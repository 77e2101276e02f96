"""Times of generated pages in other programs: a user element and material, JAX, NGSolve.

    python -m benchmarks.hosts        (in the environment of `make hosts`, ngscxx on the PATH)

A row for each measurement; what is not installed is named and left out. The page is the neo-Hookean
quad4 of docs/models. All on one thread, the least of many runs, rivals in turn in one loop.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
MODELS = Path(__file__).parents[1] / "docs" / "models"
PAGE, LAW = MODELS / "neo_hooke.py", MODELS / "creep_law.py"
LANES = "#define SOFTEHL_LANES 1\n"
MU, LAME = 0.4, 1.2
CELLS = 64
"""Cells a direction of the block."""
SIZES = (1, 64, 4096, 262144)
"""Numbers of elements of a call in JAX."""
TRAINED, STEPS = 24, 200
"""Cells a direction and steps of the training of a network."""


def row(what: str, seconds: float, unit: float, name: str) -> None:
    print(f"| {what} | {seconds / unit:.3g} {name} |", flush=True)


def least(
    calls: dict[str, Callable[[], object]],
    runs: int = 20,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Seconds of each call, in rounds of all calls."""
    for call in calls.values():
        call()
    best = dict.fromkeys(calls, float("inf"))
    for _ in range(runs):
        for name, call in calls.items():
            start = clock()
            call()
            best[name] = min(best[name], clock() - start)
    return best


def folder(host: str, place: Path, target: str, page: Path = PAGE) -> Path:
    """The page for a host, made; its modules can then be imported."""
    command = [sys.executable, "-m", "softehl", "generate", str(page), "--target", host]
    subprocess.run([*command, "--out", str(place)], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["make", "-s", target, f"PYTHON={sys.executable}"], cwd=place, check=True)
    sys.path.insert(0, str(place))
    return place


def user_element(place: Path) -> None:
    folder("abaqus", place, "neo_hooke_uel.o")
    called(place, "UEL", "neo_hooke", "uel_caller.c")


def user_material(place: Path) -> None:
    folder("abaqus", place, "creeping_umat.o", LAW)
    called(place, "UMAT with history and local unknowns", "creeping", "umat_caller.c")


def called(place: Path, subroutine: str, page: str, caller: str) -> None:
    text = (place / f"{page}.c").read_text()
    for what, source in {
        f"call of {subroutine}, one lane": text,
        f"call of {subroutine}, lanes of the processor": text.replace(LANES, ""),
    }.items():
        (place / f"{page}.c").write_text(source)
        flags = ["-w", "-O2", "-march=native", "-fno-math-errno", "-ffp-contract=fast"]
        files = [str(Path(__file__).with_name(caller)), f"{subroutine[:4].strip().lower()}.c"]
        subprocess.run(
            ["cc", *flags, *files, f"{page}.c", "-lm", "-o", "caller"], cwd=place, check=True
        )
        done = subprocess.run(["./caller"], cwd=place, check=True, capture_output=True, text=True)
        row(what, float(done.stdout), 1e-9, "ns")


def in_jax(place: Path) -> None:
    jax: Any = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)
    jnp: Any = importlib.import_module("jax.numpy")
    folder("jax", place, "libneo_hooke_jax.so")
    page: Any = importlib.import_module("neo_hooke_jax")
    hessian = jax.vmap(jax.hessian(_energy(jax, jnp)), (0, 0, None))
    for n in SIZES:
        _tangents(jax, jnp, page, hessian, n)
    _train(jax, jnp)


def _tangents(jax: Any, jnp: Any, page: Any, hessian: Any, n: int) -> None:
    """Tangents of n elements by our operation and by JAX's own derivatives."""
    p = page.parameters(mu=MU, lame=LAME)
    noise = 0.05 * jnp.sin(jnp.arange(16.0 * n)).reshape(2, n, 8)
    X, u = jnp.array([1.0, 1, 2, 1, 2, 2, 1, 2]) + noise[0], noise[1]
    ours = jax.jit(lambda u: page.tangent(X, u, None, p)[1])
    rival = jax.jit(hessian)
    assert jnp.abs(ours(u) - rival(u, X, p)).max() < 1e-12
    calls: dict[str, Callable[[], object]] = {
        "softehl, jit": lambda: jax.block_until_ready(ours(u)),
        "jit(vmap(hessian))": lambda: jax.block_until_ready(rival(u, X, p)),
        "softehl without jit": lambda: jax.block_until_ready(page.tangent(X, u, None, p)),
        "vmap(hessian) without jit": lambda: jax.block_until_ready(hessian(u, X, p)),
    }
    for what, seconds in least(calls, 5 if n > 1e5 else 20).items():
        row(f"tangent of {n} elements in JAX, {what}", seconds / n, 1e-9, "ns")


def _energy(jax: Any, jnp: Any) -> Any:
    g = 3**-0.5
    points = [(x, y) for x in (-g, g) for y in (-g, g)]
    slopes = [[[y - 1, x - 1], [1 - y, -1 - x], [1 + y, 1 + x], [-1 - y, 1 - x]] for x, y in points]
    D = jnp.array(slopes) / 4

    def energy(u: Any, X: Any, p: Any) -> Any:
        X, u = X.reshape(4, 2), u.reshape(4, 2)

        def at(d: Any) -> Any:
            J = X.T @ d
            det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
            inverse = jnp.array([[J[1, 1], -J[0, 1]], [-J[1, 0], J[0, 0]]]) / det
            F = jnp.eye(2) + u.T @ (d @ inverse)
            log = jnp.log(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
            return det * (p[0] / 2 * ((F * F).sum() - 2 - 2 * log) + p[1] / 2 * log**2)

        return jax.vmap(at)(D).sum()

    return energy


FIELD = '''
from softehl import Definition, Model, kinematics, quadrature, shapes
import sympy as sp

def field() -> Definition:
    """The neo-Hookean quad4 with a shear modulus for each cell."""
    m = Model("field", nodes=4, rule=quadrature.gauss(2, 2))
    X, u = m.coordinates("X", "Y"), m.nodal_unknowns("u_x", "u_y")
    (mu,), (lame,) = m.data(mu="shear modulus"), m.parameters(lame="first Lame parameter")
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 2 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    return m.finish()
'''


def _train(jax: Any, jnp: Any) -> None:
    """A network of 697 weights becomes the shear modulus whose displacements were measured."""
    np: Any = importlib.import_module("numpy")
    with tempfile.TemporaryDirectory() as scratch:
        page = Path(scratch) / "field.py"
        page.write_text(FIELD)
        folder("jax", Path(scratch) / "out", "libfield_jax.so", page)
        equilibrium = importlib.import_module("equilibrium").equilibrium
        m = TRAINED
        grid = np.stack(np.meshgrid(*2 * [np.linspace(0, 1, m + 1)], indexing="ij"), -1)
        grid = grid.reshape(-1, 2)
        corner = (np.arange(m)[:, None] * (m + 1) + np.arange(m)).ravel()
        cells = np.stack([corner, corner + m + 1, corner + m + 2, corner + 1], 1)
        dofs = (2 * cells[:, :, None] + np.arange(2)).reshape(-1, 8)
        ends = [np.flatnonzero(grid[:, 0] == x) for x in (0, 1)]
        fixed = np.concatenate([2 * ends[0], 2 * ends[0] + 1, 2 * ends[1]])
        values = jnp.concatenate([jnp.zeros(2 * (m + 1)), jnp.full(m + 1, 0.2)])
        solve = equilibrium(grid[cells].reshape(-1, 8), dofs, fixed)
        centres, p = jnp.array(grid[cells].mean(1)), jnp.array([LAME])
        forces = jnp.zeros(2 * len(grid))
        true = 0.4 + 0.3 * jnp.exp(-20 * ((centres - 0.4) ** 2).sum(1))
        measured = solve(values, forces, true[:, None], p)
        start = time.perf_counter()
        first, last, error = _adam(
            jax, jnp, centres, lambda mu: solve(values, forces, mu, p), measured, true
        )
        seconds = time.perf_counter() - start
        what = f"{STEPS} steps of training through {m} x {m} cells, {len(forces)} unknowns"
        row(
            f"{what}: misfit {first:.1e} to {last:.1e}, modulus off by {error:.1%}", seconds, 1, "s"
        )


def _adam(jax: Any, jnp: Any, x: Any, solve: Any, measured: Any, true: Any) -> Any:
    sizes, keys = (2, 24, 24, 1), jax.random.split(jax.random.PRNGKey(1), 3)
    w = [
        (jax.random.normal(k, (a, b)) / a**0.5, jnp.zeros(b))
        for k, a, b in zip(keys, sizes, sizes[1:], strict=False)
    ]

    def modulus(w: Any) -> Any:
        h = x
        for A, b in w[:-1]:
            h = jnp.tanh(h @ A + b)
        return 0.4 * jnp.exp(h @ w[-1][0] + w[-1][1])

    flat, back = importlib.import_module("jax.flatten_util").ravel_pytree(w)
    gradient = jax.jit(
        jax.value_and_grad(lambda v: ((solve(modulus(back(v))) - measured) ** 2).sum())
    )
    m, s, losses = jnp.zeros_like(flat), jnp.zeros_like(flat), []
    for t in range(1, STEPS + 1):
        loss, g = gradient(flat)
        m, s = 0.9 * m + 0.1 * g, 0.999 * s + 0.001 * g**2
        flat = flat - 0.01 * (m / (1 - 0.9**t)) / (jnp.sqrt(s / (1 - 0.999**t)) + 1e-12)
        losses.append(float(loss))
    found = modulus(back(flat))[:, 0]
    return losses[0], losses[-1], float(jnp.abs(found - true).mean() / true.mean())


def in_ngsolve(place: Path) -> None:
    ng: Any = importlib.import_module("ngsolve")
    meshes: Any = importlib.import_module("ngsolve.meshes")
    folder("ngsolve", place, "neo_hooke_ngsolve.so")
    page: Any = importlib.import_module("neo_hooke_ngsolve")
    ng.SetNumThreads(1)
    mesh = meshes.MakeStructured2DMesh(quads=True, nx=CELLS, ny=CELLS)
    space = ng.VectorH1(mesh, order=1)
    F = ng.Id(2) + ng.Grad(space.TrialFunction())
    log = ng.log(ng.Det(F))
    W = MU / 2 * (ng.InnerProduct(F, F) - 2 - 2 * log) + LAME / 2 * log**2
    u = ng.GridFunction(space)
    u.Set(ng.CF((0.1 * ng.x * ng.y, 0.05 * ng.x)))
    integrands = {
        "softehl's integrator": page.integrator(mu=MU, lame=LAME),
        "realcompile": ng.Variation(W.Compile(realcompile=True, wait=True) * ng.dx),
        "symbolic": ng.Variation(W * ng.dx),
    }
    forms = {"softehl's form": page.form(space, mu=MU, lame=LAME)}
    for name, integrand in integrands.items():
        forms[name] = ng.BilinearForm(space, symmetric=False)
        forms[name] += integrand
    calls: dict[str, Callable[[], object]] = {
        name: lambda form=form: form.AssembleLinearization(u.vec)  # type: ignore[misc]
        for name, form in forms.items()
    }
    # on one thread the time of the processor leaves out other work on the machine
    for name, seconds in least(calls, 40, time.process_time).items():
        row(f"assembly of {CELLS} x {CELLS} cells in NGSolve, {name}", seconds, 1e-3, "ms")
    solved = {name: _stretched(ng, space, form) for name, form in forms.items()}
    own, theirs = solved["softehl's form"], solved["realcompile"]
    size = max(abs(v) for v in theirs[0])
    off = max(abs(a - b) for a, b in zip(own[0], theirs[0], strict=True)) / size
    print(f"| solution against realcompile, {own[1]} and {theirs[1]} Newton steps | {off:.1e} |")


def _stretched(ng: Any, space: Any, form: Any) -> tuple[list[float], int]:
    """Unknowns of the block stretched by a fifth, and Newton's steps to 1e-12."""
    held = ng.VectorH1(space.mesh, order=1, dirichlet="left|right")
    u, step = ng.GridFunction(held), ng.GridFunction(held)
    u.Set(ng.CF((0.2 * ng.x, 0)))
    residual = u.vec.CreateVector()
    steps, length = 0, 1.0
    while length > 1e-12:
        form.Apply(u.vec, residual)
        form.AssembleLinearization(u.vec)
        step.vec.data = form.mat.Inverse(held.FreeDofs()) * residual
        u.vec.data -= step.vec
        steps, length = steps + 1, max(map(abs, step.vec))
    return list(u.vec), steps


def main() -> None:
    """All of them."""
    needs = {user_element: "", user_material: "", in_jax: "jax", in_ngsolve: "ngsolve"}
    for measure, package in needs.items():
        if package and importlib.util.find_spec(package) is None:
            print(f"left out: {package} is not installed")
            continue
        with tempfile.TemporaryDirectory() as scratch:
            measure(Path(scratch) / "page")


if __name__ == "__main__":
    main()
