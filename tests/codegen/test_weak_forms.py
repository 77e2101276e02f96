"""Models of users: weak forms, boundaries, dimensions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.pages.gent import gent
from tests.codegen.pages.maxwell import maxwell
from tests.codegen.pages.ogden_hex8 import ogden
from tests.codegen.pages.penalty_spring import penalty_spring
from tests.codegen.workshop import compiled, tangent_errors

# --- The pages of `tests/codegen/pages`: tangents in every branch, rigid motions, closed forms ----


SQUARE = np.array(shapes.QUAD_NODES) / 2.0
CUBE = np.array(shapes.HEX_NODES) / 2.0
OGDEN = {"mu_1": 1.0, "alpha_1": 1.3, "mu_2": -0.2, "alpha_2": -2.0, "kappa": 10.0}
GENT = {"mu": 1.2, "Jm": 5.0, "kappa": 10.0}
MAXWELL = {"mu": 1.0, "kappa": 10.0, "mu_v": 2.0, "tau": 3.0, "dt": 0.5}
AT_REST = np.array([[1.0, 1.0, 1.0, 0.0]] * 4)
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])
Made = tuple[Definition, Kernel]


def made(factory: pytest.TempPathFactory, d: Definition) -> Made:
    return d, compiled(d, factory.mktemp(d.name), "-O0")


@pytest.fixture(scope="module")
def a_gent(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, gent())


@pytest.fixture(scope="module")
def a_maxwell(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, maxwell())


@pytest.fixture(scope="module")
def an_ogden(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, ogden())


@pytest.fixture(scope="module")
def a_spring(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, penalty_spring())


def moved(X: Array, F: Array) -> Array:
    """Displacements (1, n) of the motion x = F X."""
    return (X @ F.T - X).reshape(1, -1)


# ------------------------------------------------------------------------------------------- Gent


def test_gent_closed_forms(a_gent: Made) -> None:
    """Simple shear g: sigma_xy = mu g / (1 - g^2/Jm); a rigid motion; beyond the limit."""
    _, kernel = a_gent
    X, g = SQUARE.reshape(1, 8), 0.4
    shear = moved(SQUARE, np.array([[1.0, g], [0.0, 1.0]]))
    sigma = kernel.fields_at(X, shear, parameters=GENT)[0, :, 3]
    np.testing.assert_allclose(sigma, 1.2 * g / (1 - g**2 / 5), rtol=1e-14)
    assert np.abs(kernel.residual(X, moved(SQUARE, TURN), parameters=GENT)).max() < 1e-14
    far = moved(SQUARE, np.array([[1.0, 3.0], [0.0, 1.0]]))
    assert np.isnan(kernel.energy(X, far, parameters=GENT)).all()


# ------------------------------------------------------------------------------------------ Ogden


def test_ogden_in_tension(an_ogden: Made) -> None:
    """Force on a face of the unit cube: dW/dl_1 at stretches l_1, l_2 = l_3."""
    _, kernel = an_ogden
    l1, l2 = 1.6, 0.8
    J, bar = l1 * l2 * l2, np.array([l1, l2, l2]) / (l1 * l2 * l2) ** (1 / 3)
    terms = [(OGDEN["mu_1"], OGDEN["alpha_1"]), (OGDEN["mu_2"], OGDEN["alpha_2"])]
    force = sum(mu * (bar[0] ** a - np.mean(bar**a)) / l1 for mu, a in terms)
    force += OGDEN["kappa"] * (J - 1) * l2 * l2
    u = moved(CUBE, np.diag([l1, l2, l2]))
    R = kernel.residual(CUBE.reshape(1, 24), u, parameters=OGDEN).reshape(8, 3)
    assert R[CUBE[:, 0] > 0, 0].sum() == pytest.approx(force, rel=1e-13)


# ----------------------------------------------------------------------------------------- spring


@pytest.mark.parametrize(("u", "closed"), [((0.1, 0.2), True), ((1.5, 0.2), False)])
def test_spring_in_both_branches(u: tuple[float, float], closed: bool, a_spring: Made) -> None:
    d, kernel = a_spring
    parameters = [3.0, 0.0, 0.1, 1.0]
    X, at = np.array([[0.3, 0.2]]), np.array([u])
    _, K = kernel.tangent(X, at, parameters=parameters)
    assert K.any() == closed
    if closed:
        assert max(tangent_errors(d, kernel, X, u, parameters=parameters)) <= 1e-14
    x = X[0] + u - [0.0, 0.1]
    gap = np.hypot(*x) - 1
    R = kernel.residual(X, at, parameters=parameters)[0]
    np.testing.assert_allclose(R, 3 * min(gap, 0) * x / np.hypot(*x), rtol=1e-14)
    v = np.array([[0.3, -0.7]])
    np.testing.assert_allclose(
        kernel.product(X, at, v, parameters=parameters)[0], K[0] @ v[0], rtol=1e-14
    )
    slope = kernel.derivative("r", X, at, parameters=parameters)[0]
    np.testing.assert_allclose(slope, -3 * closed * x / np.hypot(*x), rtol=1e-14)


# ---------------------------------------------------------------------------------------- Maxwell


def test_maxwell_in_closed_form(a_maxwell: Made, rng: np.random.Generator) -> None:
    """C_v is the unimodular part of C_v,old + dt/tau Cbar (Shutov et al. 2013)."""
    _, kernel = a_maxwell
    F, old = np.eye(3), AT_REST + rng.uniform(-0.1, 0.1, (4, 4))
    F[:2, :2] += rng.uniform(-0.3, 0.3, (2, 2))
    C = F.T @ F * np.linalg.det(F) ** (-2 / 3)
    found = kernel.fields_at(
        SQUARE.reshape(1, 8),
        moved(SQUARE, F[:2, :2]),
        parameters=MAXWELL,
        point_data=old[None],
    )
    for (a, b, c, d), now in zip(old, found[0], strict=True):
        step = np.array([[a, d, 0], [d, b, 0], [0, 0, c]]) + 0.5 / 3.0 * C
        step /= np.linalg.det(step) ** (1 / 3)
        np.testing.assert_allclose(now, step[[0, 1, 2, 0], [0, 1, 2, 1]], rtol=0, atol=1e-14)


# --- Divisions by zero and values that are not real on sides of branches that are never taken -----


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
    build.build(folder, extra=(*build.STRICT, "-O0"))
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


# --- Elements with any number of coordinate components: bar, triangle, hexahedron -----------------


def test_shape_functions_of_the_hexahedron() -> None:
    xi = sp.symbols("xi eta zeta", real=True)
    N = shapes.hex8(*xi)
    for a, corner in enumerate(shapes.HEX_NODES):
        assert [n.subs(dict(zip(xi, corner, strict=True))) for n in N] == [a == b for b in range(8)]
    assert sp.expand(sum(N)) == 1
    for n, gradient in zip(N, shapes.hex8_gradient(*xi), strict=True):
        assert all(sp.expand(sp.diff(n, s) - g) == 0 for s, g in zip(xi, gradient, strict=True))


@pytest.mark.parametrize("unroll", [False, True])
def test_an_element_without_coordinates(unroll: bool, tmp_path: Path) -> None:
    m = Model("placeless", nodes=1, rule=quadrature.gauss(1, 1), unroll=unroll)
    u = m.unknown("u")
    m.potential(m.integral("Pi", u**2))
    kernel = compiled(m.finish(), tmp_path)
    assert kernel.coordinates == ()
    for nothing in (np.empty((2, 0)), np.zeros((2, 2))):
        np.testing.assert_allclose(kernel.residual(nothing, np.array([[1.0], [2.0]])), [[4], [8]])


def test_coordinates_are_declared_once() -> None:
    m = Model("twice", nodes=2, rule=quadrature.gauss(1, 1))
    X = m.coordinates("X", "Y")
    assert m.coordinates("X", "Y") == X
    with pytest.raises(ModelError, match="the coordinates are X, Y already"):
        m.coordinates("X", "Y", "Z")
