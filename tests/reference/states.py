"""Random admissible states of every kernel family (seeded: the same in every run)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

SOLIDS = ("solid_q4", "solid_fbar", "solid_taylor", "solid_taylor_mean")
ORDERS = (1, 2, 3, 4, 5, 7)
UNIT = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2


@dataclass(frozen=True)
class State:
    """Arguments of one element, as doubles; `kind` and `count` name the film's rule."""

    family: str
    label: str
    coordinates: tuple[float, ...]
    dofs: tuple[float, ...]
    parameters: tuple[float, ...]
    data: tuple[float, ...] = ()
    kind: str = ""
    count: int = 0
    point_data: tuple[float, ...] = ()

    @property
    def id(self) -> str:
        """Name of the test case."""
        return f"{self.family}-{self.label}"


def _tuple(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in np.ravel(values))


def jacobians(coordinates: np.ndarray, dofs: np.ndarray) -> np.ndarray:
    """J = det F of the bilinear element at the 2x2 Gauss points and the centre."""
    X, u = coordinates.reshape(4, 2), dofs.reshape(4, 2)
    places = [*(2 * UNIT / np.sqrt(3)), np.zeros(2)]
    values = []
    for xi, eta in places:
        shapes = (1 + 2 * UNIT[:, 0] * xi) * (1 + 2 * UNIT[:, 1] * eta) / 4
        slopes = np.stack(
            [UNIT[:, 0] * (1 + 2 * UNIT[:, 1] * eta), UNIT[:, 1] * (1 + 2 * UNIT[:, 0] * xi)]
        )
        in_plane = np.linalg.det(slopes @ (X + u)) / np.linalg.det(slopes @ X)
        values.append(in_plane * (shapes @ (X + u)[:, 1]) / (shapes @ X[:, 1]))
    return np.array(values)


def quad(
    rng: np.random.Generator, radius: float, size: float, distortion: float = 0.15
) -> np.ndarray:
    """A distorted, turned quad (8,) around (0.3, radius)."""
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners = UNIT + distortion * rng.uniform(-1, 1, (4, 2))
    return np.ravel(size * corners @ turn.T + np.array([0.3, radius]))


def displacement(
    rng: np.random.Generator, coordinates: np.ndarray, strain: float, shift: float
) -> np.ndarray:
    """A random finite deformation (8,) with 0.6 < J < 1.6 at every point used by any solid."""
    X = coordinates.reshape(4, 2)
    size = np.ptp(X[:, 0])
    for _ in range(1000):
        gradient = strain * rng.uniform(-1, 1, (2, 2))
        u = (X - X.mean(axis=0)) @ gradient.T + shift * rng.uniform(-1, 1, 2)
        dofs = np.ravel(u + 0.3 * strain * size * rng.uniform(-1, 1, (4, 2)))
        values = jacobians(coordinates, dofs)
        if values.min() > 0.6 and values.max() < 1.6:
            return dofs
    raise RuntimeError("no admissible state found")


def solid_states() -> Iterator[State]:
    """Paper material and a stiffer one, far from and close to the axis, with rigid shifts."""
    table = (
        ("paper", 25.0, 0.1, 0.3, 0.5, (3.04, 0.62, 500.0)),
        ("inner", 1.5, 0.8, 0.3, 0.2, (3.04, 0.62, 500.0)),
        ("small-strain", 25.0, 0.05, 0.02, 0.02, (3.04, 0.62, 500.0)),
        ("stiff", 5.0, 0.5, 0.3, 0.2, (1.0, 2.0, 5e4)),
    )
    for family in SOLIDS:
        rng = np.random.default_rng(1997)
        for label, radius, size, strain, shift, material in table:
            X = quad(rng, radius, size)
            u = displacement(rng, X, strain, shift)
            yield State(family, label, _tuple(X), _tuple(u), material)


RUBBERS = {
    "yeoh": ((1.5, -0.03, 0.002), (0.4, 0.1, 0.05)),
    "ogden": ((3.04, 1.3, 0.62, 5.0, -0.1, -2.0), (0.63, 1.3, 0.0, 2.0, 0.0, 2.0)),
    "arruda_boyce": ((2.1, 4.0), (0.7, 1.8)),
    "gent": ((2.1, 30.0), (0.7, 6.0)),
}
"""Two sets of parameters of the isochoric terms beside the paper's, MPa."""


