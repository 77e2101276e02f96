"""What `print` shows of an object: what it is, in a line or two, however large it is."""

from __future__ import annotations

from typing import Any

import pytest

import softehl
from softehl import Mesh, Study

MOST = 250
"""Characters."""


def body(n: int) -> Study:
    study = Study(Mesh.rectangle(1, 1, cells=(n, n)).with_group("low", lambda x: x[:, 1] < 0.5))
    study.add("body", material="neo_hooke", mu=1.0, kappa=2.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=0.001)
    return study


def cell() -> Any:
    study = Study(Mesh.rectangle(1, 1, cells=(9, 9)))
    study.add("matrix", material="neo_hooke", mu=1.0, kappa=2.0)
    return study.periodic(("left", "right"), ("bottom", "top"))


@softehl.page
def heat(m: Any) -> None:
    """A page."""
    m.minimise(m.grad(m.scalar("T")).dot(m.grad(m.scalar("u", order=1))))


@pytest.fixture(scope="module")
def shown() -> dict[str, Any]:
    study, mass = body(9), {"body": {"rho": 1.0}}
    result = study.solve()
    modes = result.modes(2, mass=mass)
    path = study.follow(step=0.2, until=lambda r: r.t > 1)
    homogenised = cell().solve([[1.01, 0], [0, 1.0]])
    with pytest.warns(RuntimeWarning, match="of the stiffness of the mode is left"):
        buckling = study.buckling()
    return {
        "mesh": study.mesh,
        "study": study,
        "result": result,
        "motion": next(study.march(dt=1.0, until=1.0, method="newmark", mass=mass)),
        "path": path,
        "modes": modes,
        "shape": modes[0],
        "fit": study.fit({(1, 1): {"u_y": 0.005}}, by={"body": ["mu"]}),
        "objective": study.objective("u_y", by={"body": ["mu"]}, at=(1, 1)),
        "buckling": buckling,
        "cell": homogenised.cell,
        "homogenised": homogenised,
        "kernel": softehl.load_kernel("solid_q4"),
        "system": study.system(),
        "problem": result.problem,
        "assembler": result.problem.assembler,
        "block": result.problem.assembler.blocks[0],
        "solution": result.point.solution,
        "point": result.point,
        "trail": result.trail,
        "rule": softehl.load_kernel("solid_q4").default_rule,
        "definition": heat.definition("quad9"),
        "page": heat,
        "element": softehl.element("hex27"),
        "quadrature": softehl.quadrature.gauss(4, 3),
        "newton": softehl.Newton(),
    }


def test_all_are_short(shown: dict[str, Any]) -> None:
    lengths = {name: len(repr(thing)) for name, thing in shown.items()}
    assert {name: n for name, n in lengths.items() if n > MOST or n < 10} == {}
    assert len(repr(Mesh.rectangle(1, 1, cells=(99, 99)))) < MOST


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "mesh",
            "<Mesh: 100 points in 2-D, 81 quad4; groups: low; sides: left, right, bottom, top>",
        ),
        ("study", "<Study: 81 quad4; blocks: body (neo_hooke_quad4); 2 fix, 1 load>"),
        ("result", "<Result at t = 1: 200 unknowns (u_x, u_y); blocks: body>"),
        ("motion", "<Motion at t = 1: 200 unknowns (u_x, u_y); blocks: body>"),
        ("definition", "<Definition heat_quad9: 9 nodes; unknowns: T1, T2, T3, T4, T5, ... (13)>"),
    ],
)
def test_they_say_what_they_are(shown: dict[str, Any], name: str, text: str) -> None:
    assert repr(shown[name]) == text


def test_numbers_that_were_asked_for_are_shown(shown: dict[str, Any]) -> None:
    assert f"('body', 'mu') = {shown['fit'].values['body', 'mu']:.6g}" in repr(shown["fit"])
    assert f"{shown['modes'].frequencies[0]:.6g}" in repr(shown["modes"])
    assert f"{shown['buckling'].factors[0]:.6g}" in repr(shown["buckling"])
    results = shown["path"].results
    text = f"{len(results)} results, load factor 0 to {results[-1].t:.6g}"
    assert text in repr(shown["path"])
