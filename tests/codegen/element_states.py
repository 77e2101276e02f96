"""Random admissible states of one element of every shipped model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softehl.codegen.graph.evaluation import EvaluationState
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.quadrature import Kind, facet_rule, film_rule
from softehl.runtime.kernels.kernel import Kernel, Rule, load_kernel
from tests.reference.calling import rule_of
from tests.reference.states import State as Known
from tests.reference.states import (
    mixed_states,
    mortar_states,
    rigid_states,
    thinning_states,
    touch_states,
    void_states,
)
from tests.shipped import RUBBERS

SIDES = (*mortar_states(), *touch_states(), *rigid_states())
MATERIALS = ((3.04, 0.62, 500.0), (0.9, 0.0, 40.0), (1.2, 2.1, 2.0e3))


@dataclass(frozen=True)
class Case:
    """Arguments of a kernel family for one element, as doubles (mm, MPa, N, s)."""

    family: str
    label: str
    coordinates: Array
    dofs: Array
    data: Array
    parameters: Array
    rule: Rule | None = None
    point_data: Array | None = None

    def arguments(self) -> tuple[tuple[Array, Array], dict[str, Any]]:
        """Positional and named arguments of the kernel's methods."""
        return (self.coordinates[None], self.dofs[None]), {
            "data": self.data[None],
            "parameters": self.parameters,
            "rule": self.rule,
            "point_data": None if self.point_data is None else self.point_data[None],
        }

    def exact(self, kernel: Kernel | None = None) -> EvaluationState:
        """The same doubles as arguments of the oracle."""
        rule = self.rule or (kernel or load_kernel(self.family)).default_rule
        table = np.column_stack([rule.points.reshape(len(rule.weights), -1), rule.weights])
        basis = () if rule.basis is None else rule.basis.tolist()
        return EvaluationState(
            self.coordinates.tolist(),
            self.dofs.tolist(),
            self.data.tolist(),
            self.parameters.tolist(),
            table.tolist(),
            basis,
            () if self.point_data is None else self.point_data.tolist(),
        )


def _case(family: str, label: str, X: Any, u: Any, parameters: Any, data: Any = ()) -> Case:
    x, d, a, p = (np.array(v, dtype=np.float64).ravel() for v in (X, u, data, parameters))
    return Case(family, label, x, d, a, p)


def quad(rng: np.random.Generator, radius: float, size: float) -> Array:
    """A distorted, turned quadrilateral (4, 2) at the given radius, counterclockwise."""
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    X: Array = size * (square + rng.uniform(-0.15, 0.15, (4, 2))) @ turn.T + [0.2, radius]
    return X


def motion(rng: np.random.Generator, X: Array, strain: float) -> Array:
    """Displacements (4, 2) of a random deformation with positive volume ratio, and a shift."""
    F = np.eye(2) + rng.uniform(-strain, strain, (2, 2))
    centre = X.mean(axis=0)
    scatter = 0.2 * strain * np.ptp(X[:, 0]) * rng.uniform(-1, 1, (4, 2))
    u: Array = (X - centre) @ F.T + centre - X + scatter + rng.uniform(-0.05, 0.05, 2)
    return u


def solids(rng: np.random.Generator) -> Iterator[Case]:
    """All four solids on three materials: a seal-sized ring, near the axis, stiff."""
    for family in ("solid_q4", "solid_fbar", "solid_taylor", "solid_taylor_mean"):
        for label, radius, size, strain, material in (
            ("ring", 25.0, 0.1, 0.3, MATERIALS[0]),
            ("near the axis", 1.5, 0.6, 0.2, MATERIALS[1]),
            ("stiff", 10.0, 0.3, 0.15, MATERIALS[2]),
        ):
            X = quad(rng, radius, size)
            yield _case(family, label, X, motion(rng, X, strain), material)