def rubber_states() -> Iterator[State]:
    """The same elements of other materials; sheets pulled, pressed and sheared, of all of them."""
    rng = np.random.default_rng(1972)
    for name, (first, second) in RUBBERS.items():
        for label, radius, size, strain, own in (
            ("paper", 25.0, 0.1, 0.3, first),
            ("inner", 1.5, 0.8, 0.3, second),
            ("small-strain", 25.0, 0.05, 0.02, first),
        ):
            X = quad(rng, radius, size)
            u = displacement(rng, X, strain, 0.2)
            yield State(f"solid_taylor_mean_{name}", label, _tuple(X), _tuple(u), (*own, 500.0))
    for name, sets in {"mooney_rivlin": ((3.04, 0.62), (0.9, 0.0)), **RUBBERS}.items():
        for k, own in enumerate(sets):
            for e in ((0.6, -0.3), (-0.2, -0.25), (0.3, 0.3), (0.02, 0.0)):
                label = f"{k}-{e[0]}-{e[1]}"
                yield State(f"sheet_{name}", label, (0.1, 25.4), e, tuple(own))


CORNER = (
    ("before-the-wall", 1.75, 25.9),
    ("in-the-wall", 1.86, 25.9),
    ("at-the-fillet", 1.84, 25.12),
    ("in-the-fillet", 1.93, 25.1),
    ("under-the-lip", 2.3, 25.0),
    ("in-the-lip", 2.3, 25.09),
    ("deep-behind-the-wall", 2.2, 25.9),
    ("deep-above-the-lip", 2.6, 25.5),
)
"""Where nodes are about a wall at 1.8 mm, with a lip at 25.05 and a fillet of 0.2 mm."""

FRICTION = (
    ("open", 0.4, 0.11, 1.5),
    ("sticking", -0.3, 0.1, 0.5),
    ("sticking-by-multiplier", -0.3, 0.11, -4.0),
    ("slipping-forth", -0.3, 0.4, 3.0),
    ("slipping-back", -0.3, -0.2, 1.0),
)
"""Label, u_r, u_z and tau of the frictional contact."""


def boundary_states() -> Iterator[State]:
    """Follower pressure, and contact in both branches with full and partial force weight."""
    rng = np.random.default_rng(1991)
    X = np.array([-0.1, 25.2, 0.05, 25.1])
    for label, pressure in (("push", 2.5), ("pull", -0.7)):
        u = 0.1 * rng.uniform(-1, 1, 4)
        yield State("follower_pressure", label, _tuple(X), _tuple(u), (pressure,))
    for label, u_r, multiplier, weight in (
        ("closed", -0.3, -4.0, 1.0),
        ("closed-by-multiplier", 0.02, -40.0, 0.4),
        ("closed-by-gap", -0.3, 3.0, 1.0),
        ("open", 0.4, -3.0, 0.7),
        ("open-tension", 0.1, 2.0, 1.0),
    ):
        yield State(
            "contact",
            label,
            (0.2, 25.2),
            (0.11, u_r, multiplier),
            (0.0125, weight),
            (0.28, 0.96, 24.25, 18.7, 130.0),
        )
    for label, z, r in CORNER:
        for pressed, multiplier in (("", -3.0), ("-open", 40.0)):
            given = (1.6, 25.3), (z - 1.6, r - 25.3, multiplier), (1.8, 25.05, 0.2), (18.7, 130.0)
            yield State("contact_corner", label + pressed, *given)
    for label, u_r, u_z, tau in FRICTION:
        dofs, data = (u_z, u_r, -4.0, tau), (0.28, 0.96, 24.25, 18.7, 130.0, 0.1, -0.31)
        yield State("contact_friction", label, (0.2, 25.2), dofs, (0.0125, 0.4), data)


