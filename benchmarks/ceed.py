"""Products with the tangent of neo-Hooke beside libCEED, in one run on one core.

    pip install libceed; python -m benchmarks.ceed [ORDER ...] [--unknowns N] [--resource NAME ...]

The same distorted cube of hexahedra, state, shape functions and Gauss points. libCEED gets what
its own solids keep at a point: the inverse Jacobian and the weight (10 numbers) and the gradients
of the displacement (9), in the layout of the backend; its function of the points is compiled for
this processor. The products are compared, then timed in turns, the least of many.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import softehl
from benchmarks.products import rubber
from softehl import Mesh, Study
from softehl.codegen.c_compiler import compiler
from softehl.codegen.emit.points.sum_factored_product import lagrange
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.matrix_free_products import (
    ElementNumbering,
    ElementProduct,
    lexicographic,
    require_product,
)
from softehl.runtime.mesh.cells import CELLS

SAMPLES = 15
RESOURCES = ("/cpu/self/opt/blocked", "/cpu/self/opt/serial", "/cpu/self/avx/blocked")
SOURCE = """
#include <math.h>
#include <stdint.h>

/* dP of mu/2 (F:F - 3 - 2 ln J) + K/2 (J - 1)^2 with mu = K = 1 along the gradient of du. */
int product(void *context, int32_t Q, const double *const *in, double *const *out)
{
    const double *du = in[0], *geometry = in[1], *state = in[2];
    double *dv = out[0];
    (void)context;
#pragma GCC ivdep
    for (int32_t i = 0; i < Q; ++i) {
        double X[3][3], F[3][3], D[3][3], G[3][3], P[3][3];
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k) {
                X[j][k] = geometry[(3 * j + k) * Q + i];
                F[j][k] = state[(3 * j + k) * Q + i] + (j == k);
            }
        const double w = geometry[9 * Q + i];
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < 3; ++k) {
                D[c][k] = 0;
                for (int m = 0; m < 3; ++m) D[c][k] += du[(m * 3 + c) * Q + i] * X[m][k];
            }
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) {
                const int a = (r + 1) % 3, b = (r + 2) % 3, d = (c + 1) % 3, e = (c + 2) % 3;
                G[r][c] = F[a][d] * F[b][e] - F[a][e] * F[b][d];
            }
        const double J = F[0][0] * G[0][0] + F[0][1] * G[0][1] + F[0][2] * G[0][2], one = 1 / J;
        double trace = 0;
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) {
                G[r][c] *= one;
                trace += G[r][c] * D[r][c];
            }
        const double first = (2 * J - 1) * J * trace, second = 1 - (J - 1) * J;
        double H[3][3];
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) {
                H[r][c] = 0;
                for (int m = 0; m < 3; ++m) H[r][c] += D[m][r] * G[m][c];
            }
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) {
                double value = 0;
                for (int m = 0; m < 3; ++m) value += G[r][m] * H[m][c];
                P[r][c] = D[r][c] + second * value + first * G[r][c];
            }
        for (int m = 0; m < 3; ++m)
            for (int c = 0; c < 3; ++c) {
                double value = 0;
                for (int k = 0; k < 3; ++k) value += P[c][k] * X[m][k];
                dv[(m * 3 + c) * Q + i] = w * value;
            }
    }
    return 0;
}
"""


class Cube:
    """A distorted cube, a state and the product of softehl."""

    def __init__(self, order: int, unknowns: float) -> None:
        n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
        mesh = Mesh.box((1, 1, 1), cells=(n, n, n), order=order)
        study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
        names = softehl.load_kernel(rubber, cell="hex8").parameters
        given: dict[str, Any] = dict.fromkeys(names, 1.0)
        study.add("body", rubber, **given)
        system = study.system()
        block = system.assembler.block("body")
        self.numbering = ElementNumbering.of(block, 1)
        rng = np.random.default_rng(0)
        self.state = np.zeros(system.size)
        self.state[:] = rng.uniform(-0.01, 0.01, system.size) / n / order
        parameters = np.ones(len(block.kernel.parameters))
        self.product = ElementProduct.of(block, self.state, parameters, self.numbering)
        self.kind = f"hex{(order + 1) ** 3}"
        self.nodes = mesh.cells[self.kind][:, lexicographic(CELLS[self.kind])]
        self.points = study.mesh.points
        nodal = system.numbering.nodal
        self.dofs = np.stack([nodal[f"u_{c}"] for c in "xyz"], axis=1)
        rule = require_product(block).default_rule
        self.line = sorted({float(p) for p in np.round(rule.points[:, 2], 15)})


class Ceed:
    """The product of libCEED."""

    def __init__(self, cube: Cube, resource: str, library: Any) -> None:
        import libceed
        from libceed.ceed_constants import BASIS_NONE

        self.ceed = ceed = libceed.Ceed(resource)
        ends = sorted({float(x) for x in CELLS[cube.kind].nodes[:, 0]})
        N, D = lagrange(ends, cube.line)
        weights = np.polynomial.legendre.leggauss(len(cube.line))[1]
        P, Q = len(ends), len(cube.line)
        n, count = len(cube.nodes), len(cube.points)
        table = [np.ascontiguousarray(a, dtype=np.float64) for a in (N, D, cube.line, weights)]
        basis = ceed.BasisTensorH1(3, 3, P, Q, *table)
        offsets = (3 * cube.nodes).astype(np.int32).ravel()
        unknowns = ceed.ElemRestriction(n, P**3, 3, 1, 3 * count, offsets)
        geometry, gradients = _at_points(cube, N, D, weights)
        kept = [self._kept(values, Q**3) for values in (geometry, gradients)]
        function = ceed.QFunction(1, library.product, f"{library._name}:product")
        function.add_input("du", 9, libceed.EVAL_GRAD)
        for name, (_, _, size) in zip(("geometry", "state"), kept, strict=True):
            function.add_input(name, size, libceed.EVAL_NONE)
        function.add_output("dv", 9, libceed.EVAL_GRAD)
        self.operator = ceed.Operator(function)
        self.operator.set_field("du", unknowns, basis, libceed.VECTOR_ACTIVE)
        for name, (restriction, vector, _) in zip(("geometry", "state"), kept, strict=True):
            self.operator.set_field(name, restriction, BASIS_NONE, vector)
        self.operator.set_field("dv", unknowns, basis, libceed.VECTOR_ACTIVE)
        self.x, self.y = ceed.Vector(3 * count), ceed.Vector(3 * count)
        self._live = (basis, unknowns, kept, function)

    def _kept(self, values: Array, points: int) -> tuple[Any, Any, int]:
        """Numbers (n, points, size) in the layout of the backend."""
        import libceed
        from libceed.ceed_constants import BASIS_NONE

        n, _, size = values.shape
        given = self.ceed.Vector(values.size)
        given.set_array(np.ascontiguousarray(values).ravel(), cmode=libceed.COPY_VALUES)
        strides = np.array([size, 1, size * points], dtype=np.int32)
        first = self.ceed.StridedElemRestriction(n, points, size, values.size, strides)
        second = self.ceed.StridedElemRestriction(n, points, size, values.size, _Backend())
        stored = self.ceed.Vector(values.size)
        copy = self.ceed.IdentityQFunction(size, libceed.EVAL_NONE, libceed.EVAL_NONE)
        operator = self.ceed.Operator(copy)
        operator.set_field("input", first, BASIS_NONE, libceed.VECTOR_ACTIVE)
        operator.set_field("output", second, BASIS_NONE, libceed.VECTOR_ACTIVE)
        operator.apply(given, stored)
        return second, stored, size

    def apply(self, v: Array) -> Array:
        """K v of a vector (nodes, 3)."""
        import libceed

        self.x.set_array(np.ascontiguousarray(v).ravel(), cmode=libceed.COPY_VALUES)
        self.again()
        with self.y.array_read() as values:
            return np.array(values).reshape(-1, 3)

    def again(self) -> None:
        """Repeat the product of the last vector."""
        self.operator.apply(self.x, self.y)


class _Backend:
    """The strides of the backend, which Python's interface takes as an array alone."""

    @property
    def __array_interface__(self) -> dict[str, Any]:
        from _ceed_cffi import ffi, lib

        return {"data": (int(ffi.cast("uintptr_t", lib.CEED_STRIDES_BACKEND)), True)}


