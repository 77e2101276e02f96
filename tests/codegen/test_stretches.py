"""Isotropic energies of principal stretches: exact where stretches are equal, nearly so, or not."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl import load_kernel as load
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build
from softehl.codegen.verify import verification
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.workshop import compiled, element_state, off, tangent_errors, write

PARAMETERS = (0.7, 1.7, 0.3)
GAPS = (0.3, 0.052, 0.048, 1e-3, 1e-6, 1e-9, 1e-12, 0.0)
ENTRIES = ("c11", "c22", "c33", "c12", "c13", "c23")


def stretches(energy: Any = None) -> Definition:
    """The six entries of C are the unknowns; Ogden, Hencky and volumetric terms together."""
    m = Model("stretches", nodes=1, rule=quadrature.point_rule())
    a, b, c, d, e, f = (m.unknown(n) for n in ENTRIES)
    mu, alpha, beta = m.parameters(mu="modulus", alpha="exponent", beta="modulus")
    C = sp.Matrix([[a, d, e], [d, b, f], [e, f, c]])

    def mixed(x: Any, y: Any, z: Any) -> Any:
        ogden = mu / alpha * (x**alpha + y**alpha + z**alpha - 3)
        return ogden + beta * sum(sp.log(v) ** 2 for v in (x, y, z)) + (x * y * z - 1) ** 2

    W = m.principal("W", C, energy or mixed)
    m.potential(W)
    m.fields(W=W, mu=mu, alpha=alpha, beta=beta)  # another energy may leave them unused
    m.offer(derivatives=[alpha])
    return m.finish()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(stretches(), tmp_path_factory.mktemp("stretches"))


def unknowns(C: Array) -> list[float]:
    return [float(C[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def turned(*squares: float) -> Array:
    Q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    C: Array = Q @ np.diag(squares) @ Q.T
    return (C + C.T) / 2


def errors(kernel: Kernel, C: Array) -> tuple[float, float]:
    found: tuple[float, float] = tangent_errors(
        stretches(), kernel, (), unknowns(C), parameters=PARAMETERS
    )
    return found


@pytest.mark.parametrize("gap", GAPS)
def test_two_and_three_nearly_equal_stretches(gap: float, kernel: Kernel) -> None:
    """Relative to the largest entry, 1e-14 is reached at every gap."""
    assert max(errors(kernel, turned(1.44 * (1 + gap), 1.44, 0.7))) <= 1e-14
    assert max(errors(kernel, turned(1.3 * (1 + gap), 1.3, 1.3 * (1 - gap / 2)))) <= 1e-14


def test_undeformed_and_diagonal_states(kernel: Kernel) -> None:
    for C in (np.eye(3), np.diag([1.2, 1.2, 0.5]), np.diag([0.4, 2.5, 0.4])):
        assert max(errors(kernel, C)) <= 1e-14
    R, K = kernel.tangent(np.zeros((1, 0)), np.array([unknowns(np.eye(3))]), parameters=PARAMETERS)
    np.testing.assert_allclose(R[0, :3], 0.35, rtol=1e-14)  # mu/2: Hencky and volume are at rest
    assert np.abs(R[0, 3:]).max() == 0
    assert np.linalg.matrix_rank(K[0]) == 6


def test_large_stretches(kernel: Kernel) -> None:
    assert max(errors(kernel, turned(30.0, 0.05, 0.6))) <= 1e-13


def test_energy_and_its_slope_by_the_exponent(kernel: Kernel) -> None:
    """Uniaxial closed forms: d/dalpha of dW/dC_11 = mu/2 x^(alpha - 2)."""
    x = 1.3
    u = np.array([unknowns(np.diag([x**2, 1.0, 1.0]))])
    mu, alpha, beta = PARAMETERS
    W = mu / alpha * (x**alpha - 1) + beta * np.log(x) ** 2 + (x - 1) ** 2
    nowhere = np.zeros((1, 0))
    np.testing.assert_allclose(kernel.energy(nowhere, u, parameters=PARAMETERS), W, rtol=1e-14)
    slope = kernel.derivative("alpha", nowhere, u, parameters=PARAMETERS)
    np.testing.assert_allclose(slope[0, 0], mu / 2 * x ** (alpha - 2) * np.log(x), rtol=1e-14)
    C = turned(1.3, 1.3 * (1 + 1e-7), 0.8)
    at = element_state(kernel, (), unknowns(C), parameters=PARAMETERS)
    found = kernel.derivative("alpha", nowhere, np.array([unknowns(C)]), parameters=PARAMETERS)
    assert off(found[0], Oracle(stretches()).derivative(at, "parameters", 1)) <= 1e-14


def test_a_matrix_that_is_not_positive_definite_is_a_failure(kernel: Kernel) -> None:
    u = np.array([unknowns(np.diag([1.0, 2.0, c])) for c in (1.0, -1.0, 0.0)])
    R, K = kernel.tangent(np.zeros((3, 0)), u, parameters=PARAMETERS)
    assert np.isfinite(R[0]).all()
    assert np.isnan(R[1:]).all()
    assert np.isnan(K[1:]).all()


def test_the_rules_of_divided_differences_are_needed(tmp_path: Path) -> None:
    """With quotients of close values alone the tangent is far off: the oracle says so."""
    write(stretches(), tmp_path)
    source = tmp_path / "stretches.c"
    text = source.read_text()
    assert text.count("0.25 * (fabs") == 2  # logarithm and exponential function
    source.write_text(text.replace("0.25 * (fabs", "0.0 * (fabs"))
    build.build(tmp_path, extra=("-O0",))
    naive = load_kernel("stretches", tmp_path)
    assert errors(naive, turned(1.44 * (1 + 1e-9), 1.44, 0.7))[1] > 1e-9


def shear(kernel: Kernel, a: float, b: float, c: float) -> tuple[float, mpmath.mpf, mpmath.mpf]:
    """d2W/dC_12^2 at diagonal C, whose eigenvalues have no error: 2 (w_a - w_b) / (c_a - c_b).

    Also c_a and c_b, exactly.
    """
    C = np.diag(np.square([a, b, c]))
    K = kernel.tangent(np.zeros((1, 0)), np.array([unknowns(C)]))[1]
    return float(K[0, 3, 3]) / 2, mpmath.mpf(C[0, 0]), mpmath.mpf(C[1, 1])


def of_stretches(name: str, energy: Any, folder: Path, *, inner: bool = False) -> Kernel:
    """Kernel of an energy without parameters; with `inner`, a function of the model too."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    a, b, c, d, e, f = (m.unknown(n) for n in ENTRIES)
    C = sp.Matrix([[a, d, e], [d, b, f], [e, f, c]])
    m.potential(m.principal("W", C, energy(m) if inner else energy))
    return compiled(m.finish(), folder)


