"""Contact in explicit dynamics: impact of bars, friction, stable steps, going on."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, Motion, SoftContact, StiffContact, Study, StudyError
from tests.runtime.touching_bodies import elastic

E, RHO, LENGTH, SPEED = 100.0, 1.0, 1.0, 1e-3
WAVE = (E / RHO) ** 0.5
RUBBER: dict[str, Any] = {"mu": E / 2, "K": E / 3}  # Poisson's ratio 0
GAP = 1e-9


def bars(cells: int, dimension: int = 2, **contact: Any) -> Study:
    """Two equal bars in a row, which nearly touch."""
    if dimension == 2:
        left = Mesh.rectangle(LENGTH, 0.1, cells=(cells, 1))
    else:
        left = Mesh.box((LENGTH, 0.1, 0.1), cells=(cells, 1, 1))
    right = left.map(lambda x: x + np.eye(dimension)[0] * (LENGTH + GAP))
    study = Study(Mesh.union(left=left, right=right))
    for name in ("left", "right"):
        study.add(name, elastic, cells=name, **RUBBER)
    study.contact("left:right", "right:left", **contact)
    return study


def explicit(study: Study, **arguments: Any) -> list[Motion]:
    mass = {name: {"rho": RHO} for name in ("left", "right")}
    arguments = {"mass": mass, "method": "explicit", **arguments}
    return [r for r in study.march(**arguments) if isinstance(r, Motion)]


def of_left(value: float) -> Any:
    return lambda x: np.where(x[:, 0] < LENGTH + GAP / 2, value, 0.0)


def momentum(motion: Motion, name: str = "u_x") -> float:
    """Of both bars: masses at the nodes times velocities."""
    mesh, total = motion.system.mesh, 0.0
    for kind, cells in mesh.cells.items():
        share = RHO * 0.1 ** (mesh.dimension - 1) * LENGTH * 2 / len(cells) / cells.shape[1]
        assert kind in ("quad4", "hex8")
        total += share * float(motion.velocity(name)[cells].sum())
    return total


@pytest.mark.parametrize("dimension", [2, 3])
def test_impact_of_two_equal_bars(dimension: int) -> None:
    """In contact for 2 L / c at rho c v / 2; then the velocities are exchanged (St. Venant)."""
    time = 2 * LENGTH / WAVE
    study = bars(40 if dimension == 2 else 20, dimension)
    states = explicit(study, dt=time / 20, until=1.5 * time, velocity={"u_x": of_left(SPEED)})
    stress = []
    for state in states:
        found = state.fields("contact")
        stress.append(float((found["pressure"] * found["area"]).sum()) / 0.1 ** (dimension - 1))
    touching = np.array(stress) > 0.25 * RHO * WAVE * SPEED
    assert np.count_nonzero(touching) / 20 == pytest.approx(1.0, abs=0.06)
    middle = np.mean(stress[6:15])
    assert middle == pytest.approx(RHO * WAVE * SPEED / 2, rel=0.02)
    v, left = states[-1].velocity("u_x"), states[-1].system.mesh.points[:, 0] < LENGTH + GAP / 2
    assert abs(v[left].mean()) < 0.01 * SPEED
    assert v[~left].mean() == pytest.approx(SPEED, rel=0.01)
    begin = RHO * LENGTH * 0.1 ** (dimension - 1) * SPEED
    for state in states:
        assert momentum(state) == pytest.approx(begin, rel=1e-12)
        assert abs(state.energy["balance"]) < 3e-3 * begin * SPEED / 2


def sliding(pressure: float, speed: float, friction: float, stiffness: float) -> Study:
    """A block on a held plate, in equilibrium with a pressure by its penetration."""
    plate = Mesh.rectangle(1.2, 0.1, cells=(6, 1))
    block = Mesh.rectangle(0.2, 0.1, cells=(2, 1)).map(
        lambda x: x + np.array([0.3, 0.1 - pressure / stiffness])
    )
    study = Study(Mesh.union(left=block, right=plate))
    study.add("left", elastic, cells="left", mu=E / 2, K=E / 3)
    study.add("right", elastic, cells="right", mu=E / 2, K=E / 3)
    study.contact("left:bottom", "right:top", friction=friction, stiffness=stiffness, depth=0.05)
    study.fix("right", u_x=0, u_y=0)
    study.load("left:bottom", u_y=-pressure)
    return study


def test_friction_stops_a_block_and_takes_its_energy() -> None:
    """It stops after m v / (mu N), which does the work m v^2 / 2; then it sticks."""
    pressure, speed, friction, stiffness = 0.05, 0.2, 0.3, 50.0
    study = sliding(pressure, speed, friction, stiffness)
    moving = {"u_x": lambda x: speed * (x[:, 0] > -1)}
    mass = RHO * 0.1  # per area of the contact
    stop = mass * speed / (friction * pressure)
    states = explicit(study, dt=stop / 8, until=1.5 * stop, velocity=moving)
    at, mesh = [], states[0].system.mesh
    block = mesh.nodes("left")
    for state in states:
        at.append(state.velocity("u_x")[block].mean() / speed)
    times = np.array([s.t for s in states]) / stop
    np.testing.assert_allclose(at[:6], 1 - times[:6], atol=0.03)
    assert abs(at[-1]) < 0.05
    kinetic = 0.5 * mass * 0.2 * speed**2
    assert states[-1].energy["internal"] == pytest.approx(kinetic, rel=0.05)
    assert abs(states[-1].energy["balance"]) < 0.02 * kinetic
    plate = states[2].reaction("right")
    assert plate["u_x"] == pytest.approx(-friction * pressure * 0.2, rel=0.05)
    # it goes on as if it had not stopped
    half = explicit(study, dt=stop / 8, until=0.5 * stop, velocity=moving)[-1]
    on = explicit(study, dt=stop / 8, until=1.5 * stop, start=half)[-1]
    whole = states[-1].values("u_x")
    np.testing.assert_allclose(on.values("u_x"), whole, atol=1e-9 * np.abs(whole).max())


def test_a_stiff_contact_shortens_the_steps_and_stays_stable() -> None:
    """Bars that begin apart: the step must know the contact before it closes."""
    study = bars(10, stiffness=1e5)
    time = 2 * LENGTH / WAVE
    with pytest.warns(StiffContact, match="shortens the stable step from 0.01 to 0.0009"):
        states = explicit(study, dt=time, until=2 * time, velocity={"u_x": of_left(SPEED)})
    assert np.abs(states[-1].velocity("u_x")).max() < 5 * SPEED
    # its impact gains energy, and the balance does not hide it
    assert states[-1].energy["balance"] > 0.1 * states[0].energy["kinetic"]


def test_bodies_that_overlap_instead_of_being_pressed_are_reported() -> None:
    """The default penalty takes a seventh of the energy; as much of the static force lacks."""
    time, force = 20 * LENGTH / WAVE, E / 2 * 0.1 * 0.01
    found = []
    for stiffness in (None, 3e3):
        study = bars(5, stiffness=stiffness)
        study.fix("left:left", u_x=0, u_y=0)
        study.fix("right:right", u_x=lambda x, t: np.full(len(x), -0.01 * t / time), u_y=0)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            states = explicit(study, dt=time / 16, until=time)[8:]  # waves about the mean
        forces = [-s.reaction("right:right")["u_x"] * time / s.t for s in states]
        found.append(float(np.mean(forces)) / force)
        assert [w.category for w in caught] == ([] if stiffness else [SoftContact])
    assert found == pytest.approx([0.85, 1.0], abs=0.03)


def test_a_start_with_pressures_but_without_penetration_is_refused() -> None:
    study = bars(4)
    study.fix("left:left", u_x=0, u_y=0)
    study.fix("right:right", u_x=-0.01, u_y=0)
    static = study.solve()
    with pytest.raises(StudyError, match=r"explicit: the start has contact pressures up to 0\.\d"):
        explicit(study, dt=0.01, until=1.02, start=static)
