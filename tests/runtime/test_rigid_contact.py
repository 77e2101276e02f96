"""Contact with rigid surfaces: patch test, Hertz, polylines, friction, forces on a moving body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Cylinder, Mesh, Plane, Polyline, Sphere, Study, StudyError, SurfaceError
from softehl.runtime.contact.rigid_contact import RigidContact, RigidContactKernel, face_rule
from softehl.runtime.contact.search import ContactSide
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS

Surface = Any
RUBBER: dict[str, Any] = {"material": "neo_hooke", "mu": 1.0, "kappa": 10.0}


def block(dimension: int = 2, order: int = 1) -> Study:
    """A block of height 1 that slides on its bottom."""
    if dimension == 2:
        study = Study(Mesh.rectangle(2, 1, cells=(4, 2), order=order))
        study.fix((0.0, 0.0), u_x=0)
    else:
        study = Study(Mesh.box((2, 2, 1), cells=(2, 2, 1), order=order))
        study.fix((0.0, 0.0, 0.0), u_x=0, u_y=0)
        study.fix((2.0, 0.0, 0.0), u_y=0)
    study.add("block", **RUBBER)
    study.fix("bottom", **{down(study): 0})
    return study


def down(study: Study) -> str:
    """Displacement across the block."""
    return f"u_{'xyz'[study.mesh.dimension - 1]}"


def plane(dimension: int) -> Plane:
    """The plane on the block, free space below it."""
    up = np.eye(dimension)[-1]
    return Plane(up, -up)


@pytest.mark.parametrize(("dimension", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_plane_presses_evenly(dimension: int, order: int) -> None:
    """Patch test: a plane that a force pushes gives a uniform pressure, the force over the area."""
    study = block(dimension, order)
    study.rigid(at=(0.5,) * (dimension - 1) + (1.0,), name="plate")
    across = {2: ("u_x", "theta"), 3: ("u_x", "u_y", "theta_x", "theta_y", "theta_z")}[dimension]
    study.fix("plate", **dict.fromkeys(across, 0.0))
    study.load("plate", **{down(study): -0.5})
    study.contact("top", plane(dimension), body="plate")
    result = study.solve()
    fields = result.fields("contact")
    assert np.ptp(fields["pressure"]) < 1e-10 * fields["pressure"].max()
    assert (fields["pressure"] * fields["area"]).sum() == pytest.approx(0.5, rel=1e-10)
    assert result.reaction("bottom")[down(study)] == pytest.approx(0.5, rel=1e-9)
    assert result.residual_norms[-1] < 1e-9
    assert result.residual_norms[-2] < 1e-4  # quadratic


E, NU, RADIUS = 1000.0, 0.3, 100.0
MODULUS = E / (1.0 - NU**2)


def indented(
    geometry: str | None, cells: int, surface: Surface = None, depth: float = 0.0
) -> tuple[float, float, float]:
    """Force, error of the pressure in the mean of squares, and of its peak, against Hertz.

    The half-space is a square of 40 times 40, finest at the contact.
    """

    def graded(s: Any) -> Any:
        return 40.0 * np.sinh(6.0 * s) / np.sinh(6.0)

    mesh = Mesh.rectangle(1, 1, cells=(cells, cells))
    mesh = mesh.map(lambda x: np.column_stack([-graded(1.0 - x[:, 0]), graded(x[:, 1])]))
    study = Study(mesh, geometry=geometry)
    study.add("body", material="hooke", E=E, nu=NU)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    study.rigid(at=(RADIUS, 0.0), name="ball")
    still = {} if geometry else {"u_y": 0.0, "theta": 0.0}
    study.fix("ball", u_x=-(depth or (0.002 if geometry else 0.005)), **still)
    study.contact("right", surface or Sphere((RADIUS, 0.0), RADIUS), body="ball")
    result = study.solve()
    force = -result.reaction("ball")["u_x"]
    if geometry:
        a = np.cbrt(0.75 * force * RADIUS / MODULUS)
        peak = 1.5 * force / (np.pi * a**2)
    else:
        a = np.sqrt(8.0 * force * RADIUS / (np.pi * MODULUS))
        peak = 4.0 * force / (np.pi * a)
    fields = result.fields("contact")
    y, p, area = (fields[n].ravel() for n in ("y", "pressure", "area"))
    hertz = peak * np.sqrt(np.maximum(1.0 - (y / a) ** 2, 0.0))
    error = np.sqrt((area * (p - hertz) ** 2).sum() / (area * hertz**2).sum())
    return float(force), float(error), float(p.max() / peak - 1.0)


@pytest.mark.parametrize("geometry", ["axisymmetric", None])
def test_a_ball_and_a_roller_press_as_hertz_says(geometry: str | None) -> None:
    """The pressure converges to the half ellipse; in axisymmetry the depth is Hertz's, too."""
    _, coarse, _ = indented(geometry, 20)
    force, fine, peak = indented(geometry, 40)
    assert np.log2(coarse / fine) > 0.7  # the slope of the pressure is infinite at the edge
    assert fine < 0.1
    assert abs(peak) < 0.02
    if geometry:
        closed = 4.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * 0.002**1.5
        assert force == pytest.approx(closed, rel=0.03)  # of a half-space