MEETINGS = (
    ("sticking", (0.8, -0.3), -0.01, (0.5, 0.8), 1e-3),
    ("slipping", (1.3, 0.2), -0.012, (0.6, 0.7), 0.3),
    ("slipping-back", (0.9, 0.2), 0.004, (0.9, 0.7), -0.3),
    ("at-an-edge", (0.9, 0.2), 0.01, (0.4, -0.2), 0.02),
    ("open", (0.9, 0.2), 0.3, (0.5, 0.8), 0.0),
    ("beyond", (0.9, 0.2), 1.5, (30.0, 30.0), 0.0),
    ("missed-right", (2.0, 1.5), -0.01, (0.5, 0.8), 0.0),
    ("missed-left", (-0.5, -1.0), -0.01, (0.5, 0.8), 0.0),
)
"""Label, ends of the other side along the first one, from 0 to 1; gap, multipliers, slip."""


def mortar_states() -> Iterator[State]:
    """Two sides, turned: pressed, slipping, apart, missed, smooth; rings and plane; sides alone."""
    c, s = np.cos(0.4), np.sin(0.4)
    turn, shift = np.array([[c, s], [-s, c]]), np.array([0.3, 3.0])
    for a, b in ((2, 2), (2, 3), (3, 2), (3, 3)):
        rng = np.random.default_rng(2015)
        for k, (label, (first, last), gap, pressures, slip) in enumerate(MEETINGS):
            side = np.array([[0.0, 0.01], [1.0, -0.01], [0.52, -0.03]])[:a]
            middle = 0.7 * last + 0.3 * first if "missed" in label else (first + last) / 2 + 0.02
            other = np.array([[first, -gap], [last, -gap - 0.01], [middle, 0.01 - gap]])[:b]
            now = np.concatenate([side, other]) @ turn + shift
            u = 0.1 * rng.uniform(-1, 1, now.shape)
            old = u + 0.002 * rng.uniform(-1, 1, now.shape)
            old[:a] -= slip * turn[0]
            tau = (0.02, -0.03) if label != "at-an-edge" else (0.5, 0.1)
            multipliers = np.stack([pressures, tau], axis=1)
            dofs = (*_tuple(u), *_tuple(multipliers))
            for kind, friction in ((label, 0.3), *([("frictionless", 0.0)] if k == 0 else [])):
                data = (*_tuple(old.T), 10.0, friction, 0.5, 1.0, float(k % 2))
                yield State(f"mortar_{a}{b}", kind, _tuple(now - u), dofs, (), data)
    for a in (2, 3):
        now = np.array([[0.0, 0.01], [1.0, -0.01], [0.52, -0.03]])[:a] @ turn + shift
        u = np.array([[0.05, 0.02], [-0.03, 0.04], [0.01, 0.06]])[:a]
        for label, ring in (("ring", 1.0), ("plane", 0.0)):
            dofs = (*_tuple(u), 0.5, 0.1, 0.8, -0.2)
            yield State(f"mortar_side_{a}", label, _tuple(now - u), dofs, (), (10.0, ring))


def touch_states() -> Iterator[State]:
    """Points that stick, slip, are open or too deep, their face turned; faces alone."""
    middle = (UNIT + np.roll(UNIT, -1, axis=0)) / 2
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    edges = (triangle + np.roll(triangle, -1, axis=0)) / 2
    places = {3: UNIT[[0, 1, 2]], 4: UNIT, 6: np.vstack([triangle, edges])}
    places[8] = np.vstack([UNIT, middle])
    places[9] = np.vstack([places[8], UNIT.mean(axis=0)])
    turn = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [-0.1, 1.0, 0.4], [0.3, -0.2, 1.0]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    for label, gap, came, friction in (
        ("sticking", -0.01, (1e-3, -2e-3), 0.3),
        ("slipping", -0.02, (0.03, 0.05), 0.3),
        ("open", 0.3, (0.01, 0.0), 0.3),
        ("beyond", -0.7, (0.01, 0.0), 0.3),
        ("frictionless", -0.02, (0.03, 0.05), 0.0),
    ):
        rows = [[0.02, -0.01, gap], [1.1, 0.2, 0.0], [-0.1, 0.9, 0.0], [*came, 1e-3]]
        dofs = (*_tuple(np.array(rows) @ turn.T), 0.4, 0.02, -0.03, 0.01)
        yield State("touch", label, (), dofs, (), (10.0, friction, 0.5, 1.0))
    for a, flat in places.items():
        rng, corners = np.random.default_rng(2016), 3 if a in (3, 6) else 4
        now = np.column_stack([flat, 0.1 * rng.uniform(-1, 1, a)]) @ turn.T
        u = 0.1 * rng.uniform(-1, 1, now.shape)
        dofs = (*_tuple(u), *_tuple(rng.uniform(0.2, 0.6, (corners, 4))))
        yield State(f"touch_side_{a}", "turned", _tuple(now - u), dofs, (), (10.0,))