def rubbers(rng: np.random.Generator) -> Iterator[Case]:
    """The Taylor-expanded solid and the sheet of other materials."""
    for name, own in RUBBERS.items():
        X = quad(rng, 25.0, 0.1)
        given = [*own.values(), 500.0]
        yield _case(f"solid_taylor_mean_{name}", "ring", X, motion(rng, X, 0.3), given)
    paper = dict(zip(("mu_1", "mu_2"), MATERIALS[0], strict=False))
    for name, values in {"mooney_rivlin": paper, **RUBBERS}.items():
        given = list(values.values())
        yield _case(f"sheet_{name}", "pulled", [[0.1, 25.4]], [0.5, -0.2], given)


CORNERED = [1.8, 25.05, 0.2]
CORNER = (
    ("in the wall", 1.86, 25.9, -2.0),
    ("before the wall, open", 1.6, 25.9, 2.0),
    ("in the fillet", 1.93, 25.1, -2.0),
    ("in the lip", 2.3, 25.09, -2.0),
    ("deep behind the wall", 2.2, 25.9, -2.0),
    ("deep above the lip", 2.6, 25.5, -2.0),
)
"""Places about a wall at 1.8 mm with a lip at 25.05 and a fillet of 0.2 mm; the multiplier."""


def boundaries(rng: np.random.Generator) -> Iterator[Case]:
    """Follower pressure of both signs and none; contact closed and open, sticking and slipping."""
    for label, pressure in (("pressed", 2.5), ("pulled", -0.8), ("no pressure", 0.0)):
        X = np.array([[-0.05, 25.1], [0.06, 25.0]]) + rng.uniform(-0.02, 0.02, (2, 2))
        u = rng.uniform(-0.1, 0.1, (2, 2))
        yield _case("follower_pressure", label, X, u, [pressure])
    for label, gap, multiplier in (
        ("closed", -0.02, -1.5),
        ("closed by its multiplier", 0.01, -8.0),
        ("closed by its gap", -0.05, 2.0),
        ("open", 0.1, -3.0),
        ("open under tension", 0.02, 1.0),
    ):
        angle, radius = rng.uniform(0, 2 * np.pi), rng.uniform(20, 30)
        n, u = np.array([np.cos(angle), np.sin(angle)]), rng.uniform(-0.1, 0.1, 2)
        X, offset = np.array([0.3, radius]), rng.uniform(0, 0.02)
        c = n @ (X + u) - offset - gap
        data = [*n, c, rng.uniform(1, 20), 200.0]
        yield _case("contact", label, X, [*u, multiplier], [offset, rng.uniform(0.2, 1)], data)
    for label, z, r, multiplier in CORNER:
        X, place = np.array([1.6, 25.3]), np.array([z, r])
        yield _case("contact_corner", label, X, [*(place - X), multiplier], CORNERED, [8.1, 200.0])
    for label, gap, slip in (
        ("open", 0.1, 0.02),
        ("sticking", -0.02, 1e-4),
        ("slipping", -0.02, 0.05),
        ("slipping back", -0.02, -0.05),
    ):
        # along an axis where it sticks: the sum of n n and t t has zeros that rounding would fill
        angle = 0.0 if label == "sticking" else rng.uniform(0, 2 * np.pi)
        radius = rng.uniform(20, 30)
        n, u = np.array([np.cos(angle), np.sin(angle)]), rng.uniform(-0.1, 0.1, 2)
        X, offset = np.array([0.3, radius]), rng.uniform(0, 0.02)
        old = u - slip * np.array([n[1], -n[0]]) + 0.03 * n
        data = [*n, n @ (X + u) - offset - gap, rng.uniform(1, 20), 200.0, *old]
        yield _case("contact_friction", label, X, [*u, -1.5, 0.3], [offset, 0.3], data)


def supports(rng: np.random.Generator) -> Iterator[Case]:
    """Mean rotation, axial spring."""
    X = quad(rng, 26.9, 0.4)
    u = [*rng.uniform(-0.3, 0.3, 8), -3.0]
    yield _case("mean_rotation", "turned", X, u, [0.01, 26.96, 7.6, 0.05])
    yield _case("mean_axial", "moved", X, u, [9.8, 0.04])
    X = quad(rng, 26.9, 0.4)
    yield _case("axial_spring", "bedded", X, rng.uniform(-0.3, 0.3, 8), [0.37])


