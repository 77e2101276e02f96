"""Rigid bodies: closed forms of bars that they bend and twist, motions, loads, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Mesh, Study, StudyError
from softehl.runtime.discretisation.rotations import rotation_matrix, spin_by_rotation

E, LENGTH = 1000.0, 10.0


def bar(
    *, height: float = 1.0, cells: int = 10, material: str = "saint_venant", **rigid: Any
) -> Study:
    """A bar in plane strain without Poisson's effect, clamped on the left, rigid on the right."""
    mesh = Mesh.rectangle(LENGTH, height, cells=(cells, 1), order=2)
    study = Study(mesh)
    study.add("bar", material=material, E=E, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.rigid("right", at=(LENGTH, height / 2), name="grip", **rigid)
    return study


def test_a_moment_bends_a_bar_to_a_circle() -> None:
    """M = E I kappa, exactly at small rotations, whatever the reference point is."""
    study = bar(material="hooke", rotations="small")
    study.load("grip", theta=2.0)
    result, kappa = study.solve(), 2.0 / (E / 12.0)
    motion = result.at("grip")
    assert motion["theta"] == pytest.approx(kappa * LENGTH, rel=1e-9)
    assert motion["u_y"] == pytest.approx(kappa * LENGTH**2 / 2.0, rel=1e-9)
    assert result.iterations <= 2
    other = Study(Mesh.rectangle(LENGTH, 1.0, cells=(10, 1), order=2))
    other.add("bar", material="hooke", E=E, nu=0.0)
    other.fix("left", u_x=0, u_y=0)
    other.rigid("right", at=(LENGTH + 3.0, 5.0), rotations="small")
    other.fix("rigid", theta=kappa * LENGTH)
    held = other.solve()
    assert held.reaction("rigid")["theta"] == pytest.approx(2.0, rel=1e-9)
    assert held.reaction("rigid")["u_y"] == pytest.approx(0.0, abs=1e-9)
    arm = held.at("rigid")["u_x"] - motion["u_x"]
    assert arm == pytest.approx(-motion["theta"] * 4.5, rel=1e-9)


def test_a_full_turn_rolls_a_bar_up() -> None:
    """The rigid end comes back to the clamped one, by a moment 2 pi E I / L (Simo 1985)."""
    moments = []
    for cells in (20, 40):
        study = bar(height=0.1, cells=cells)
        study.fix("grip", theta=2.0 * np.pi)
        result = study.solve(steps=16)
        motion = result.at("grip")
        assert motion["u_x"] == pytest.approx(-LENGTH, rel=2e-5)
        assert motion["u_y"] == pytest.approx(0.0, abs=1e-3)
        closed = 2.0 * np.pi / LENGTH * E * 0.1**3 / 12.0
        moments.append(result.reaction("grip")["theta"] / closed - 1.0)
    assert abs(moments[1]) < 0.005 < abs(moments[0])
    assert abs(moments[0] / moments[1]) > 8.0  # of order 3 at least


def test_newton_is_quadratic_at_large_rotations() -> None:
    study = bar()
    study.load("grip", theta=E / 12.0 / LENGTH, u_y=0.5)
    norms = study.solve(steps=4).residual_norms
    assert norms[-1] < 1e-10
    assert norms[-2] < 1e-3 * norms[-3] ** 0.5


def round_bar(cells: int) -> Mesh:
    """A bar of radius 1 and length 3 along x."""

    def disc(x: Any) -> Any:
        y, z = x[:, 1] - 1.0, x[:, 2] - 1.0
        root = [np.sqrt(1.0 - v**2 / 2.0) for v in (z, y)]
        return np.column_stack([x[:, 0], y * root[0], z * root[1]])

    return Mesh.box((3, 2, 2), cells=(1, cells, cells), order=2).map(disc)


def test_torsion_converges_to_the_closed_form() -> None:
    """theta = M L / (G J), with J of the circle: of order 3 or more in the size of the cells."""
    errors = []
    for cells in (2, 4):
        study = Study(round_bar(cells))
        study.add("bar", material="hooke", E=1000.0, nu=0.25)
        for side in ("left", "right"):
            place = 0.0 if side == "left" else 3.0
            study.rigid(side, at=(place, 0, 0), name=f"{side} end", rotations="small")
        still = dict.fromkeys(("u_x", "u_y", "u_z", "theta_x", "theta_y", "theta_z"), 0.0)
        study.fix("left end", **still)
        study.load("right end", theta_x=1.0)
        result = study.solve()
        errors.append(result.at("right end")["theta_x"] / (3.0 / 400.0 / (np.pi / 2)) - 1.0)
        assert result.reaction("left end")["theta_x"] == pytest.approx(-1.0, rel=1e-9)
    assert 0.0 < errors[1] < 3e-4
    assert np.log2(errors[0] / errors[1]) > 3.0


def block(**rigid: Any) -> Study:
    """A block of rubber in space, held on the left, with a rigid side on the right."""
    study = Study(Mesh.box((3, 1, 1), cells=(2, 1, 1), order=2))
    study.add("bar", material="neo_hooke", mu=400.0, kappa=1000.0)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.rigid("right", name="grip", **rigid)
    return study


def test_moments_in_space_are_about_axes_that_do_not_turn() -> None:
    """The motion under a force and three moments needs just these; so do the supports."""
    forces = {"u_x": 0.0, "u_y": 3.0, "u_z": 0.0}
    moments = {"theta_x": 40.0, "theta_y": 10.0, "theta_z": 20.0}
    loaded = block()
    loaded.load("grip", **forces, **moments)
    result = loaded.solve(steps=3)
    motion = result.at("grip")
    assert np.linalg.norm([motion[n] for n in moments]) > 1.5
    assert result.residual_norms[-1] < 1e-10
    assert result.residual_norms[-2] < 1e-6  # quadratic, with a tangent that is not symmetric
    held = block()
    held.fix("grip", **motion)
    found = held.solve(steps=3).reaction("grip")
    for name, value in {**forces, **moments}.items():
        assert found[name] == pytest.approx(value, rel=1e-8, abs=1e-8), name
    assert found["theta_x"] != pytest.approx(41.0, rel=1e-3)


def test_spin_is_the_derivative_of_the_rotation() -> None:
    rng = np.random.default_rng(3)
    for theta in (np.array([0.7, -0.4, 0.9]), np.array([1e-6, 2e-6, 0.0])):
        change, step = rng.standard_normal(3), 1e-6
        ahead, behind = (rotation_matrix(theta + s * step * change) for s in (1.0, -1.0))
        spin = (ahead - behind) / (2.0 * step) @ rotation_matrix(theta).T
        axial = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(axial, spin_by_rotation(theta) @ change, atol=1e-9)
        np.testing.assert_allclose(spin + spin.T, 0.0, atol=1e-9)


@softehl.page(form="point")
def weight(m: Any) -> None:
    """Weight of a body along -y."""
    u = m.scalar("u_y")
    (g,) = m.parameters(g="force per volume")
    m.minimise(g * u)


def pendulum() -> Study:
    """A slab that is rigid as a whole and turns about the middle of its left side."""
    mesh = Mesh.rectangle(2, 0.2, cells=(4, 1)).map(lambda x: x - [0.0, 0.1])
    study = Study(mesh.with_group("all", lambda x: x[:, 0] > -1.0))
    study.add("slab", material="neo_hooke", mu=1000.0, kappa=2000.0)
    study.add("weight", weight, g=10.0)
    study.rigid("all", at=(0, 0), name="pendulum")
    study.fix("pendulum", u_x=0, u_y=0)
    return study


@pytest.mark.parametrize(("method", "limit"), [("generalised-alpha", 1e-2), ("midpoint", 4e-3)])
def test_a_rigid_slab_is_a_pendulum(method: Any, limit: float) -> None:
    """The angle after half a swing is that of theta'' = - m g d cos(theta) / I."""
    steps = list(pendulum().march(dt=0.02, until=1.0, method=method, mass={"slab": {"rho": 1.0}}))
    mass = 0.4
    inertia = mass * (2.0**2 + 0.2**2) / 12.0 + mass
    theta, omega, h = 0.0, 0.0, 1e-4
    for _ in range(10_000):  # the leapfrog scheme
        omega -= h * mass * 10.0 * np.cos(theta + 0.5 * h * omega) / inertia
        theta += h * omega
    found = steps[-1].at("pendulum")["theta"]
    assert found < -2.5
    assert found == pytest.approx(theta, abs=limit)
    energy: Any = steps[-1]
    largest = max(abs(step.energy["kinetic"]) for step in steps)  # type: ignore[attr-defined]
    assert abs(energy.energy["balance"]) < (1e-8 if method == "midpoint" else 1e-2) * largest


def test_undamped_schemes_are_refused() -> None:
    with pytest.raises(StudyError, match="is a multiplier"):
        list(pendulum().march(dt=0.1, until=0.1, method="newmark", mass={"slab": {"rho": 1.0}}))


def test_paths_modes_and_derivatives() -> None:
    """Arc length meets the load steps, modes those of a bar, slopes those of other runs."""
    study = bar()
    study.load("grip", theta=E / 12.0 / LENGTH)
    known = study.solve(steps=2)
    path = study.follow(step=0.5, until=lambda result: result.t >= 1.0)
    factors = [result.t for result in path.results]
    angles = [result.at("grip")["theta"] for result in path.results]
    near = study.solve(until=factors[-1], start=path.results[-2])
    assert near.at("grip")["theta"] == pytest.approx(angles[-1], rel=1e-8)
    free = Study(study.mesh)
    free.add("bar", material="saint_venant", E=E, nu=0.0)
    free.rigid("right")
    frequencies = free.modes(4, mass={"bar": {"rho": 1e-9}}).frequencies
    assert (frequencies[:3] == 0.0).all()
    assert frequencies[3] > 0.0
    assert known.unstable == 0

    def angle(modulus: float) -> float:
        other = study.varied({("bar", "E"): modulus})
        return other.solve(steps=2).at("grip")["theta"]

    slope = known.sensitivity("theta", at="grip", by={"bar": ["E"]})["bar", "E"]
    assert slope == pytest.approx((angle(E + 0.1) - angle(E - 0.1)) / 0.2, rel=1e-5)
    bent = bar()
    bent.fix("grip", theta=1.0)
    result = bent.solve(steps=2)
    moment = result.sensitivity("theta", reaction="grip", by={"bar": ["E"]})["bar", "E"]
    assert moment == pytest.approx(result.reaction("grip")["theta"] / E, rel=1e-8)
    fit = bent.fit({"grip": {"theta": 0.5 * result.reaction("grip")["theta"]}}, by={"bar": ["E"]})
    assert fit.values["bar", "E"] == pytest.approx(0.5 * E, rel=1e-6)


def test_a_march_restarts_bitwise(tmp_path: Any) -> None:
    study, file = bar(cells=2), tmp_path / "checkpoint.npz"
    study.fix("grip", theta=lambda x, t: np.sin(t))
    given: dict[str, Any] = {"dt": 0.1, "method": "bdf2"}
    *_, known = study.march(until=0.4, **given)
    for _ in study.march(until=0.2, checkpoint=file, **given):
        pass
    *_, result = study.march(until=0.4, restart=file, **given)
    np.testing.assert_array_equal(result.x, known.x)


def test_a_ring_moves_along_its_axis() -> None:
    """The force on a rigid end of a tube is that on a clamped end which is moved as one."""
    mesh = Mesh.rectangle(2, 1, cells=(4, 2)).map(lambda x: x + np.array([0.0, 1.0]))
    studies = [Study(mesh, geometry="axisymmetric") for _ in range(2)]
    for study in studies:
        study.add("tube", material="neo_hooke", mu=1.0, kappa=3.0)
        study.fix("left", u_x=0, u_y=0)
    studies[0].rigid("right", name="end")
    studies[0].fix("end", u_x=0.2)
    studies[1].fix("right", u_x=0.2, u_y=0)
    one, other = (study.solve() for study in studies)
    assert one.reaction("end")["u_x"] == pytest.approx(other.reaction("right")["u_x"], rel=1e-9)
    with pytest.raises(StudyError, match="moves along the axis alone"):
        studies[0].load("end", theta=1.0)


def test_a_rigid_inclusion_is_a_very_stiff_one() -> None:
    """Mean stress and tangent of a periodic cell."""

    def inside(x: Any) -> Any:
        return np.linalg.norm(x - 0.5, axis=1) < 0.26

    mesh = Mesh.rectangle(1, 1, cells=(8, 8)).with_group("core", inside)
    mesh = mesh.with_group("rest", lambda x: ~inside(x))
    F, found = np.array([[1.05, 0.1], [0.0, 0.98]]), []
    for rigid in (True, False):
        study = Study(mesh)
        study.add("rest", material="neo_hooke", mu=1.0, kappa=3.0, cells="rest")
        if rigid:
            study.rigid("core", name="inclusion")
        else:
            study.add("core", material="neo_hooke", mu=1e6, kappa=3e6, cells="core")
        found.append(study.periodic(("left", "right"), ("bottom", "top")).solve(F))
    np.testing.assert_allclose(found[0].P, found[1].P, rtol=2e-5)
    np.testing.assert_allclose(found[0].A, found[1].A, rtol=2e-5, atol=2e-5)


REFUSED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "side": (lambda s: s.rigid("top", name="left"), "is a side or a group of the mesh"),
    "taken": (lambda s: s.rigid("top", name="grip"), "the name is taken: bar, grip"),
    "point": (lambda s: s.rigid((0.0, 1.0), name="p"), "nodes are at one place"),
    "nothing": (lambda s: s.rigid(name="p"), "give a side, or the reference point"),
    "place": (lambda s: s.rigid("top", at=(0.0,), name="p"), "2 finite coordinates are needed"),
    "rotations": (lambda s: s.rigid("top", rotations="big", name="p"), "allowed are finite, small"),
    "component": (lambda s: s.fix("grip", theta_x=1), r"no 'theta_x' \(did you mean 'theta'"),
    "both": (lambda s: (s.rigid("top", name="lid"), s.solve()), "belongs to the rigid bodies"),
    "fixed": (lambda s: (s.fix("right", u_x=0), s.solve()), "moves with the rigid body 'grip'"),
    "alone": (lambda s: (s.rigid(at=(0, 0), name="p"), s.solve()), "has no side and no surface"),
    "tied": (lambda s: (s.tie("right", "left", "u_x"), s.solve()), "a tie joins a node"),
    "explicit": (
        lambda s: list(s.march(dt=1e-6, until=1e-6, method="explicit", mass={"bar": {"rho": 1}})),
        "has no mass everywhere",
    ),
    "amg": (lambda s: s.solve(linear="amg"), "multigrid needs"),
    "hessian": (
        lambda s: s.solve().hessian("theta", at="grip", by={"bar": ["E"]}),
        "comes as C without second derivatives",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_work_is_refused(what: str) -> None:
    call, message = REFUSED[what]
    with pytest.raises(StudyError, match=message):
        call(bar())


def test_a_line_of_nodes_in_space_is_refused() -> None:
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    with pytest.raises(StudyError, match="nodes are on a line"):
        study.rigid(lambda x: (x[:, 0] == 0.0) & (x[:, 1] == 0.0))
