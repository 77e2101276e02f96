"""Divisions by zero and values that are not real on sides of branches that are never taken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import Kernel, load_kernel

ROOT = sp.Rational(1, 2)


def power_hardening() -> Model:
    """Yield limit s + K a^(1/2) of a bar, with E = K = s = 1 and nothing hardened yet."""
    m = Model("power_hardening", nodes=1, rule=quadrature.point_rule())
    e = m.unknown("e")
    (old,) = m.data(old="plastic strain before")
    f = m.define("f", e - 1 - old**ROOT)
    g = m.implicit(
        "g",
        lambda g: sp.Piecewise((e - g - 1 - (old + g) ** ROOT, f > 0), (g, True)),
        start=sp.Piecewise((f, f > 0), (0, True)),
    )
    m.weak_form([(e - g, e)])
    return m


def armstrong_frederick() -> Model:
    """Back stress X' = H g' sign - b X g', with E = b = s = 1 and H = 1/2."""
    m = Model("armstrong_frederick", nodes=1, rule=quadrature.point_rule())
    e = m.unknown("e")
    (old,) = m.data(old="back stress before")
    f = m.define("f", sp.Abs(e - old) - 1)
    way = sp.sign(e - old)

    def equations(s: Any) -> list[Any]:
        g, X = s
        flow = sp.Abs(e - X - g * way) - 1
        back = (X - old - g * way / 2) / (1 + g) + X * g / (1 + g)
        return [
            sp.Piecewise((flow, f > 0), (g, True)),
            sp.Piecewise((back, f > 0), (X - old, True)),
        ]

    g, _ = m.implicit("s", equations, start=[0, old])
    m.weak_form([(e - g * way, e)])
    return m


def direction(guarded: bool) -> Model:
    m = Model(f"direction_{guarded}", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    n = m.norm([x, y])
    m.potential((sp.Piecewise((x / n, n > 0), (0, True)) if guarded else x / n) * y + x**2)
    return m


def own_root() -> Model:
    """SymPy makes zoo of 1 / r on the side where r is 0."""
    m = Model("own_root", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    r = sp.Piecewise((sp.sqrt(x), x > 0), (0, True))
    m.potential(sp.Piecewise((y**2 / r, x > 0), (y**2, True)) + x**2)
    return m


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sides")
    models = [power_hardening(), armstrong_frederick(), direction(True), direction(False)]
    made = [pipeline.compile_model(m.finish()) for m in (*models, own_root())]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O1"))
    return folder


def at(kernel: Kernel, u: list[float], **given: Any) -> tuple[Any, Any]:
    R, K = kernel.tangent(np.empty((1, 0)), np.array([u]), **given)
    return R[0], K[0]


@pytest.mark.parametrize(
    ("name", "stress", "modulus"),
    [
        # e = 2: g + g^(1/2) = 1; the slope is E H / (E + H), H = g^(-1/2) / 2
        ("power_hardening", (1 + 5**0.5) / 2, 1 / 5**0.5),
        # e = 2: X (1 + g) = g / 2, 2 - X - g = 1
        ("armstrong_frederick", None, None),
    ],
)
def test_return_mappings_that_divide_by_what_is_zero_before_flow(
    kernels: Path, name: str, stress: float | None, modulus: float | None
) -> None:
    kernel, old = load_kernel(name, kernels), {"data": [[0.0]]}
    R, K = at(kernel, [0.25], **old)
    assert (R[0], K[0, 0]) == (0.25, 1.0)
    if stress is None:  # X (1 + g) = g / 2 and X + g = 1: g^2 + g / 2 = 1
        g = (-0.5 + (0.25 + 4) ** 0.5) / 2
        stress, modulus = 2 - g, 1 - 1 / (1 + 0.5 / (1 + g) ** 2)
    R, K = at(kernel, [2.0], **old)
    assert R[0] == pytest.approx(stress, rel=1e-12)
    assert K[0, 0] == pytest.approx(modulus, rel=1e-9)


def test_a_quotient_by_a_norm_is_refused_nowhere(kernels: Path) -> None:
    for name in ("direction_True", "direction_False"):
        R, _ = at(load_kernel(name, kernels), [0.3, 0.4])
        np.testing.assert_allclose(R, [0.6 + 0.4**3 / 0.125, 0.3**3 / 0.125], rtol=1e-13)
    R, K = at(load_kernel("direction_True", kernels), [0.0, 0.0])
    assert not R.any()
    assert K.tolist() == [[2.0, 0.0], [0.0, 0.0]]
    assert np.isnan(at(load_kernel("direction_False", kernels), [0.0, 0.0])[0]).any()


def test_the_side_on_which_sympy_divides_by_zero_is_not_taken(kernels: Path) -> None:
    kernel = load_kernel("own_root", kernels)
    R, K = at(kernel, [0.25, 0.5])
    np.testing.assert_allclose(R, [0.5 - 1.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(K, [[2 + 6.0, -4.0], [-4.0, 4.0]], rtol=1e-14)
    R, K = at(kernel, [-1.0, 0.5])
    assert (R.tolist(), K.tolist()) == ([-2.0, 1.0], [[2.0, 0.0], [0.0, 2.0]])


def right_half(f: Callable[[Any], Any]) -> Callable[[Fields], None]:
    def right(m: Fields) -> None:
        T, x = m.scalar("T"), m.parent[0]
        m.minimise(T**2 / 2 - T * sp.Piecewise((f(x), x > 0), (0, True)))

    return right


@pytest.mark.parametrize("f", [sp.log, sp.sqrt, sp.cbrt, lambda x: x**ROOT / (1 - sp.sqrt(x))])
def test_a_guarded_function_of_the_parent_coordinates(f: Callable[[Any], Any]) -> None:
    kernel = softehl.load_kernel(softehl.page(right_half(f)), cell="quad4")
    X = np.array([[-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0]])
    xi = float(sp.N(f(sp.sqrt(sp.Rational(1, 3))), 30))  # at the two points on the right
    shares = np.array([1 - 3**-0.5, 1 + 3**-0.5]) / 2
    R = kernel.residual(X, np.zeros((1, 4)))[0]
    np.testing.assert_allclose(R, -xi * shares[[0, 1, 1, 0]], rtol=1e-14)


def test_a_guarded_division_by_zero_at_a_point_of_the_rule() -> None:
    @softehl.page(degree=5)
    def sinc(m: Fields) -> None:
        T, x = m.scalar("T"), m.parent[0]
        m.minimise(T**2 / 2 - T * sp.Piecewise((sp.sin(x) / x, sp.Ne(x, 0)), (1, True)))

    kernel = softehl.load_kernel(sinc, cell="quad4")
    X = np.array([[-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0]])
    x = 0.6**0.5
    total = 2 * (10 / 9 * np.sin(x) / x + 8 / 9)
    assert -kernel.residual(X, np.zeros((1, 4))).sum() == pytest.approx(total, rel=1e-14)