FILMS: tuple[tuple[str, float, Callable[[Array], Array]], ...] = (
    ("pressed", 400.0, lambda p: 3.0 + p),
    ("mixed", -100.0, lambda p: np.concatenate([[-1.0], p[1:-1], [1.3]])),
    ("cavitated", 1600.0, lambda p: -1.2 + 0.5 * p),
)


def films(rng: np.random.Generator, m_p: int, kind: Kind) -> Iterator[Case]:
    """Film of order `m_p`: pressed, cavitated and mixed; both strokes; weights off and on."""
    for k, (label, speed, pressures) in enumerate(FILMS):
        h = rng.uniform(0.004, 0.03, 2)
        X = np.array([[-0.1, 25.4], [0.02, 25.45]]) + rng.uniform(-0.01, 0.01, (2, 2))
        u = np.column_stack([rng.uniform(-0.02, 0.02, 2), 25.0 + h - X[:, 1]])
        p = pressures(rng.uniform(-1, 1, m_p + 1))
        parameters = [25.0, speed, 6.6e-8, (0.02, 0.0, 0.015)[k], 1.0e4, (1.0, 0.6, 0.3)[k], 0.9]
        points = None if label == "pressed" else m_p + 3
        plain = _case("film", f"m_p={m_p} {kind} {label}", X, [*u.ravel(), *p], parameters)
        yield replace(plain, rule=film_rule(m_p, kind, points))
        if m_p > 1:  # without bubbles the load is zero, and all of a kernel's is rounding
            given = [25.0, speed, 6.6e-8, 3.66, (1.0, -0.5, 0.7)[k], parameters[5]]
            moved = replace(plain, family="film_upwind", parameters=np.array(given))
            yield replace(moved, rule=film_rule(m_p, kind, points))


def facets(rng: np.random.Generator, m_p: int) -> Iterator[Case]:
    """Interior facet of order `m_p`, unequal segments: both strokes, with and without (13)."""
    for label, speed, alpha in (("out", 400.0, 0.02), ("in", -100.0, 0.0)):
        X = np.array([[-0.1, 25.4], [0.02, 25.45], [0.07, 25.46]]) + rng.uniform(
            -0.01, 0.01, (3, 2)
        )
        u = rng.uniform(-0.01, 0.01, (3, 2))
        u[1, 1] = 25.0 + rng.uniform(0.004, 0.03) - X[1, 1]
        p = rng.uniform(-1, 4, 2 * (m_p + 1))
        parameters = [25.0, speed, 6.6e-8, alpha]
        plain = _case("film_facet", f"m_p={m_p} {label}", X, [*u.ravel(), *p], parameters)
        yield replace(plain, rule=facet_rule(m_p))


def thinning() -> Iterator[Known]:
    """Of oils that thin; of Carreau's, for which the oracle needs its time, one of each film."""
    for state in thinning_states((1,)):
        if "thin" in state.label:
            continue  # with forces that cancel in z
        if "carreau" not in state.family:
            yield state
        elif state.label in ("m1-far", "m1-gauss-in-crossing"):
            yield replace(state, count=2 if state.count else 0)


def ruptured() -> Iterator[Case]:
    """Films with void fractions, rough and moving ones, those that thin, and sides that touch: of
    the other reference.
    """
    for state in [*mixed_states((1, 3)), *void_states(), *thinning(), *SIDES]:
        given = state.coordinates, state.dofs, state.parameters, state.data
        plain = _case(state.family, state.label, *given)
        data = np.array(state.point_data)[:, None] if state.point_data else None
        yield replace(plain, rule=rule_of(state), point_data=data)


def all_cases() -> list[Case]:
    """Every case of every family: the same in every run."""
    rng = np.random.default_rng(20251)
    cases = [*solids(rng), *boundaries(rng), *supports(rng)]
    cases += rubbers(np.random.default_rng(1972))
    kinds: tuple[Kind, ...] = ("gauss", "lobatto")
    for m_p in range(1, 6):
        for kind in kinds:
            cases += films(rng, m_p, kind)
        cases += facets(rng, m_p)
    cases += ruptured()
    return cases
