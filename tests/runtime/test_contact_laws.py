"""Contact by laws of one's own: the built-in one as a page, conductance, cohesion, wear."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Result, Study, StudyError
from softehl.runtime.arrays import Array
from softehl.runtime.contact.penalty import with_penalty
from softehl.runtime.contact.search import StateDependentBlocks
from softehl.runtime.equations.system_builder import build_system
from tests.runtime.contact_laws import archard, cohesion, conductance, penalty
from tests.runtime.touching_bodies import elastic


@softehl.page
def linear(m: Any) -> None:
    """Hooke's law without Poisson's effect."""
    u = m.vector("u")
    (E,) = m.parameters(E="Young's modulus [MPa]")
    G = m.grad(u)
    e = (G + G.T) / 2
    m.minimise(E / 2 * sum(v**2 for v in e))


@softehl.page
def heat(m: Any) -> None:
    """Conduction; the rate of the temperature with a capacity c."""
    T = m.scalar("T")
    k, c = m.parameters(k="conductivity [W/mm/K]", c="capacity [J/mm^3/K]")
    m.weak(k * m.grad(T), m.grad(T))
    m.weak(c * m.rate(T), T)


def blocks(dimension: int, orders: tuple[int, int], inclined: float = 0.0) -> Mesh:
    """An upper block on a lower one, which it overlaps by 0.02 or touches; meshes do not match."""
    sink = 0.02 * bool(inclined)

    def up(x: Array) -> Array:
        side = [0.1] * (dimension - 1) if inclined else [0.0] * (dimension - 1)
        raised = np.array([*side, 1 - sink]) + inclined * x[:, :1] * np.eye(dimension)[-1]
        return np.asarray(x + raised)

    if dimension == 2:
        upper = Mesh.rectangle(1, 0.5, cells=(3, 1), order=orders[0])
        lower = Mesh.rectangle(1 + 10 * sink, 1, cells=(4, 2), order=orders[1])
    else:
        upper = Mesh.box((1, 1, 0.5), cells=(2, 1, 1), order=orders[0])
        lower = Mesh.box((1 + 10 * sink, 1 + 10 * sink, 1), cells=(3, 2, 1), order=orders[1])
    return Mesh.union(upper=upper.map(up), lower=lower)


def assembled(contact: StateDependentBlocks, x: Array, old: Array) -> tuple[Array, Array]:
    """Residual (n,) and tangent (n, n) of a contact alone."""
    r, K = np.zeros(len(x)), np.zeros((len(x), len(x)))
    for block in contact.blocks(x, old):
        values = getattr(block.kernel, "values", {})
        parameters = np.array([values[name] for name in block.kernel.parameters])
        R, T = block.tangent(x, parameters)
        np.testing.assert_allclose(block.residual(x, parameters), R, atol=1e-14)
        np.add.at(r, block.dofs, R)
        for dofs, entries in zip(block.dofs, T, strict=True):
            K[np.ix_(dofs, dofs)] += entries
    return r, K


@pytest.mark.parametrize(
    ("dimension", "orders"), [(2, (1, 1)), (2, (2, 1)), (2, (1, 2)), (3, (1, 1)), (3, (2, 1))]
)
def test_the_built_in_contact_is_a_law(dimension: int, orders: tuple[int, int]) -> None:
    """As a page it has the forces and the tangent of the kernels that ship, to rounding."""
    states = []
    for law in (True, False):
        study = Study(blocks(dimension, orders, inclined=0.05))
        study.add("body", elastic, mu=10, K=20)
        given: dict[str, Any] = {"law": penalty, "k": 7, "mu": 0.3, "reach": 0.5}
        if not law:
            given = {"stiffness": 7, "friction": 0.3}
        study.contact("upper:bottom", "lower:top", depth=0.3, **given)
        system = build_system(study._definition)
        numbers = np.stack([system.numbering.nodal[f"u_{c}"] for c in "xyz"[:dimension]])
        rng = np.random.default_rng(1)
        x, old = np.zeros(system.size), np.zeros(system.size)
        x[numbers], old[numbers] = (0.01 * rng.standard_normal(numbers.shape) for _ in "12")
        contact = system.contacts[0] if law else with_penalty(system.contacts[0])  # type: ignore[arg-type]
        r, K = assembled(contact, x, old)
        states.append((r[numbers.ravel()], K[np.ix_(numbers.ravel(), numbers.ravel())]))
        if law:
            v = rng.standard_normal(len(x))
            ahead, back = (assembled(contact, x + h * v, old)[0] for h in (1e-6, -1e-6))
            difference = (ahead - back) / 2e-6
            np.testing.assert_allclose(K @ v, difference, atol=1e-6 * np.abs(difference).max())
    (r, K), (r_shipped, K_shipped) = states
    assert np.abs(r).max() > 1e-3
    np.testing.assert_allclose(r, r_shipped, atol=1e-13 * np.abs(r).max())
    np.testing.assert_allclose(K, K_shipped, atol=1e-12 * np.abs(K).max())


def conducting(dimension: int = 2, orders: tuple[int, int] = (1, 1), **h: Any) -> Study:
    study = Study(blocks(dimension, orders))
    study.add("upper", heat, cells="upper", k=2, c=0.1)
    study.add("lower", heat, cells="lower", k=3, c=0.1)
    study.contact("upper:bottom", "lower:top", law=conductance, name="seat", **(h or {"h": 0.7}))
    study.fix("upper:top", T=100)
    study.fix("lower:bottom", T=0)
    return study


RESISTANCE = 0.5 / 2 + 1 / 0.7 + 1 / 3


@pytest.mark.parametrize(("dimension", "orders"), [(2, (1, 1)), (2, (1, 2)), (3, (1, 1))])
def test_conductances_in_a_row(dimension: int, orders: tuple[int, int]) -> None:
    """On meshes that do not match, without displacements: 1 / q = 1 / q1 + 1 / h + 1 / q2."""
    result = conducting(dimension, orders).solve()
    found = result.fields("seat")
    np.testing.assert_allclose(found["flux"], 100 / RESISTANCE, rtol=1e-12)
    assert found["area"].sum() == pytest.approx(1.0, rel=1e-12)
    assert result.reaction("lower:bottom")["T"] == pytest.approx(-100 / RESISTANCE, rel=1e-12)


def test_conductance_on_the_way() -> None:
    """March, arc length and derivatives go through a law; its parameters may depend on time."""
    closing = conducting(h=lambda t: 0.7 * min(t, 1.0))
    *_, last = closing.march(dt=0.25, until=6.0, method="euler")
    assert last.reaction("lower:bottom")["T"] == pytest.approx(-100 / RESISTANCE, rel=1e-3)
    study = conducting()
    path = study.follow(step=0.5, until=lambda r: r.t >= 1.0)
    at = path.results[-1]
    assert at.fields("seat")["flux"] == pytest.approx(100 * at.t / RESISTANCE, rel=1e-9)
    slope = study.solve().sensitivity("T", reaction="lower:bottom", by={"upper": ["k"]})
    expected = -100 / RESISTANCE**2 * 0.5 / 2**2
    assert slope["upper", "k"] == pytest.approx(expected, rel=1e-9)


def test_a_parameter_of_a_law_is_an_input() -> None:
    """dq/dh = q^2 / (100 h^2), adjoint and direct; a fit finds it."""
    study, expected = conducting(), -100 / RESISTANCE**2 / 0.7**2
    result = study.solve()
    slope = result.sensitivity("T", reaction="lower:bottom", by={"seat": ["h"]})
    assert slope["seat", "h"] == pytest.approx(expected, rel=1e-12)
    ahead, other = (study.varied({("seat", "h"): h}).solve() for h in (0.7 + 1e-5, 0.3))
    rates = result.derivative(by={"seat": ["h"]}).reshape(len(result.x))
    np.testing.assert_allclose(rates, (ahead.x - result.x) / 1e-5, atol=1e-3)
    measured = {"lower:bottom": {"T": other.reaction("lower:bottom")["T"]}}
    assert study.fit(measured, by={"seat": ["h"]}).values["seat", "h"] == pytest.approx(0.3)
    with pytest.raises(StudyError, match="'seat' has no 'k'; it has h"):
        result.sensitivity("T", reaction="lower:bottom", by={"seat": ["k"]})


def test_a_law_is_part_of_the_size_of_a_study() -> None:
    """A result knows that a contact came after it."""
    study = Study(blocks(2, (1, 1)))
    study.add("body", heat, k=1, c=1)
    study.fix("upper:top", T=1)
    study.fix("lower:bottom", T=0)
    before = study.solve()
    study.contact("upper:bottom", "lower:top", law=conductance, h=1e9)
    assert study.solve().reaction("upper:top")["T"] == pytest.approx(1 / 1.5, rel=1e-6)
    with pytest.raises(StudyError, match="the study was changed after this result"):
        before.sensitivity("T", reaction="upper:top", by={"body": ["k"]})


def test_conductance_of_a_deformed_contact() -> None:
    """Pressed blocks: mechanics by the built-in contact, heat by a law, on their deformed sides."""
    study = Study(blocks(2, (1, 1)))
    study.add("body", linear, E=10)
    study.add("heat", heat, k=2, c=0.1)
    study.contact("upper:bottom", "lower:top", name="pressed")
    study.contact("upper:bottom", "lower:top", law=conductance, h=0.7, name="seat")
    study.fix("lower:bottom", u_x=0, u_y=0, T=0)
    study.fix("upper:top", u_x=0, u_y=-0.1, T=100)
    result = study.solve()
    resistance = 0.5 / 2 + 1 / 0.7 + 1 / 2
    np.testing.assert_allclose(result.fields("seat")["flux"], 100 / resistance, rtol=1e-9)
    assert result.fields("pressed")["pressure"] == pytest.approx(1 / 1.5, rel=1e-9)


STRENGTH, WIDTH, YOUNG = 1.0, 0.05, 40.0


def pulled() -> Study:
    """Two bars with cohesion at their common end."""
    study = Study(blocks(2, (1, 1)))
    study.add("body", linear, E=YOUNG)
    study.contact("upper:bottom", "lower:top", law=cohesion, s=STRENGTH, d=WIDTH, reach=1.0)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.fix("upper:top", u_x=0, u_y=0.3)
    return study


def test_two_bars_are_pulled_apart() -> None:
    """u = g + t(g) L / E with t = e s (g / d) exp(-g / d), before and after the strength."""
    path: list[Result] = []
    pulled().solve(steps=24, on_step=path.append)
    forces = []
    for result in path:
        nodes = result.system.mesh.nodes("upper:bottom")
        stress = result.reaction("upper:top")["u_y"]
        g = 0.3 * result.t - 1.5 * stress / YOUNG
        law = STRENGTH * (g / WIDTH) * np.exp(1 - g / WIDTH)
        assert stress == pytest.approx(law, rel=1e-9)
        assert len(nodes)
        forces.append(stress)
    assert max(forces) == pytest.approx(STRENGTH, rel=0.02)
    assert forces[-1] < 0.1 * STRENGTH


def test_arc_length_goes_over_the_strength() -> None:
    """Control of the length follows the fall of the force, where load steps may jump."""
    path = pulled().follow(step=0.05, until=lambda r: r.t > 1.0)
    forces = [result.reaction("upper:top")["u_y"] for result in path.results]
    assert max(forces) == pytest.approx(STRENGTH, rel=1e-3)
    assert forces[-1] < 0.1 * STRENGTH


def worn(steps: int, **given: Any) -> Result:
    """A block under a dead load on a plate that is drawn away beneath it."""
    study = wearing()
    pressed = study.solve()
    return study.solve(steps=steps, start=pressed, until=2.0, **given)


def wearing() -> Study:
    """The study of `worn`: it presses until 1, then it draws."""
    plate = Mesh.rectangle(3, 0.2, cells=(10, 1))
    block = Mesh.rectangle(1, 0.5, cells=(3, 1)).map(lambda x: x + np.array([0.2, 0.199]))
    study = Study(Mesh.union(block=block, plate=plate))
    study.add("body", linear, E=100)
    study.contact("block:bottom", "plate:top", law=archard, k=0.02, e=50, name="seat")
    study.fix("plate", u_x=lambda x, t: -1.5 * max(t - 1, 0), u_y=0)
    study.fix("block", u_x=0)
    study.load("block:top", u_y=lambda x, t: np.full(len(x), -0.5 * min(t, 1)))
    return study


def test_archard_wears_by_pressure_times_way() -> None:
    """Depth k p s under a constant pressure, which the block follows down; history goes on."""
    result = worn(5)
    found = result.fields("seat")
    depth = 0.02 * 0.5 * 1.5
    np.testing.assert_allclose(found["pressure"], 0.5, rtol=1e-8)
    # a step presses by the depth at its start
    np.testing.assert_allclose(found["worn"], depth, rtol=1e-8)
    bottom = result.values("u_y")[result.system.mesh.nodes("block:bottom")]
    np.testing.assert_allclose(bottom, 0.001 - 0.5 / 50 - depth * 4 / 5, rtol=1e-8)


def test_history_of_a_law_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    """Bitwise, as if the march had not stopped."""
    given: dict[str, Any] = {"dt": 0.25, "method": "euler"}
    *_, whole = wearing().march(until=2.0, **given)
    list(wearing().march(until=1.5, checkpoint=tmp_path / "worn.npz", **given))
    *_, last = wearing().march(until=2.0, checkpoint=tmp_path / "worn.npz", **given)
    assert np.array_equal(last.x, whole.x)
    assert np.array_equal(last.fields("seat")["worn"], whole.fields("seat")["worn"])
    assert last.fields("seat")["worn"].min() > 0.014


def test_what_cannot_be_a_law_is_refused() -> None:
    """In one line that names what is given and what is allowed."""
    study = Study(blocks(2, (1, 1)))
    study.add("body", linear, E=1)

    def refused(message: str, **given: Any) -> None:
        with pytest.raises((StudyError, softehl.ModelError), match=message):
            study.contact("upper:bottom", "lower:top", **given)

    refused("no parameter 'hh'; did you mean 'h'|no parameter 'hh'", law=conductance, hh=1)
    refused("give h, parameters of conductance", law=conductance)
    refused("friction = 0.3: a law states its own", law=conductance, h=1, friction=0.3)
    refused("reach = 1: only a law", reach=1)
    refused("h: only a law, law=page, has parameters", h=1)
    refused("gradients|no law of contact", law=linear, E=1)
    study.contact("upper:bottom", "lower:top", law=conductance, h=1)
    with pytest.raises(StudyError, match="'contact': no unknown 'T'; at nodes: u_x"):
        study.solve()
    with pytest.raises(softehl.ModelError, match=r"m\.gap: only a law of contact has it"):
        Study(blocks(2, (1, 1))).add("body", cohesion, s=1, d=1)


def test_a_march_with_inertia_takes_no_law() -> None:
    for method in ("explicit", "generalised-alpha"):
        with pytest.raises(StudyError, match=r"a contact by law=\.\.\. has no march with inertia"):
            next(iter(pulled().march(dt=0.1, until=1, method=method, mass={"body": {"rho": 1}})))


@softehl.page
def pressed_conductance(m: Any) -> None:
    """A penalty, and a conductance that grows with its pressure."""
    T = m.scalar("T")
    e, h = m.parameters(e="stiffness [MPa/mm]", h="conductance by the pressure [W/mm^2/K/MPa]")
    p = m.define("p", sp.Max(-e * m.gap, 0))
    m.weak(-p, m.gap)
    q = m.define("q", h * p * m.jump(T))
    m.weak(q, m.jump(T))
    m.fields(pressure=p, flux=q)


def test_conductance_grows_with_the_pressure() -> None:
    """Both as one law, of displacements and temperatures: 1 / q = 1 / q1 + 1 / (h p) + 1 / q2."""
    study = Study(blocks(2, (1, 2)))
    study.add("body", linear, E=10)
    study.add("heat", heat, k=2, c=0.1)
    given: dict[str, Any] = {"law": pressed_conductance, "e": 20, "h": 0.5}
    study.contact("upper:bottom", "lower:top", name="seat", **given)
    study.fix("lower:bottom", u_x=0, u_y=0, T=0)
    study.fix("upper:top", u_x=0, u_y=-0.15, T=100)
    found = study.solve().fields("seat")
    p = 0.15 / (1.5 / 10 + 1 / 20)
    np.testing.assert_allclose(found["pressure"], p, rtol=1e-9)
    np.testing.assert_allclose(found["flux"], 100 / (1.5 / 2 + 1 / (0.5 * p)), rtol=1e-9)
