"""Derivatives at and near zero: of what lengths are in, and of powers by base and exponent.

Expected are the closed forms: f'(n) / n (I - ee') + f''(n) ee' along e, and f''(0) I at zero.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl import Mesh, Study, page
from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.elements import quadrature
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import Kernel, load_kernel

Q = sp.Rational
ALONG = np.array([0.6, 0.0, 0.8])
SIZES = (0.0, 1e-300, 1e-160, 1e-90, 1e-61, 1e-20, 1e-3)
SMOOTH: dict[str, Callable[[Any, Any], Any]] = {
    "cosh": lambda n, p: sp.cosh(n),
    "parameter": lambda n, p: n**p,
    "mixed": lambda n, p: sp.sqrt(1 + n) * n**2,
    "cube": lambda n, p: n**3,
    "halves": lambda n, p: n ** Q(5, 2),
    "pieces": lambda n, p: sp.Piecewise((n**2 / 2, n < 1), (n - Q(1, 2), True)),
}
"""Energies of a length n, with f'(0) = 0; p is 2."""
KINKED: dict[str, Callable[[Any, Any], Any]] = {
    "kink": lambda n, p: n + n**2,
    "one": lambda n, p: n ** (p / 2),
}
POWERS: dict[str, tuple[Callable[[Any, Any, Any], Any], float]] = {
    "abs_halves": (lambda a, b, p: sp.Abs(a) ** Q(5, 2), 2.5),
    "abs_cube": (lambda a, b, p: sp.Abs(a) ** 3, 3.0),
    "squares": (lambda a, b, p: (a**2 + b**2) ** Q(5, 4), 2.5),
    "squares_parameter": (lambda a, b, p: (a**2 + b**2) ** (p / 2), np.nan),
}
"""Energies of |a| where b is zero, with their exponents; nan: p."""
NESTED: dict[str, tuple[Callable[[Any, Any, Any], Any], Callable[[float], float]]] = {
    "named": (
        lambda m, n, p: n**2 + p * n**2 + m.define("w", n**2) ** Q(3, 2),
        lambda p: 2 + 2 * p,
    ),
    "powers": (lambda m, n, p: n**2 + (n**p) ** Q(3, 2), lambda p: 2),
    "cosh_of_root": (lambda m, n, p: n**2 + sp.cosh(sp.sqrt(m.define("w", n**2))), lambda p: 3),
    "root_of_powers": (
        lambda m, n, p: n**2 + sp.sqrt((n**p) ** Q(3, 2) + n**4),
        lambda p: 4 if p > 8 / 3 else 0,
    ),
    "log_in_pieces": (
        lambda m, n, p: (
            n**2 + sp.Piecewise((sp.log(1 + m.define("w", n**2) ** Q(3, 2)), n < 1), (n, True))
        ),
        lambda p: 2,
    ),
    "nested_kink": (lambda m, n, p: n**2 + sp.sqrt(m.define("w", n**2)), lambda p: 0),
    "nested_halves": (lambda m, n, p: n**2 + m.define("w", n**2) ** Q(3, 4), lambda p: 0),
}
"""Energies with f'' = inf * 0 at zero, and the closed form of f''(0); 0 where it is infinite."""


class Plain:
    """A model whose names are their values."""

    def define(self, label: str, value: Any) -> Any:
        return value


def of_nested(name: str, f: Callable[[Any, Any, Any], Any]) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    s = [m.unknown(u) for u in "abc"]
    (p,) = m.parameters(p="exponent")
    m.potential(f(m, m.norm(s), p) + p * s[1] ** 4)
    return m


def of_length(name: str, f: Callable[[Any, Any], Any]) -> Model:
    m = of_nested(name, lambda m, n, p: f(n, p))
    m.offer(pseudo_load=True, product=True)
    return m


def of_power(name: str, f: Callable[[Any, Any, Any], Any]) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    (p,) = m.parameters(p="exponent")
    m.potential(f(a, b, p) + p * b**4)
    m.offer(pseudo_load=True, derivatives=[p])
    return m


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("zero")
    models = [of_length(k, f) for k, f in (SMOOTH | KINKED).items()]
    models += [of_power(k, f) for k, (f, _) in POWERS.items()]
    models += [of_nested(k, f) for k, (f, _) in NESTED.items()]
    made = [pipeline.compile_model(m.finish(), Target.SIMD) for m in models]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O1"))
    return folder


def at(kernel: Kernel, u: np.ndarray, p: float) -> tuple[np.ndarray, np.ndarray]:
    R, K = kernel.tangent(np.empty((1, 0)), u[None], parameters=[p])
    return R[0], K[0]


def slopes(f: Callable[[Any, Any], Any], n: float, p: float) -> tuple[float, float, float]:
    """f', f'' and f'/n by SymPy in 60 digits; the limits at zero."""
    x = sp.Symbol("x", positive=True)
    first, second = (sp.diff(f(x, sp.nsimplify(p)), x, k) for k in (1, 2))
    size = sp.Rational(n) if n else sp.Rational(1, 10**320)
    with mpmath.workdps(60):
        d, dd = (e.subs(x, size).evalf(60, maxn=2000) for e in (first, second))
        return float(d), float(dd), float(d / size)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("size", SIZES)
