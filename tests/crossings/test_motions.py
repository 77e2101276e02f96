"""Reactions of moving bodies: with the loads they give the change of momentum."""

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.arrays import Array

RHO, DT = 0.5, 0.05


def push(t: float) -> float:
    """Load along x."""
    return float(0.1 * np.sin(1.5 * t) ** 2)


def pushed(holds: str) -> Study:
    """A block that is pushed on the right, and held on the left."""
    study = Study(Mesh.rectangle(2, 1, cells=(4, 1)))
    study.add("body", material="hooke", E=2.0, nu=0.0)
    study.load("right", u_x=lambda x, t: np.full(len(x), push(t)))
    study.fix(lambda x: np.ones(len(x), dtype=bool), u_y=0)
    if holds == "moving support":
        study.fix("left", u_x=lambda x, t: np.full(len(x), 0.1 * t * (1 - np.cos(2 * t))))
    elif holds == "tie":
        study.tie("left", (0.0, 0.0), "u_x")
        study.fix((0.0, 0.0), u_x=0)
    else:
        study.spring("left", u_x=0.5)
    return study


def momentum(velocities: Array) -> float:
    """Along x, of the block; masses of rectangles have the row sums of lumped ones."""
    columns = np.add.reduceat(
        velocities[np.argsort(pushed("spring").mesh.points[:, 0])], [0, 2, 4, 6, 8]
    )
    return float(RHO * 0.5 * 0.5 * (columns @ [0.5, 1, 1, 1, 0.5]))


@pytest.mark.parametrize("holds", ["moving support", "tie", "spring"])
@pytest.mark.parametrize("method", ["newmark", "midpoint", "explicit", "generalised-alpha"])
def test_reactions_and_loads_change_the_momentum(method: str, holds: str) -> None:
    """Inertia of the nodes that are held is in their reaction; elsewhere there is none."""
    mass = {"body": {"rho": RHO}}
    *_, before, after = pushed(holds).march(dt=DT, until=0.5, method=method, mass=mass)  # type: ignore[arg-type]
    change = (momentum(after.velocity("u_x")) - momentum(before.velocity("u_x"))) / DT  # type: ignore[attr-defined]
    if method != "midpoint":  # whose forces are means of the step
        inertia = momentum(after.acceleration("u_x"))  # type: ignore[attr-defined]
        assert push(after.t) + after.reaction("left")["u_x"] == pytest.approx(
            inertia, rel=0.05 if method == "generalised-alpha" else 1e-9
        )
    else:
        load = push(0.5 * (before.t + after.t))
        assert load + after.reaction("left")["u_x"] == pytest.approx(change, rel=1e-9)
    free = abs(after.reaction("right")["u_x"])
    assert free < (1e-3 if method == "generalised-alpha" else 1e-12)