def rigid_states() -> Iterator[State]:
    """Links of finite and small rotation, a moment, and points against planes and round surfaces
    that stick, slip, are open or too deep.
    """
    motion = {2: (0.2, -0.1, 0.7), 3: (0.2, -0.1, 0.3, 0.7, -0.4, 0.9)}
    for d in (2, 3):
        X, u, force = (0.4, 1.3, -0.6)[:d], (0.3, -0.2, 0.5)[:d], (1.5, -0.7, 0.9)[:d]
        reference = (0.1, 0.2, -0.3)[:d]
        for label, finite in (("finite", 1.0), ("small", 0.0)):
            dofs, data = (*u, *force, *motion[d]), (*reference, finite)
            yield State(f"rigid_link_{d}", label, (*X, *X), dofs, (), data)
    yield State("rigid_moment", "turned", (), (0.7, -0.4, 0.9), (), (1.5, -0.7, 0.9))
    yield State("rigid_moment", "at rest", (), (0.0, 0.0, 0.0), (), (1.5, -0.7, 0.9))
    for label, gap, came, friction, flat, side in (
        ("sticking", -0.01, 1e-3, 0.3, 0.0, 1.0),
        ("slipping", -0.02, 0.05, 0.3, 0.0, 1.0),
        ("slipping-back", -0.02, -0.05, 0.3, 0.0, 1.0),
        ("open", 0.3, 0.01, 0.3, 0.0, 1.0),
        ("beyond", -0.7, 0.01, 0.3, 1.0, 1.0),
        ("frictionless", -0.02, 0.03, 0.0, 0.0, -1.0),
        ("plane", -0.02, 0.05, 0.3, 1.0, 1.0),
    ):
        for d in (2, 3):
            yield _touching(d, label, (gap, came), friction, (flat, side), motion[d])


def _touching(
    d: int,
    label: str,
    place: tuple[float, float],
    friction: float,
    surface: tuple[float, float],
    motion: tuple[float, ...],
) -> State:
    """A point at a gap of a surface of radius 1.3, which came along it."""
    (gap, came), (flat, side), radius = place, surface, 1.3
    reference, c = np.array([0.1, 0.2, -0.3])[:d], np.array([0.4, -0.2, 0.1])[:d]
    normal = np.array([0.6, 0.8, 0.0])[:d]
    along = np.array([0.8, -0.6, 0.0])[:d]
    axis = normal if flat else np.zeros(d)
    if d == 3 and not flat and label in ("sticking", "slipping"):
        axis = np.array([0.0, 0.0, 1.0])  # a cylinder
    y = c + gap * normal if flat else c + side * (radius * side + gap) * normal
    turn = _rotation(motion[d:])
    x = turn @ (y - reference) + reference + np.array(motion[:d])
    multipliers = (0.4, 0.02) if d == 2 else (0.4, 0.02, -0.03, 0.01)
    data = (10.0, friction, 0.5, *reference, *(y - came * along), 0.7, flat, side, radius)
    dofs = (*_tuple(x), *multipliers, *motion)
    return State(f"rigid_touch_{d}", label, (), dofs, (), (*map(float, (*data, *c, *axis)),))


def _rotation(theta: tuple[float, ...]) -> np.ndarray:
    """Rotation by an angle or a vector (Rodrigues)."""
    if len(theta) == 1:
        c, s = math.cos(theta[0]), math.sin(theta[0])
        return np.array([[c, -s], [s, c]])
    x, y, z = theta
    S, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), math.hypot(x, y, z)
    first, second = math.sin(angle) / angle, (1 - math.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + first * S + second * S @ S)


def section_states() -> Iterator[State]:
    """Mean rotation and axial spring on distorted quads."""
    rng = np.random.default_rng(2009)
    for label in ("first", "second"):
        X, u = quad(rng, 26.9, 0.4), 0.3 * rng.uniform(-1, 1, 8)
        moment = rng.uniform(-20, 20)
        yield State(
            "mean_rotation", label, _tuple(X), (*_tuple(u), moment), (0.013, 26.96, 7.62, 0.05)
        )
        yield State("mean_axial", label, _tuple(X), (*_tuple(u), moment), (9.8, 0.04))
        yield State("axial_spring", label, _tuple(X), _tuple(u), (0.37,))