SMOOTH = (
    *("exp", "log", "sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "asinh", "erf", "erfc"),
    *("sqrt", "cbrt"),
)
"""Functions of a stretch; others need another argument."""
OTHERS: dict[str, Callable[[Any], Any]] = {
    "asin": lambda x: x / 4,
    "acos": lambda x: (x - 2) / 4,
    "atanh": lambda x: x / 4,
    "acosh": lambda x: x + 1,
}


def every(library: Any, x: Any) -> Any:
    """A sum of all functions of SymPy or mpmath that a page may use, and powers of all kinds."""
    total = sum(getattr(library, f)(x) for f in SMOOTH)
    total += sum(getattr(library, f)(argument(x)) for f, argument in OTHERS.items())
    powers = x**7 + 1 / x**3 + library.root(1 + x**2, 7) ** 5 + 1 / library.root(x, 3) ** 2
    return total + powers + library.atan2(x, x**2 + 2)


def test_every_function_at_every_gap(tmp_path: Path) -> None:
    """Against a quotient in 60 digits; every term is of the size of the sum or some per cent."""
    kernel = of_stretches("every", lambda *s: sum(every(sp, x) for x in s), tmp_path)
    with mpmath.workdps(60):

        def first(c: Any) -> Any:
            return mpmath.diff(lambda c: every(mpmath, mpmath.sqrt(c)), c)

        for gap in (0.4, 0.06, 1e-2, 1e-3, 1e-5, 1e-8, 1e-11, 2e-16, 0.0):
            found, a, b = shear(kernel, 1.3, 1.3 * (1 + gap), 0.8)
            right = (first(a) - first(b)) / (a - b) if gap else mpmath.diff(first, a)
            assert abs(found / right - 1) < 3e-15, gap


def test_a_condition_between_two_stretches(tmp_path: Path) -> None:
    """Split of tension and compression: a quotient where one side has no stress, for any gap."""
    half = sp.Rational(1, 2)
    kernel = of_stretches(
        "split", lambda *s: 2 * sum(sp.Max((x**2 - 1) * half, 0) ** 2 for x in s), tmp_path
    )
    for gap in (0.3, 0.03, 1e-3, 1e-5):
        for a, b in ((1 + gap, 1 - gap / 3), (1 - gap, 1 + gap), (1 + gap, 1 + gap / 2)):
            found, x, y = shear(kernel, a, b, 1.01)
            right = (max(x - 1, 0) - max(y - 1, 0)) / (x - y)
            assert abs(found - right) < 1e-15
    for c in (0.9, 1.1):
        assert shear(kernel, c, c, 1.01)[0] == (c > 1)


def test_near_a_limiting_stretch(tmp_path: Path) -> None:
    """-sum ln(1 - l / 2): 1 - l / 2 has lost a digit or two of l, and nothing else is lost."""
    kernel = of_stretches("limiting", lambda *s: -sum(sp.log(1 - x / 2) for x in s), tmp_path)
    with mpmath.workdps(60):
        for a, b in ((1.9, 1.87), (1.96, 1.93), (1.99, 1.945), (1.999, 1.998), (1.9999, 1.9)):
            found, x, y = shear(kernel, a, b, 1.2)
            first = [1 / (2 * mpmath.sqrt(c) * (2 - mpmath.sqrt(c))) for c in (x, y)]
            right = (first[0] - first[1]) / (x - y)
            lost = 1 / (2 - a) + 1 / (2 - b)
            assert abs(found / right - 1) < 2**-52 * (4 + lost), (a, b)


def test_local_unknowns_of_a_stretch(tmp_path: Path) -> None:
    """s^3 + s = l - 1, or 2 s = l - 1 in compression, solved in the energy s l."""

    def energy(m: Model) -> Any:
        def one(x: Any) -> Any:
            def g(s: Any) -> Any:
                return sp.Piecewise((s**3 + s - x + 1, x > 1), (2 * s - x + 1, True))

            return x * m.implicit(f"s_{next(numbers)}", g, start=x - 1)

        numbers = iter(range(3))
        return lambda a, b, c: one(a) + one(b) + one(c)

    kernel = of_stretches("solved", energy, tmp_path, inner=True)

    def first(c: Any) -> Any:
        x = mpmath.sqrt(c)
        if x <= 1:
            return (2 * x - 1) / (4 * x)
        s = mpmath.findroot(lambda s: s**3 + s - x + 1, x - 1)
        return (s + x / (3 * s**2 + 1)) / (2 * x)

    with mpmath.workdps(40):
        for a, b in ((1.3, 1.25), (1.25 * (1 + 1e-9), 1.25), (1.2, 0.7), (1.001, 0.999)):
            found, x, y = shear(kernel, a, b, 0.8)
            assert abs(found / ((first(x) - first(y)) / (x - y)) - 1) < 1e-14, (a, b)


def test_what_is_no_isotropic_energy_is_refused() -> None:
    with pytest.raises(ModelError, match="W: the energy changes when two stretches are exchanged"):
        stretches(lambda x, y, z: x + 2 * y + z)
    with pytest.raises(ModelError, match="exchanged"):
        stretches(lambda x, y, z: (x - y) * (y - z) * (z - x))
    with pytest.raises(ModelError, match="exchanged"):  # only where a stretch is above 3
        stretches(lambda x, y, z: x + y + z + sp.Max(x - 3, 0) ** 2)
    m = Model("flat", nodes=1, rule=quadrature.point_rule())
    with pytest.raises(ModelError, match=r"C has shape \(2, 2\), must be \(3, 3\)"):
        m.principal("W", sp.eye(2), lambda x, y, z: x + y + z)


def test_a_matrix_that_is_not_symmetric_and_energies_in_energies_are_refused() -> None:
    m = Model("skew", nodes=1, rule=quadrature.point_rule())
    F = sp.Matrix(3, 3, [m.unknown(f"F_{k}") for k in range(9)])

    def total(a: Any, b: Any, c: Any) -> Any:
        return a + b + c

    with pytest.raises(ModelError, match=r"V: C is not symmetric, C\[0, 1\] is not C\[1, 0\]"):
        m.principal("V", m.define("F", F), total)
    C = F.T * F
    with pytest.raises(ModelError, match=r"V: write m.principal\('V', C, lambda a, b, c: ...\)"):
        m.principal("V", total)
    with pytest.raises(ModelError, match="U: its energy holds an energy of other stretches"):
        m.principal("U", C, lambda a, b, c: m.principal("V", a * b * c * sp.eye(3), total))


def test_the_derivative_by_a_matrix_is_symmetric(tmp_path: Path) -> None:
    """W = tr(U)^3 / 3, S = dW/dC = tr(U)^2 U^-1 / 2; entries of C have nine names or six."""
    m = Model("by_matrix", nodes=1, rule=quadrature.point_rule())
    F = sp.Matrix(3, 3, [m.unknown(f"F_{k}") for k in range(9)])
    C = m.define("C", F.T * F)
    six = {(i, j): m.define(f"c_{i}{j}", (F.T * F)[i, j]) for i in range(3) for j in range(i, 3)}
    C_6 = sp.Matrix(3, 3, lambda i, j: six[min(i, j), max(i, j)])

    def energy(a: Any, b: Any, c: Any) -> Any:
        return (a + b + c) ** 3 / 3

    W, V = m.principal("W", C, energy), m.principal("V", C_6, energy)
    S, T = m.derivative("S", W, C), m.derivative("T", V, C_6)
    m.potential(W + V)
    m.fields(**{f"{A}_{k}": v for A, B in (("S", S), ("T", T)) for k, v in enumerate(B)})
    d = m.finish()
    kernel = compiled(d, tmp_path)
    F_at = np.array([[1.1, 0.2, 0.1], [-0.1, 0.9, 0.15], [0.05, 0.02, 1.2]])
    squares, N = np.linalg.eigh(F_at.T @ F_at)
    U = np.sqrt(squares)
    right = N @ np.diag(U.sum() ** 2 / (2 * U)) @ N.T
    at = np.zeros((1, 0)), F_at.reshape(1, 9)
    found = kernel.fields_at(*at).reshape(2, 3, 3)
    np.testing.assert_allclose(found, [right, right], rtol=0, atol=1e-14)
    np.testing.assert_allclose(kernel.residual(*at).reshape(3, 3), 4 * F_at @ right, atol=1e-13)
    checked = verification.check(d, ("residual", "fields"), tmp_path / build.LIBRARY, seconds=60)
    assert max(checked.errors.values()) <= verification.BOUND


def test_third_derivatives_at_every_gap() -> None:
    """D^3 W[a, b, .] of Ogden, Hencky and volume by mixed differences in 80 digits."""
    kernel = load(stretches(), derivatives=2)
    generator = np.random.default_rng(7)
    a, b = generator.normal(size=(2, 6))
    direction = np.concatenate([np.zeros(3), a, b, np.zeros(6)])[None]

    def energy(entries: Any) -> Any:
        p, q, r, d, e, f = entries
        C = mpmath.matrix([[p, d, e], [d, q, f], [e, f, r]])
        x = [mpmath.sqrt(c) for c in mpmath.eigsy(C, eigvals_only=True)]
        mu, alpha, beta = map(mpmath.mpf, PARAMETERS)
        hencky = beta * sum(mpmath.log(v) ** 2 for v in x)
        return mu / alpha * (sum(v**alpha for v in x) - 3) + hencky + (x[0] * x[1] * x[2] - 1) ** 2

    def mixed(C: list[float], k: int) -> float:
        step, total = mpmath.mpf(10) ** -15, 0
        for signs in itertools.product((1, -1), repeat=3):
            r, s, t = (step * sign for sign in signs)
            moved = [
                mpmath.mpf(v) + r * mpmath.mpf(x) + s * mpmath.mpf(y) + t * (i == k)
                for i, (v, x, y) in enumerate(zip(C, a, b, strict=True))
            ]
            total += int(np.prod(signs)) * energy(moved)
        return float(total / (2 * step) ** 3)

    states = [turned(1.44 * (1 + gap), 1.44, 0.7) for gap in GAPS]
    states += [turned(1.3 * (1 + gap), 1.3, 1.3 * (1 - gap / 2)) for gap in GAPS]
    states += [np.eye(3), np.diag([1.2, 1.2, 0.5]), turned(30.0, 0.05, 0.6)]
    with mpmath.workdps(80):
        for state in states:
            C = unknowns(state)
            found = kernel.adjoint_rate(
                np.zeros((1, 0)), np.array([C]), direction, parameters=np.array(PARAMETERS)
            )[0, 3:]
            expected = np.array([mixed(C, k) for k in range(6)])
            bound = 1e-12 if state[0, 0] > 10 else 1e-14
            assert np.abs(found - expected).max() <= bound * np.abs(expected).max(), state