def test_the_tangent_of_a_smooth_function_of_a_length(
    kernels: Path, name: str, size: float
) -> None:
    R, K = at(load_kernel(name, kernels), size * ALONG, 2.0)
    first, second, ratio = slopes(SMOOTH[name], size, 2.0)
    outer = np.outer(ALONG, ALONG)
    # below 2^-200 f' is f'' n; where f''(0) = 0, that is right in size only
    least = 1e-30 if size < 2.0**-200 else 1e-15 * ratio
    np.testing.assert_allclose(R, first * ALONG, rtol=1e-12, atol=max(least * size, 1e-300))
    expected = ratio * (np.eye(3) - outer) + second * outer
    np.testing.assert_allclose(K, expected, rtol=1e-12, atol=least)


@pytest.mark.parametrize("name", KINKED)
def test_a_kink_has_zero_derivatives_at_zero_and_those_of_the_length_elsewhere(
    kernels: Path, name: str
) -> None:
    kernel = load_kernel(name, kernels)
    assert [not v.any() for v in at(kernel, np.zeros(3), 2.0)] == [True, True]
    for size in (1e-90, 1e-8, 1.0):
        R, _ = at(kernel, size * ALONG, 2.0)
        first, _, _ = slopes(KINKED[name], size, 2.0)
        np.testing.assert_allclose(R, first * ALONG, rtol=1e-14)


@pytest.mark.parametrize("name", NESTED)
@pytest.mark.parametrize("p", [2.0, 3.0, 4.0])
def test_a_power_of_a_power_has_the_tangent_of_its_limit(
    kernels: Path, name: str, p: float
) -> None:
    kernel, bent = load_kernel(name, kernels), NESTED[name][1](p)
    smooth = [1e-300, 1e-120, 1e-70] if bent else []  # of a kink, the tangent is infinite there
    for size in (0.0, *smooth):
        R, K = at(kernel, size * ALONG, p)
        np.testing.assert_allclose(R, bent * size * ALONG, rtol=1e-6, atol=1e-306)
        np.testing.assert_allclose(K, bent * np.eye(3), rtol=1e-6, atol=1e-14)
    size = 2.0**-20
    R, _ = at(kernel, size * ALONG, p)
    x = sp.Symbol("x", positive=True)
    energy = NESTED[name][0](Plain(), x, sp.nsimplify(p))
    np.testing.assert_allclose(R, float(sp.diff(energy, x).subs(x, Q(size))) * ALONG, rtol=1e-12)


@pytest.mark.parametrize("name", POWERS)
@pytest.mark.parametrize("size", [0.0, 1e-20, -1e-8, 0.5])
@pytest.mark.parametrize("p", [2.0, 2.5, 3.0, 4.0])
def test_powers_by_base_and_exponent(kernels: Path, name: str, size: float, p: float) -> None:
    kernel, e = load_kernel(name, kernels), POWERS[name][1]
    n = p if np.isnan(e) else e
    u = np.array([size, 0.0])
    R, K = at(kernel, u, p)
    d = abs(size)
    assert R[0] == pytest.approx(n * d ** (n - 1) * np.sign(size), rel=1e-13)
    assert K[0, 0] == pytest.approx(n * (n - 1) * d ** (n - 2), rel=1e-13)
    across = n * d ** (n - 2) if "squares" in name else 0.0
    assert K[1, 1] == pytest.approx(across, rel=1e-13)
    by_p = d ** (n - 1) * np.sign(size) * (1 + n * np.log(d)) if np.isnan(e) and d else 0.0
    nowhere = np.empty((1, 0))
    found = kernel.derivative("p", nowhere, u[None], parameters=[p])
    assert found[0, 0] == pytest.approx(by_p, rel=1e-12)
    moved = kernel.pseudo_load(nowhere, u[None], np.array([[1.0]]), parameters=[p])
    np.testing.assert_allclose(moved, found, rtol=1e-13)


@page
def by_norm(m: Fields) -> None:
    """Conduction, written with the norm of the gradient."""
    T = m.scalar("T")
    k, p = m.parameters(k="conductivity", p="exponent")
    n = m.norm(m.grad(T))
    m.minimise(k / 2 * n**2 + k / 2 * n**p - T)


def conduction() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
    study.add("body", by_norm, k=0.5, p=2.0)
    study.fix("left", T=0.0)
    return study


def test_conduction_by_a_norm_is_solved_from_rest() -> None:
    """k (n^2 + n^2) / 2 with k = 1/2 is one conductivity: T = 2 x - x^2 / 2."""
    study = conduction()
    x, result = study.mesh.points[:, 0], study.solve()
    np.testing.assert_allclose(result.values("T"), 2 * x - x**2 / 2, atol=1e-13)
    assert result.iterations == 1


def test_sensitivities_at_points_without_a_gradient() -> None:
    """T is as 1 / k; the exponent and the places of nodes have sensitivities, too."""
    result = conduction().solve()
    found = result.sensitivity("T", at=(2.0, 0.5), by={"body": ["k", "p"], "nodes": ["x"]})
    assert found["body", "k"] == pytest.approx(-4.0, rel=1e-12)
    assert np.isfinite(found["body", "p"])
    # moving the body sideways changes nothing
    assert np.sum(found["nodes", "x"]) == pytest.approx(0.0, abs=1e-12)