def film_states(orders: tuple[int, ...] = ORDERS) -> Iterator[State]:
    """Both rules, both strokes; p > 0, p < 0 and p crossing zero inside the segment; thin films."""
    rng = np.random.default_rng(1986)
    for order in orders:
        for kind, extra in (("gauss", 1), ("lobatto", 2)):
            for label, speed, level, spread in (
                ("out-pressed", 400.0, 4.0, 0.3),
                ("in-crossing", -100.0, 0.0, 2.0),
                ("out-cavitated", 1600.0, -2.0, 0.3),
            ):
                # the second rule of each kind is finer: no count of points is special
                count = order + extra + (2 if label == "in-crossing" else 0)
                gaps = rng.uniform(0.003, 0.03, 2)
                X = np.array([-0.1, 25.4, 0.02, 25.45])
                # R - R_rod first: u keeps bits that the sum R + u would round away
                u = np.array([0.01, (25.0 - 25.4) + gaps[0], -0.02, (25.0 - 25.45) + gaps[1]])
                p = level + spread * rng.uniform(-1, 1, order + 1)
                if label == "in-crossing":
                    p[0], p[-1] = -1.5, 1.7
                yield State(
                    "film",
                    f"m{order}-{kind}-{label}",
                    _tuple(X),
                    _tuple(np.concatenate([u, p])),
                    (25.0, speed, 6.59e-8, 0.02, 1e4, 0.8, 0.9),
                    kind=kind,
                    count=count,
                )


def facet_states(orders: tuple[int, ...] = ORDERS) -> Iterator[State]:
    """Segments of unequal length, jumps of either sign, both strokes; a film of 0.3 micrometres."""
    rng = np.random.default_rng(1999)
    for order in orders:
        for label, speed, alpha, gap in (
            ("out", 400.0, 0.02, 0.012),
            ("in", -100.0, 0.0, 0.007),
            ("thin", 25.0, 0.5, 0.0003),
        ):
            X = np.array([-0.1, 25.42, 0.02, 25.45, 0.09, 25.47])
            u = 0.01 * rng.uniform(-1, 1, 6)
            u[3] = (25.0 - 25.45) + gap  # R - R_rod first, as for the segments
            p = 2.0 + 1.5 * rng.uniform(-1, 1, 2 * (order + 1))
            dofs = _tuple(np.concatenate([u, p]))
            parameters = (25.0, speed, 6.59e-8, alpha)
            yield State("film_facet", f"m{order}-{label}", _tuple(X), dofs, parameters)


def upwind_states(orders: tuple[int, ...] = ORDERS[1:]) -> Iterator[State]:
    """Both rules and strokes; delta small, in between and nearly 1; m_p = 1 has no such load."""
    for state in film_states(orders):
        speed, weight = state.parameters[1], state.parameters[5]
        strength = math.copysign({400.0: 1.0, -100.0: 0.5, 1600.0: 0.8}[speed], speed)
        parameters = (25.0, speed, 6.59e-8, 3.66, strength, weight)
        yield replace(state, family="film_upwind", parameters=parameters)


def thin_film_states(orders: tuple[int, ...] = (4,)) -> Iterator[State]:
    """A film of about 0.3 micrometres at a radius of 25 mm: h must not be lost in r - R_rod."""
    for state in film_states(orders):
        dofs = list(state.dofs)
        dofs[1], dofs[3] = -0.3996, -0.44975
        yield replace(state, label="thin-" + state.label, dofs=tuple(dofs))


OILS: dict[str, tuple[float, ...]] = {"eyring": (), "carreau": (0.45, 0.1)}
"""What follows the critical stress of an oil that thins: exponent, plateau."""


def thinned(state: State, stress: float) -> Iterator[State]:
    """The state of a smooth film with oils that thin at about this stress (MPa)."""
    last = -1 if state.family == "film_conserving" else None  # the rate comes after the oil
    rate = state.parameters[-1:] if last else ()
    for oil, more in OILS.items():
        given = (*state.parameters[:last], stress, *more, *rate)
        yield replace(state, family=f"{state.family}_{oil}", parameters=given)