def _at_points(cube: Cube, N: Array, D: Array, weights: Array) -> tuple[Array, Array]:
    """Inverse Jacobian and weight (n, points, 10), gradients (n, points, 9); x runs first."""
    slopes = [np.einsum("ck,bj,ai->cbakji", *t) for t in ((N, N, D), (N, D, N), (D, N, N))]
    q, p = len(N) ** 3, N.shape[1] ** 3
    G = np.stack([s.reshape(q, p) for s in slopes])
    u = cube.state[cube.dofs]
    weight = np.einsum("c,b,a->cba", weights, weights, weights).ravel()
    geometry = np.empty((len(cube.nodes), q, 10))
    gradients = np.empty((len(cube.nodes), q, 9))
    for first in range(0, len(cube.nodes), 512):
        some = cube.nodes[first : first + 512]
        Jacobian = np.einsum("mqa,eai->eqim", G, cube.points[some])
        inverse = np.linalg.inv(Jacobian)
        part = slice(first, first + len(some))
        geometry[part, :, :9] = inverse.reshape(len(some), q, 9)
        geometry[part, :, 9] = np.linalg.det(Jacobian) * weight
        parent = np.einsum("mqa,eac->eqcm", G, u[some])
        gradients[part] = (parent @ inverse).reshape(len(some), q, 9)
    return geometry, gradients