def test_a_polygon_is_nearly_its_circle() -> None:
    angles = np.linspace(0.8 * np.pi, 1.2 * np.pi, 1201)
    corners = np.column_stack([RADIUS + RADIUS * np.cos(angles), RADIUS * np.sin(angles)])
    known, *_ = indented(None, 20)
    force, *_ = indented(None, 20, Polyline(corners))
    assert force == pytest.approx(known, rel=5e-3)
    coarse, *_ = indented(None, 20, Polyline(corners[::40]))
    assert coarse != pytest.approx(known, rel=2e-2)


SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
NOTCH = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (2.0, 3.0), (1.5, 1.0), (1.0, 3.0), (0.0, 3.0)]


def gap_of(surface: Surface, y: Any) -> tuple[Any, Any]:
    """Gap (n,) of points and its normal (n, dim), by what is next to them."""
    near = surface.nearest(np.asarray(y, dtype=float))
    apart = y - near.centre
    along = np.einsum("nc,nc->n", apart, near.axis)
    radial = apart - along[:, None] * near.axis
    length = np.maximum(np.linalg.norm(radial, axis=1), 1e-300)
    flat = near.flat > 0.5
    normal = np.where(flat[:, None], near.axis, near.side[:, None] * radial / length[:, None])
    return np.where(flat, along, near.side * (length - near.radius)), normal


@pytest.mark.parametrize("corners", [SQUARE, NOTCH])
def test_polygons_have_the_signed_distance(corners: Any) -> None:
    """Distance to the boundary by brute force, negative inside (by winding), at all corners."""
    rng, polygon = np.random.default_rng(5), np.array(corners)
    points = rng.uniform(-0.5, 3.5, (400, 2))
    ends = np.roll(polygon, -1, axis=0)
    shares = np.linspace(0.0, 1.0, 4001)[:, None, None]
    dense = (polygon + shares * (ends - polygon)).reshape(-1, 2)
    distance = np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1)
    a, b = polygon - points[:, None], ends - points[:, None]
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    inside = np.abs(np.arctan2(cross, (a * b).sum(axis=2)).sum(axis=1)) > np.pi
    gap, normal = gap_of(Polyline(corners, closed=True), points)
    np.testing.assert_allclose(gap, np.where(inside, -distance, distance), atol=2e-3)
    ahead, _ = gap_of(Polyline(corners, closed=True), points + 1e-6 * normal)
    np.testing.assert_allclose(ahead - gap, 1e-6, rtol=1e-3)
    hole, _ = gap_of(Polyline(corners[::-1], closed=True), points)
    np.testing.assert_allclose(hole, -gap, atol=1e-12)
    prism = Polyline([(x, y, 0.3) for x, y in corners], closed=True, along=(0, 0, 1))
    there, _ = gap_of(prism, np.column_stack([points, rng.uniform(-9, 9, 400)]))
    np.testing.assert_allclose(there, gap, atol=1e-12)