def thinning_states(orders: tuple[int, ...] = (4,)) -> Iterator[State]:
    """Thick films that pressure shears, thin ones that the rod shears, by each oil."""
    for state in film_states(orders):
        if state.kind == "gauss":
            yield from thinned(state, 0.2)
    for state in thin_film_states(orders):
        if state.kind == "gauss":
            yield from thinned(state, 0.02)
    for state in mixed_states((min(2, orders[0]),)):
        if state.family == "film_conserving":
            yield from thinned(state, 0.3 if "far" in state.label else 0.003)


PLAIN = (25.0, 120.0, 6.59e-8, 0.02, 0.8, 0.9)
"""Radius and speed of the rod, oil, weights of the forces of a film that may rupture."""

THICKNESS = {"deep": (-0.4, 0.1), "bent": (0.2, 1.3), "mixed": (1.4, 2.9), "light": (3.3, 4.9)}
THICKNESS |= {"apart": (5.2, 5.9), "far": (6.5, 30.0)}
"""h over sigma at the nodes: each lies in other branches of the flow factors."""


def mixed_states(orders: tuple[int, ...] = (1, 2, 4)) -> Iterator[State]:
    """Both strokes, a surface that runs ahead of the rod, ruptured and full, every flow factor."""
    rng, sigma, n = np.random.default_rng(1978), 4e-4, len(THICKNESS)
    for order in orders:
        for k, (label, H) in enumerate(THICKNESS.items()):
            X = np.array([-0.1, 25.4, 0.02, 25.45])
            gaps = sigma * np.array(H)
            u = np.array([0.01, (25.0 - 25.4) + gaps[0], -0.02, (25.0 - 25.45) + gaps[1]])
            p = 0.5 + rng.uniform(-0.5, 2, order + 1)
            v = np.where(rng.uniform(size=order + 1) < 0.5, 0.0, rng.uniform(0, 0.9, order + 1))
            dofs, data = _tuple(np.concatenate([u, p, v])), _tuple(rng.uniform(-30, 30, 2))
            ahead = 5e4 if k == n - 1 else 0.0  # u_z times it is a speed above the rod's
            plain = (*PLAIN[:1], (-1) ** k * PLAIN[1], *PLAIN[2:], ahead)
            rough = (sigma, (-1.0, 0.3, 1.0)[k % 3], 14.6, 0.1, 3.0)
            name, all_of_them = f"m{order}-{label}", (*plain, *rough)
            state = State("film_rough", name, _tuple(X), dofs, all_of_them, data)
            yield state
            history = _tuple(rng.uniform(-1, 1, order + 1))
            moved = replace(state, data=(), point_data=history)
            yield replace(moved, family="film_squeeze_rough", parameters=(25.0, 310.0, sigma))
            if order > 1:
                upwind = (sigma, 25.0, plain[1], 6.59e-8, 3.66, (-1.0) ** k * 0.7, 0.8)
                bubbles = replace(state, dofs=dofs[: 5 + order], data=())
                yield replace(bubbles, family="film_upwind_rough", parameters=upwind)
            if label in ("light", "far"):
                yield replace(state, family="film_conserving", parameters=plain)
                yield replace(moved, family="film_squeeze", parameters=(25.0, 310.0))


def void_states() -> Iterator[State]:
    """Full, ruptured, at the front, and on the wrong side of either condition."""
    for label, p, v in (
        ("full", 2.3, 4e-4),
        ("nearly", 1.2, 2e-3),
        ("ruptured", -0.05, 0.6),
        ("front", -0.049, 2e-4),
        ("below", -0.7, -0.1),
        ("wrong", -0.2, 1e-5),
    ):
        yield State("film_void", label, (), (p, v), (-0.05, 1.0, 1e-3))


def all_states() -> list[State]:
    """Every state of every family."""
    bodies = [*solid_states(), *rubber_states(), *boundary_states(), *section_states()]
    films = [*film_states(), *upwind_states(), *facet_states(), *thinning_states()]
    sides = [*mortar_states(), *touch_states(), *rigid_states()]
    return [*bodies, *films, *mixed_states(), *void_states(), *sides]
