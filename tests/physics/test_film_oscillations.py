"""The zigzag of the film thickness and the upwinding that damps it, against theory."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from softehl.runtime.discretisation import quadrature
from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.calling import Part, assemble, fitted_order

# --- The zigzag of the film thickness in a linear model, against its recursion in closed form -----


ROD, OIL, G, H, DX = 25.0, 6.59e-8, 3.66, 6e-4, 0.05
BED = 2 * np.pi * G
RING = 2 * np.pi * (ROD + H)


@dataclass(frozen=True)
class Bed:
    """The linear model: Pe of the state, strength c, order of the pressures, segments."""

    peclet: float
    strength: float
    order: int = 2
    count: int = 60

    @property
    def speed(self) -> float:
        """U at which a film of thickness H has the given Pe."""
        return 2 * self.peclet * np.pi * G * H**3 / (3 * OIL * DX**2)

    @property
    def share(self) -> float:
        """c delta."""
        return self.strength * self.peclet**2 / (9 + self.peclet**2)

    def response(self, load: np.ndarray) -> np.ndarray:
        """Changes of the nodal film thickness (nodes,) under nodal loads (nodes,), N/mm."""
        n, order = self.count, self.order
        first = 2 * (n + 1)
        ends = np.arange(n)[:, None] + np.arange(2)
        moved = (2 * ends[:, :, None] + np.arange(2)).reshape(n, 4)
        maps = np.hstack([moved, first + order * np.arange(n)[:, None] + np.arange(order + 1)])
        nodes = np.stack([DX * np.arange(n + 1), np.full(n + 1, ROD + H)], axis=1)
        given = nodes[ends].reshape(n, 4), maps
        rule = quadrature.film_rule(order)
        film = Part("film", *given, (ROD, self.speed, OIL, 0.0, 0.0, 1.0, 0.0), rule=rule)
        oil = (ROD, self.speed, OIL, G, self.strength, 1.0)
        x = np.zeros(first + order * n + 1)
        _, K = assemble([film, Part("film_upwind", *given, oil, rule=rule)], x)
        radial = 2 * np.arange(n + 1) + 1
        K[radial, radial] += BED * RING
        free = np.concatenate([radial, np.arange(first + 1, len(x) - 1)])
        x[radial] = load * RING
        return np.asarray(np.linalg.solve(K[np.ix_(free, free)], x[free])[: n + 1])

    def roots(self) -> np.ndarray:
        """Roots of the recursion h_i ~ rho^i, by rising magnitude.

        (rho + 1)(rho^2 + 10 rho + 1) + c delta (rho - 1)^3 = 24 s rho (rho - 1), with
        s = k H^3 / (12 eta ubar dx^2) = k / (4 pi G Pe).
        """
        s = BED / (4 * np.pi * G * self.peclet)
        a = np.array([1.0, 11, 11, 1]) + self.share * np.array([1.0, -3, 3, -1])
        found = np.roots(a - 24 * s * np.array([0.0, 1, -1, 0]))
        return np.asarray(found[np.argsort(np.abs(found))])

    def upstream(self) -> np.ndarray:
        """Film thickness upstream of a force at one node, the node itself last."""
        load = np.zeros(self.count + 1)
        load[self.count // 2] = 1.0
        return self.response(load)[: self.count // 2 + 1]


def error_of_the_recursion(bed: Bed, roots: np.ndarray) -> float:
    """How far (E - rho_2)(E - rho_3) h is from zero, relative to its terms; E: the next node."""
    steps = np.diff(bed.upstream())[-9:-1]
    one, two = -(roots[1] + roots[2]).real, (roots[1] * roots[2]).real
    terms = steps[2:], one * steps[1:-1], two * steps[:-2]
    return float(np.max(np.abs(sum(terms)) / sum(np.abs(t) for t in terms)))


BEDS = [Bed(pe, c, m) for pe in (2.0, 10.0, 40.0) for c in (0.0, 0.5) for m in (2, 4)]


@pytest.mark.parametrize("bed", BEDS, ids=str)
def test_the_zigzag_grows_downstream_by_the_root_of_the_recursion(bed: Bed) -> None:
    """Upstream of a disturbance h has the two roots outside of the unit circle, and no others."""
    assert error_of_the_recursion(bed, bed.roots()) < 1e-4
    wrong = replace(bed, strength=bed.strength + 0.02).roots()
    assert error_of_the_recursion(bed, wrong) > 1e-3


@pytest.mark.parametrize("bed", [Bed(20.0, 0.0), Bed(40.0, 0.0), Bed(40.0, 0.2)], ids=str)
def test_far_from_its_source_the_zigzag_alone_is_left(bed: Bed) -> None:
    steps = np.diff(bed.upstream())[-13:-7]
    root = bed.roots()[1]
    assert root.imag == 0
    np.testing.assert_allclose(steps[1:] / steps[:-1], root.real, rtol=1e-3)
    assert -1.5 < root.real < -1


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_every_order_from_two_on_has_the_same_zigzag(order: int) -> None:
    """The flux is constant in the element: p_b is the parabola of (21), whatever m_p allows."""
    bed = Bed(10.0, 0.5)
    h = replace(bed, order=order).upstream()
    np.testing.assert_allclose(h, bed.upstream(), rtol=0, atol=1e-8 * np.abs(h).max())


def test_to_first_order_the_growth_is_c_delta_and_what_elasticity_adds() -> None:
    """rho = -(1 + c delta + 3 / Pe) for small c delta and 1 / Pe."""
    for pe, c in ((1e3, 0.0), (1e5, 1e-2), (1e3, 2e-3)):
        bed = Bed(pe, c)
        assert -bed.roots()[1] - 1 == pytest.approx(bed.share + 3 / pe, rel=0.02)


def test_without_the_term_a_stiff_oil_leaves_the_zigzag_undamped() -> None:
    assert np.abs(Bed(1e6, 0.0).roots()[1] + 1) < 1e-5
    full = Bed(1e6, 1.0).roots()  # 2 rho (rho^2 + 4 rho + 7) = 0
    np.testing.assert_allclose(np.abs(full), [0, np.sqrt(7), np.sqrt(7)], atol=1e-4)


@pytest.mark.parametrize("pe", [1.0, 3.0, 10.0, 100.0])
@pytest.mark.parametrize("c", [0.5, 1.0])
def test_with_delta_the_damping_is_never_less_than_c(pe: float, c: float) -> None:
    """delta is as large as it must be where elasticity does not damp: c delta + 3 / Pe >= c."""
    assert Bed(pe, c).share + 3 / pe >= c
    assert np.abs(Bed(pe, c).roots()[1]) > 1 + c


def zigzag(bed: Bed) -> float:
    """Amplitude in the middle under alternating loads of 1 N/mm, in that without oil."""
    sign = (-1.0) ** np.arange(bed.count + 1)
    curved = np.diff(bed.response(sign), 2) * sign[:-2] / 4  # a uniform change is no zigzag
    middle = curved[bed.count // 2 - 2 : bed.count // 2 + 2]
    assert np.ptp(middle) < 1e-5 * np.abs(middle).max()
    return float(middle.mean() * BED)


@pytest.mark.parametrize("pe", [1.0, 3.0, 10.0])
def test_a_zigzag_meets_the_elasticity_and_the_term_but_not_the_film(pe: float) -> None:
    """Its stiffness is k (1 + c delta Pe / 3): only elasticity without the term."""
    assert zigzag(Bed(pe, 0.0, count=120)) == pytest.approx(1.0, rel=1e-6)
    bed = Bed(pe, 1.0)
    assert zigzag(bed) == pytest.approx(1 / (1 + bed.share * pe / 3), rel=1e-5)


@pytest.mark.parametrize("pe", [2.0, 3.0])
def test_with_its_sign_reversed_the_term_amplifies_the_zigzag(pe: float) -> None:
    bed = Bed(pe, -1.0, count=120)
    assert zigzag(bed) == pytest.approx(1 / (1 + bed.share * pe / 3), rel=1e-4)
    assert zigzag(bed) > 1.25


def test_orders_below_two_have_another_zigzag() -> None:
    """m_p = 1 has no bubbles: nothing to move, the term is without effect."""
    with_term, without = (Bed(10.0, c, order=1).upstream() for c in (1.0, 0.0))
    np.testing.assert_allclose(with_term, without, rtol=0, atol=1e-9 * np.abs(without).max())
    assert np.abs(without - Bed(10.0, 0.0).upstream()).max() > 0.1 * np.abs(without).max()


# --- The bubble-load upwinding alone: what it moves, what it leaves, how small it is --------------


SHAFT, U, VISCOSITY, SHEAR = 25.0, 400.0, 6.59e-8, 3.66
NAMES = ("rod_radius", "rod_speed", "viscosity", "shear_modulus", "upwinding", "force_weight")


def peclet(dx: np.ndarray | float, h: np.ndarray | float, speed: float = U) -> np.ndarray:
    return np.asarray(3 * VISCOSITY * abs(speed) / 2 * dx**2 / (np.pi * SHEAR * h**3))


def chain(
    x: np.ndarray, h: np.ndarray, order: int, *, strength: float = 1.0, speed: float = U
) -> tuple[Part, np.ndarray]:
    """Segments with ends at x and film thickness h there, and where their pressures sit."""
    count = len(x) - 1
    ends = np.stack([np.arange(count), np.arange(count) + 1], axis=1)
    moved = (2 * ends[:, :, None] + np.arange(2)).reshape(count, 4)
    first = 2 * len(x)
    maps = np.hstack([moved, first + order * np.arange(count)[:, None] + np.arange(order + 1)])
    nodes = np.stack([x, SHAFT + h], axis=1)
    parameters = (SHAFT, speed, VISCOSITY, SHEAR, strength, 1.0)
    rule = quadrature.film_rule(order)
    part = Part("film_upwind", nodes[ends].reshape(count, 4), maps, parameters, rule=rule)
    inner = (1 + quadrature.pressure_nodes(order)[:-1]) / 2
    places = (x[:-1, None] + np.diff(x)[:, None] * inner).ravel()
    return part, np.append(places, x[-1])


def elements(rng: np.random.Generator, order: int, **changes: float) -> tuple[np.ndarray, ...]:
    """Residuals and tangents of five random segments, some parameters changed."""
    X = np.array([-0.1, 25.4, 0.02, 25.45]) + rng.uniform(-0.01, 0.01, (5, 4))
    u = np.zeros((5, 4))
    u[:, 1::2] = SHAFT + rng.uniform(0.003, 0.03, (5, 2)) - X[:, 1::2]
    p = rng.uniform(1, 5, (5, order + 1))
    given = dict(zip(NAMES, (SHAFT, U, VISCOSITY, SHEAR, 1.0, 0.8), strict=True)) | changes
    kernel, rule = load_kernel("film_upwind"), quadrature.film_rule(order)
    assert kernel.parameters == NAMES
    return kernel.tangent(X, np.hstack([u, p]), parameters=given, rule=rule)


@pytest.mark.parametrize("order", [2, 3, 4, 7])
def test_it_moves_a_radial_force_from_node_to_node_and_nothing_else(order: int) -> None:
    forces, tangents = elements(np.random.default_rng(1), order)
    assert np.abs(forces[:, 3]).min() > 0
    np.testing.assert_array_equal(forces[:, 1], -forces[:, 3])  # the total force stays, exactly
    np.testing.assert_array_equal(tangents[:, 1], -tangents[:, 3])
    silent = [0, 2, *range(4, 5 + order)]  # axial forces, Reynolds equation
    assert not forces[:, silent].any()
    assert not tangents[:, silent].any()


@pytest.mark.parametrize(
    ("speed", "strength", "downstream"), [(U, 1.0, 3), (-U, -1.0, 1)], ids=["out", "in"]
)
def test_the_load_goes_downstream(speed: float, strength: float, downstream: int) -> None:
    """A bubble of positive pressure pushes the seal up: its residual (inner - outer) is negative.

    With delta -> 1 and c = 1 all of the load, (2/3) dx 2 pi r p_top, is the downstream node's.
    """
    part, _ = chain(np.array([0.0, 0.1]), np.full(2, 3e-4), 2, strength=strength, speed=speed)
    forces, _ = part.elements(np.array([0.0, 0, 0, 0, 1.0, 1.5, 1.0]))
    load = 2 * np.pi * (SHAFT + 3e-4) * 2 / 3 * 0.1 * 0.5
    delta = peclet(0.1, 3e-4) ** 2 / (9 + peclet(0.1, 3e-4) ** 2)
    assert delta > 0.99
    assert forces[0, downstream] == pytest.approx(-load / 2 * delta, rel=1e-12)


def smooth(count: int, thickness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Added traction (MPa) at the inner nodes of a smooth film, their places, the pressure there.

    h is linear between the nodes and falls downstream, where nothing weakens the term; p is of
    order 4: the third derivative of exp is exp.
    """
    x = np.linspace(0.0, 1.0, count + 1)
    part, places = chain(x, thickness * (1.2 + 0.3 * np.cos(2 * x)), 4)
    state = np.concatenate([np.zeros(2 * len(x)), np.exp(places)])
    forces = np.bincount(part.maps.ravel(), part.elements(state)[0].ravel())[1 : 2 * len(x) : 2]
    return -forces[1:-1] * count / (2 * np.pi * SHAFT), x[1:-1], np.exp(x[1:-1])


def test_on_smooth_films_the_added_traction_is_of_third_order_where_the_oil_is_stiff() -> None:
    """delta -> 1: it is dx^3 p''' / 24, whatever the mesh."""
    counts = (20, 40, 80)
    sizes = []
    for count in counts:
        traction, _, p = smooth(count, 2e-5)
        np.testing.assert_allclose(traction, p / 24 / count**3, rtol=0.01)
        sizes.append(np.abs(traction).max())
    assert fitted_order(counts, sizes) == pytest.approx(-3.0, abs=0.03)


def test_on_resolved_films_it_is_of_seventh_order() -> None:
    """delta falls with dx^4 where the elasticity of the seal is the stiffer one."""
    counts = (40, 80, 160)
    assert peclet(1 / 40, 6e-3) < 0.05
    sizes = [np.abs(smooth(count, 6e-3)[0]).max() for count in counts]
    assert fitted_order(counts, sizes) == pytest.approx(-7.0, abs=0.1)