def library() -> Any:
    """The function of the points, compiled."""
    folder = Path(tempfile.mkdtemp(prefix="softehl-ceed-"))
    (folder / "product.c").write_text(SOURCE, encoding="utf-8")
    target = folder / "product.so"
    flags = ["-O3", "-march=native", "-ffast-math", "-mprefer-vector-width=512", "-fPIC", "-shared"]
    subprocess.run(
        [*compiler(), *flags, str(folder / "product.c"), "-o", str(target), "-lm"], check=True
    )
    return ctypes.CDLL(str(target))


def alternately(runs: Sequence[Callable[[], object]]) -> list[float]:
    """Least seconds of each, in turns."""
    least = [float("inf")] * len(runs)
    for _ in range(SAMPLES):
        for k, run in enumerate(runs):
            start = time.thread_time()
            run()
            least[k] = min(least[k], time.thread_time() - start)
    return least


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ceed", description=__doc__)
    parser.add_argument("orders", nargs="*", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--unknowns", type=float, default=5e4)
    parser.add_argument("--resource", nargs="*", default=RESOURCES)
    given = parser.parse_args(arguments)
    compiled = library()
    for order in given.orders:
        cube = Cube(order, given.unknowns)
        rng = np.random.default_rng(1)
        v = rng.uniform(-1, 1, len(cube.state))
        wanted = np.zeros(len(v))
        cube.product.add(v, wanted)
        source, target = cube.numbering.vector(), cube.numbering.vector()
        source[cube.numbering.at] = v[cube.numbering.unknowns]
        runs: list[Callable[[], object]] = [partial(cube.product, source, target)]
        for resource in given.resource:
            other = Ceed(cube, resource, compiled)
            found = np.zeros(len(v))
            found[cube.dofs] = other.apply(v[cube.dofs])
            off = np.abs(found - wanted).max() / np.abs(wanted).max()
            if off > 1e-12:
                raise SystemExit(f"{resource}: the product is {off:.1e} off")
            runs.append(other.again)
        rates = [len(v) / s / 1e6 for s in alternately(runs)]
        named = zip(("softehl", *given.resource), rates, strict=True)
        shown = ", ".join(f"{name} {rate:.1f}" for name, rate in named)
        print(f"order {order}, {len(v)} unknowns, M/s: {shown}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