SURFACES: dict[str, tuple[int, Callable[[], Surface]]] = {
    "circle": (2, lambda: Sphere((0.2, 0.3), 0.7)),
    "bore": (2, lambda: Sphere((0.2, 0.3), 0.7, inside=True)),
    "line": (2, lambda: Plane((0, 0), (1, 2))),
    "sphere": (3, lambda: Sphere((0.2, 0.3, 0.4), 0.7)),
    "plane": (3, lambda: Plane((0, 0, 0), (1, 2, 0.5))),
    "cylinder": (3, lambda: Cylinder((0, 0, 0), (1, 1, 0), 1.0)),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_tangents_are_exact(name: str, friction: float) -> None:
    """Differences of the residual of a face and a body that moves; symmetric without friction."""
    dim, make = SURFACES[name]
    kind = "line3" if dim == 2 else "tri6"
    cell, law, rng = CELLS[kind], load_kernel(f"rigid_touch_{dim}"), np.random.default_rng(1)
    k, c, m = len(cell.nodes), cell.corners, 2 if dim == 2 else 4
    points = np.column_stack([cell.nodes, np.zeros(k)])
    multipliers = np.full((k, m), -1)
    multipliers[:c] = k * dim + np.arange(c * m).reshape(c, m)
    motion = k * dim + c * m + np.arange(3 if dim == 2 else 6)
    one = np.ones(1)
    contact = RigidContact(
        name="contact",
        points=points,
        displacements=np.arange(k * dim).reshape(k, dim),
        multipliers=multipliers,
        sides=(ContactSide(kind, np.arange(k)[None], 3.0 * one, one, one),),
        surface=make(),
        law=law,
        motion=motion,
        reference=np.array([0.1, 0.2, 0.3])[:dim],
        friction=friction,
        kernels={kind: RigidContactKernel(law, cell, face_rule(kind), True)},
    )
    x = 0.3 * rng.standard_normal(int(motion[-1]) + 1)
    x[k * dim : k * dim + c * m : m] += 1.5  # in contact
    old = x + 0.1 * rng.standard_normal(len(x))

    def evaluated(x: Any) -> tuple[Any, Any]:
        (found,) = contact.blocks(x, old)
        return found.tangent(x, np.empty(0))

    K, step = evaluated(x)[1][0], 1e-6
    order = contact.blocks(x, old)[0].dofs[0]
    for column, number in enumerate(order):
        e = step * np.eye(len(x))[number]
        known = (evaluated(x + e)[0] - evaluated(x - e)[0])[0] / (2.0 * step)
        np.testing.assert_allclose(K[:, column], known, atol=1e-7 * np.abs(K).max())
    assert np.abs(K - K.T).max() > 1e-2 if friction else np.abs(K - K.T).max() < 1e-12


@pytest.mark.parametrize("surface", ["sphere", "cylinder", "plane"])
def test_force_and_moment_of_a_moving_body(surface: str) -> None:
    """What holds the body holds the block: in force and in moment about the reference point."""
    study = Study(Mesh.box((2, 2, 1), cells=(3, 3, 1)))
    study.add("block", **RUBBER)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.rigid(at=(1, 1, 4), name="punch")
    study.fix("punch", u_x=0.1, u_y=0, u_z=-0.15, theta_x=0, theta_y=0.02, theta_z=0.1)
    shape: Any = {
        "sphere": Sphere((1, 1, 4), 3.0),
        "cylinder": Cylinder((1, 1, 4), (1, 1, 0), 3.0),
        "plane": Plane((1, 1, 1), (0, 0, -1)),
    }[surface]
    study.contact("top", shape, body="punch", friction=0.3)
    result = study.solve(steps=2)
    punch, bottom = result.reaction("punch"), result.reaction("bottom")
    for name in ("u_x", "u_y", "u_z"):
        assert punch[name] == pytest.approx(-bottom[name], rel=1e-8, abs=1e-9)
    force = result._forces
    nodes = study.mesh.nodes("bottom")
    names = ("u_x", "u_y", "u_z")
    at_nodes = np.stack([force[result.system.numbering.nodal[n][nodes]] for n in names], axis=1)
    centre = np.array([1.1, 1.0, 3.85])
    moment = np.cross(study.mesh.points[nodes] - centre, at_nodes).sum(axis=0)
    for name, value in zip(("theta_x", "theta_y", "theta_z"), moment, strict=True):
        assert punch[name] == pytest.approx(-value, rel=1e-7, abs=1e-8)


@softehl.page(form="point")
def weight(m: Any) -> None:
    """Weight along -y."""
    u = m.scalar("u_y")
    (g,) = m.parameters(g="force per volume")
    m.minimise(g * u)


@pytest.mark.filterwarnings("ignore:.*of the energy of the motion:RuntimeWarning")  # first steps
@pytest.mark.parametrize("slope", [0.28, 0.32, 0.6])
def test_a_block_slides_where_the_slope_exceeds_the_friction(slope: float) -> None:
    """From rest it has the velocity g (sin - mu cos) t, or stays."""
    alpha, g, mu = np.arctan(slope), 10.0, 0.3
    Q = np.array([[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]])
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)).map(lambda x: x @ Q.T))
    study.add("block", material="hooke", E=1e6, nu=0.3)
    study.add("weight", weight, g=g)
    study.contact("bottom", Plane((0, 0), Q[:, 1]), friction=mu)
    method = softehl.GeneralisedAlpha(0.0)
    *_, end = study.march(dt=0.04, until=0.4, method=method, mass={"block": {"rho": 1.0}})
    result: Any = end
    velocity = np.array([result.velocity(n).mean() for n in ("u_x", "u_y")]) @ Q
    known = -max(0.0, g * (np.sin(alpha) - mu * np.cos(alpha))) * 0.4
    assert velocity[0] == pytest.approx(known, abs=1e-6)
    assert velocity[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.filterwarnings("ignore::softehl.SoftContact")
@pytest.mark.parametrize("surface", [Plane((0, 0), (1, 0)), Sphere((-1, 0.5), 1.0)])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_an_explicit_impact_keeps_its_energy(surface: Surface, friction: float) -> None:
    """A block that hits a rigid wall flies back; the balance of its energies closes."""
    study = Study(Mesh.rectangle(1, 1, cells=(4, 4)).map(lambda x: x + np.array([0.01, 0.0])))
    study.add("block", material="neo_hooke", mu=100.0, kappa=200.0)
    study.contact("left", surface, friction=friction)
    given: dict[str, Any] = {"mass": {"block": {"rho": 1e-3}}, "method": "explicit"}
    velocity: Any = {"u_x": -20.0, "u_y": 5.0}
    results: Any = list(study.march(dt=4e-4, until=0.02, velocity=velocity, **given))
    first, last = results[0].energy, results[-1].energy
    assert abs(last["balance"]) < 5e-3 * first["kinetic"]
    assert results[-1].velocity("u_x").mean() > 15.0
    if friction == 0.0 and isinstance(surface, Plane):
        assert results[-1].velocity("u_y").mean() == pytest.approx(5.0, rel=1e-9)
    study.rigid(at=(0, 0), name="wall")
    study.fix("wall", u_x=0, u_y=0, theta=0)
    study.contact("right", Plane((3, 0), (-1, 0)), body="wall", name="behind")
    with pytest.raises(StudyError, match="wall:u_x has no mass everywhere"):
        list(study.march(dt=4e-4, until=4e-4, velocity=velocity, **given))


def test_a_rigid_group_meets_a_deformable_side() -> None:
    """A die without pages, rigid as a whole, touches by the search as its surface does."""
    die = Mesh.rectangle(4, 0.5, cells=(3, 1)).map(lambda x: x + np.array([-1.0, 1.0]))
    mesh = Mesh.union(die=die, block=Mesh.rectangle(2, 1, cells=(4, 2)))
    study = Study(mesh)
    study.add("block", cells="block", **RUBBER)
    study.fix("block:bottom", u_x=0, u_y=0)
    study.rigid("die", name="tool")
    study.fix("tool", u_x=0.1, u_y=-0.1, theta=0.05)
    study.contact("block:top", "die:bottom", friction=0.2)
    result = study.solve(steps=2)
    other = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
    other.add("block", **RUBBER)
    other.fix("bottom", u_x=0, u_y=0)
    other.rigid(at=(1.0, 1.25), name="tool")
    other.fix("tool", u_x=0.1, u_y=-0.1, theta=0.05)
    other.contact("top", Plane((0, 1), (0, -1)), body="tool", friction=0.2)
    known = other.solve(steps=2)
    for name, value in known.reaction("tool").items():
        assert result.reaction("tool")[name] == pytest.approx(value, rel=2e-3)


def test_derivatives_and_paths_through_a_rigid_surface() -> None:
    def pressed(mu: float) -> Any:
        study = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
        study.add("block", **{**RUBBER, "mu": mu})
        study.fix("bottom", u_x=0, u_y=0)
        study.rigid(at=(1.0, 3.0), name="ball")
        study.fix("ball", u_x=0, u_y=-0.2, theta=0)
        study.contact("top", Sphere((1.0, 3.0), 2.0), body="ball", stiffness=5.0)
        return study

    study = pressed(1.0)
    result = study.solve()
    slope = result.sensitivity("u_y", reaction="ball", by={"block": ["mu"]})["block", "mu"]
    forces = [pressed(mu).solve().reaction("ball")["u_y"] for mu in (1.0 + 1e-4, 1.0 - 1e-4)]
    assert slope == pytest.approx((forces[0] - forces[1]) / 2e-4, rel=1e-6)
    assert result.unstable == 0
    modes = result.modes(2, mass={"block": {"rho": 1e-9}})
    assert (modes.frequencies > 0.0).all()
    with pytest.raises(StudyError, match="second derivatives through contact"):
        result.hessian("u_y", reaction="ball", by={"block": ["mu"]})


REFUSED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "side": (lambda s: s.contact("top", 3.0), "is no side and no surface"),
    "dimension": (
        lambda s: s.contact("top", Sphere((0, 0, 0), 1.0)),
        "has 3 coordinates, the mesh has 2",
    ),
    "body": (
        lambda s: s.contact("top", plane(2), body="punch"),
        "there is no rigid body 'punch', but none: make it before",
    ),
    "no surface": (lambda s: s.contact("top", body="punch"), "moves a surface"),
    "small": (
        lambda s: (
            s.rigid("left", name="p", rotations="small"),
            s.contact("top", plane(2), body="p"),
        ),
        "surfaces turn by finite ones",
    ),
    "radius": (lambda s: Sphere((0, 0), -1.0), "a positive number is needed"),
    "normal": (lambda s: Plane((0, 0), (0, 0)), "a direction of 2 components"),
    "cylinder": (lambda s: Cylinder((0, 0), (1, 0, 0), 1.0), "in 2-D it is a circle"),
    "corners": (lambda s: Polyline([(0, 0)]), "at least 2 corners"),
    "double": (lambda s: Polyline([(0, 0), (0, 0)]), "at one place"),
    "across": (lambda s: Polyline([(0, 0, 0), (1, 0, 0)], along=(1, 0, 0)), "must be across"),
    "along": (lambda s: Polyline([(0, 0, 0), (1, 0, 0)]), "direction of extrusion"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_work_is_refused(what: str) -> None:
    call, message = REFUSED[what]
    with pytest.raises((StudyError, SurfaceError), match=message):
        call(block())
