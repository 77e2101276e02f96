"""The bubble-load upwinding alone: what it moves, what it leaves, how small it is."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.runtime.discretisation import quadrature
from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.calling import Part, fitted_order

ROD, U, OIL, G = 25.0, 400.0, 6.59e-8, 3.66
NAMES = ("rod_radius", "rod_speed", "viscosity", "shear_modulus", "upwinding", "force_weight")


def peclet(dx: np.ndarray | float, h: np.ndarray | float, speed: float = U) -> np.ndarray:
    return np.asarray(3 * OIL * abs(speed) / 2 * dx**2 / (np.pi * G * h**3))


def chain(
    x: np.ndarray, h: np.ndarray, order: int, *, strength: float = 1.0, speed: float = U
) -> tuple[Part, np.ndarray]:
    """Segments with ends at x and film thickness h there, and where their pressures sit."""
    count = len(x) - 1
    ends = np.stack([np.arange(count), np.arange(count) + 1], axis=1)
    moved = (2 * ends[:, :, None] + np.arange(2)).reshape(count, 4)
    first = 2 * len(x)
    maps = np.hstack([moved, first + order * np.arange(count)[:, None] + np.arange(order + 1)])
    nodes = np.stack([x, ROD + h], axis=1)
    parameters = (ROD, speed, OIL, G, strength, 1.0)
    rule = quadrature.film_rule(order)
    part = Part("film_upwind", nodes[ends].reshape(count, 4), maps, parameters, rule=rule)
    inner = (1 + quadrature.pressure_nodes(order)[:-1]) / 2
    places = (x[:-1, None] + np.diff(x)[:, None] * inner).ravel()
    return part, np.append(places, x[-1])


def elements(rng: np.random.Generator, order: int, **changes: float) -> tuple[np.ndarray, ...]:
    """Residuals and tangents of five random segments, some parameters changed."""
    X = np.array([-0.1, 25.4, 0.02, 25.45]) + rng.uniform(-0.01, 0.01, (5, 4))
    u = np.zeros((5, 4))
    u[:, 1::2] = ROD + rng.uniform(0.003, 0.03, (5, 2)) - X[:, 1::2]
    p = rng.uniform(1, 5, (5, order + 1))
    given = dict(zip(NAMES, (ROD, U, OIL, G, 1.0, 0.8), strict=True)) | changes
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
    load = 2 * np.pi * (ROD + 3e-4) * 2 / 3 * 0.1 * 0.5
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
    return -forces[1:-1] * count / (2 * np.pi * ROD), x[1:-1], np.exp(x[1:-1])


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
