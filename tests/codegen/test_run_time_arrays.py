"""Curves and networks of pages: their kernels against 90 digits, whatever the array."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Model, ModelError, Table, initial_weights, quadrature
from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.derive import task_outputs
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools.host_files import files
from softehl.codegen.verify import verification
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.kernel_call import ArgumentError
from softehl.runtime.kernels.run_time_arrays import ArrayDataError
from tests.codegen.hosts.workshop import errors as host_errors
from tests.codegen.hosts.workshop import folder, made
from tests.codegen.workshop import compiled

X = [[0.5], [2.0]]


def spring(write: Any, **offered: Any) -> Definition:
    """An element of one unknown u whose energy is a function of u."""
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    m.potential(write(m, m.unknown("u")))
    m.offer(product=True, **offered)
    return m.finish()


@softehl.page
def body(m: Any) -> None:
    """A network of invariants, a curve of the volume, and one in a local equation."""
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    W = m.network("W", [I1 - 3, J - 1], layers=(5, 4), convex=True, monotone=True)
    s = m.implicit("s", lambda s: s + m.table("k", 1 + s) * s**3 / 10 - (J - 1), start=0)
    m.minimise(W + m.table("k", J) * (J - 1) ** 2)
    m.weak(s * J, J)
    m.fields(W=W, s=s)
    m.offer(product=True, pseudo_load=True, fields_rate=True)


def stretched(m: Any, u: Any) -> Any:
    """Valanis and Landel: a sum of functions of one stretch, and a network of an invariant."""
    C = m.define("C", sp.Matrix([[1 + u, u / 9, 0], [u / 9, 1, u / 7], [0, u / 7, 1 + u / 5]]))

    def energy(a: Any, b: Any, c: Any) -> Any:
        total = m.table("w", a) + m.table("w", b) + m.table("w", c)
        return total + m.network("N", [a * b * c], layers=(4,), activation="tanh")

    return m.principal("P", C, energy)


@pytest.mark.parametrize(
    "definition",
    [
        body.definition("tri3"),
        pytest.param(replace(body.definition("tri3"), point=None), marks=pytest.mark.slow),
        spring(
            lambda m, u: m.network("N", [u, u**2], layers=(3,), activation="softplus_squared"),
            pseudo_load=True,
        ),
        spring(lambda m, u: m.network("N", [u], layers=(3, 2, 3), activation="sigmoid")),
        spring(stretched, tasks=["energy", "residual", "tangent"]),
    ],
    ids=["at points", "whole", "squares", "three layers", "stretches"],
)
def test_kernels_are_those_of_their_pages(definition: Definition, tmp_path: Path) -> None:
    compiled(definition, tmp_path)
    errors = verification.errors(
        definition, task_outputs.tasks(definition), tmp_path / "kernels.so"
    )
    assert set(errors) == set(task_outputs.tasks(definition))
    assert max(errors.values()) < 1e-12


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    definition = spring(lambda m, u: m.table("k", u, interpolation="spline"))
    return compiled(definition, tmp_path_factory.mktemp("table"))


def test_one_kernel_takes_any_number_of_points(table: Kernel) -> None:
    """Residual and tangent of cubics are those of the cubic, at, between and outside its points."""
    u = np.array([[-3.0], [0.0], [0.1], [1.0], [2.5], [4.0], [7.0]])
    for n in (4, 7, 200):
        x = np.linspace(0.0, 4.0, n)
        curve = Table(x, x**3 - x, outside="linear")
        R, K = table.tangent(np.empty((7, 0)), u, parameters={"k": curve})
        inside = u.clip(0.0, 4.0)
        assert pytest.approx(3 * inside**2 - 1, abs=1e-10) == R
        assert K.ravel() == pytest.approx(np.where(u == inside, 6 * u, 0.0).ravel(), abs=1e-9)


def test_a_curve_ends_in_the_chosen_way(table: Kernel) -> None:
    """Outside: constant, the tangent, or no number at all; its ends belong to it."""
    u = np.array([[-1.0], [0.0], [2.0], [3.0]])
    energies = {
        kind: table.energy(
            np.empty((4, 0)), u, parameters={"k": Table([0, 1, 2], [1, 2, 4], "linear", kind)}
        )
        for kind in ("constant", "linear", "error")
    }
    assert energies["constant"].tolist() == [1, 1, 4, 4]
    assert energies["linear"].tolist() == [0, 1, 4, 6]
    assert np.isnan(energies["error"]).tolist() == [True, False, False, True]
    assert energies["error"][1:3].tolist() == [1, 4]
    line = {"k": Table([0, 1, 2], [1, 2, 4], "linear")}
    slopes = table.residual(np.empty((3, 0)), np.array([[0.0], [1.0], [2.0]]), parameters=line)
    assert slopes.ravel().tolist() == [1, 2, 2]  # at a point that of the interval on its right


def test_tables_interpolate_as_scipy_does() -> None:
    from scipy.interpolate import CubicSpline, PchipInterpolator

    rng = np.random.default_rng(1)
    for m in (2, 3, 4, 9):
        x, y = np.cumsum(rng.uniform(0.2, 1, m)), rng.uniform(-1, 1, m)
        t = np.linspace(x[0], x[-1], 50)
        for curve, other in (
            (Table(x, y, "pchip"), PchipInterpolator(x, y)),
            (Table(x, y, "spline"), CubicSpline(x, y)),
            (Table(x, y, "spline", ends="natural"), CubicSpline(x, y, bc_type="natural")),
        ):
            assert curve(t) == pytest.approx(other(t), abs=1e-13)
            steps = 1e-6 * np.eye(m)
            for k, h in enumerate(steps):
                up, down = (curve.with_values(y + s * h).numbers for s in (1, -1))
                assert (up - down) / 2e-6 == pytest.approx(curve.slope()[:, k], abs=1e-7)


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    definition = spring(
        lambda m, u: m.network("N", [u, 2 * u], layers=(3, 2), activation="softplus")
    )
    return compiled(definition, tmp_path_factory.mktemp("network"))


def test_weights_come_as_lists_pytorch_and_flax_have_them(network: Kernel) -> None:
    """One network in four forms; its slopes are those of an evaluation in 50 digits."""
    rng = np.random.default_rng(2)
    layers = [(rng.normal(size=s), rng.normal(size=s[0])) for s in ((3, 2), (2, 3), (1, 2))]
    torch: dict[str, Any] = {}
    for k, (W, b) in enumerate(layers):
        torch |= {f"{2 * k}.weight": W, f"{2 * k}.bias": b}
    flax = {"params": {f"Dense_{k}": {"kernel": W.T, "bias": b} for k, (W, b) in enumerate(layers)}}
    flat = np.concatenate([v.ravel() for layer in layers for v in layer])

    def value(u: Any) -> Any:
        h = [u, 2 * u]
        for k, (W, b) in enumerate(layers):
            z = [mpmath.fdot(row.tolist(), h) + c for row, c in zip(W, b, strict=True)]
            h = z if k == 2 else [mpmath.log(1 + mpmath.exp(v)) for v in z]
        return h[0]

    with mpmath.workdps(50):
        for u in (0.3, -40.0, 500.0, 1e-9):
            first, second = (float(mpmath.diff(value, mpmath.mpf(u), k)) for k in (1, 2))
            for weights in (layers, torch, flax, flat):
                R, K = network.tangent(np.empty((1, 0)), np.array([[u]]), parameters={"N": weights})
                assert R[0, 0] == pytest.approx(first, rel=1e-13)
                assert K[0, 0, 0] == pytest.approx(second, rel=1e-12, abs=1e-25)


def test_a_convex_network_is_convex(tmp_path: Path) -> None:
    definition = spring(lambda m, u: m.network("N", [u, -u], convex=True, layers=(4, 4)))
    kernel = compiled(definition, tmp_path)
    weights = initial_weights(2, (4, 4), convex=True, seed=3)
    u = np.linspace(-5, 5, 41)[:, None]
    _, K = kernel.tangent(np.empty((41, 0)), u, parameters={"N": weights})
    assert (K > 0).all()
    weights[1][0][0, 0] = -0.1
    with pytest.raises(ArgumentError, match=r"weight -0\.1: those of hidden values of a convex"):
        kernel.energy(np.empty((1, 0)), u[:1], parameters={"N": weights})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (3.0, "a curve is needed, as in k="),
        (([1.0], [2.0]), "two at least; given"),
        (([1, 1], [2, 3]), "must increase: 1 follows 1"),
        (([1, np.nan], [2, 3]), "not finite"),
    ],
)
def test_points_that_are_no_curve_are_refused(table: Kernel, given: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        table.energy(np.empty((1, 0)), np.array([[1.0]]), parameters={"k": given})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([(np.ones((2, 3)), np.ones(3))], r"3 layers has weights \(to, from\)"),
        ([(np.ones((2, 3)), np.ones(3)), (np.ones((3, 2)), np.ones(2)), (np.ones((2, 1)), [1])],
         "transposed, as kernels of Flax"),
        ({"a.weight": 1.0}, "'weight' and 'bias' of every layer"),
        (np.ones(5), r"given \(5,\), or \(20,\) in one"),
        ("weights.pt", "given str"),
    ],
)  # fmt: skip
def test_weights_of_other_shapes_are_refused(network: Kernel, given: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        network.energy(np.empty((1, 0)), np.array([[1.0]]), parameters={"N": given})


def test_parameters_of_a_kernel_with_curves_are_given_by_name(table: Kernel) -> None:
    with pytest.raises(ArgumentError, match=r"by name, parameters=dict\(k=...\)"):
        table.energy(np.empty((1, 0)), np.array([[1.0]]), parameters=[1.0])
    with pytest.raises(ArgumentError, match="needs k"):
        table.energy(np.empty((1, 0)), np.array([[1.0]]), parameters={})


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda m, u: m.table("k", u, outside="zero"), "allowed: constant, linear, error"),
        (lambda m, u: m.table("k", u) + m.table("k", u**2, outside="error"), "say the same"),
        (lambda m, u: m.network("k", [u], activation="relu"), "allowed: softplus"),
        (lambda m, u: m.network("k", u), "inputs as a list"),
        (lambda m, u: m.network("k", [u], layers=(4, 0)), "must be widths > 0"),
        (lambda m, u: m.network("k", [u], convex=True, activation="tanh"), "convex activation"),
        (lambda m, u: m.table("k", u) and u, "the argument k is never used"),
    ],
)
def test_pages_say_what_there_is(write: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        spring(write)


def test_a_network_of_single_stretches_is_refused() -> None:
    definition = spring(
        lambda m, u: m.principal(
            "P", sp.diag(1 + u, 1, 1), lambda a, b, c: sum(m.network("N", [x]) for x in (a, b, c))
        )
    )
    with pytest.raises(DifferentiationError, match="symmetric functions of the stretches"):
        pipeline.compile_model(definition)


def test_hosts_that_hand_no_arrays_over_refuse() -> None:
    for target in ("abaqus", "ngsolve"):
        with pytest.raises(softehl.TargetError, match=f"k at run time, which target {target}"):
            files(spring(lambda m, u: m.table("k", u)), target)


def test_a_folder_of_c_tests_itself_with_its_arrays(tmp_path: Path) -> None:
    done = made(folder(body.definition("tri3"), "c", tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(host_errors(done.stdout)[:4]) < 1e-12
    header = (tmp_path / "body_tri3.h").read_text(encoding="utf-8")
    assert "p[0], p[1], p[2]  place in p and length of W, and 0" in header


def test_ufcx_compiles_with_arrays(tmp_path: Path) -> None:
    text = pipeline.compile_model(body.definition("tri3"), Target.UFCX).text
    assert "c[0], c[1], c[2]  place and length of W, 0" in text
    (tmp_path / "body.c").write_text(text, encoding="utf-8")
    strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run(["cc", *strict, str(tmp_path / "body.c")], check=True)


def test_tables_say_what_they_are() -> None:
    assert repr(Table([0, 1], [2, 3], "pchip")) == "<Table: 2 points from 0 to 1, pchip>"
    with pytest.raises(ArrayDataError, match="allowed: 'linear', 'pchip', 'spline'"):
        Table([0, 1], [2, 3], "cubic")
