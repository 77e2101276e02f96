"""Stress laws by themselves: in a study, in a page, in a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.material import Law, Material
from softehl.codegen.tools.model_text import ModelFileError
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.result import Result
from softehl.runtime.study import Source, Study, StudyError


@softehl.material
def neo(m: Material) -> None:
    """Compressible neo-Hooke."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    J = m.define("J", m.F.det(method="berkowitz"))
    m.energy(mu / 2 * ((m.F.T * m.F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)


@softehl.material
def neo_stress(m: Material) -> None:
    """The same law as a stress."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    J = m.define("J", m.F.det(method="berkowitz"))
    inverse = m.F.adjugate().T / J
    m.stress(mu * (m.F - inverse) + K * (J - 1) * J * inverse)


def sheared(geometry: str | None = None, **what: Source | float) -> Result:
    """A square whose top is moved, of a material or page."""
    study = Study(Mesh.rectangle(1, 1, cells=(2, 2), shape="triangle"), geometry=geometry)
    study.add("body", **what)  # type: ignore[arg-type]
    study.fix("bottom", u_x=0, u_y=0)
    study.fix("top", u_x=0.1, u_y=0.05)
    return study.solve()


def test_a_page_may_use_a_material_beside_its_own_terms() -> None:
    @softehl.page
    def held(m):  # type: ignore[no-untyped-def]
        u = m.vector("u")
        (k,) = m.parameters(k="stiffness of the ground [N/mm^3]")
        F = m.deformation_gradient(u)
        m.weak(m.stress(neo, F), F)
        m.minimise(k / 2 * u.dot(u))

    free = sheared(material=neo, mu=0.4, K=0.9)
    assert np.abs(sheared(source=held, mu=0.4, K=0.9, k=0).x - free.x).max() < 1e-12
    assert np.abs(sheared(source=held, mu=0.4, K=0.9, k=1).x - free.x).max() > 1e-3


def test_a_law_of_small_strains_is_linear() -> None:
    @softehl.material
    def hooke(m: Material) -> None:
        G, lame = m.parameters(G="shear modulus [MPa]", lame="first Lame parameter [MPa]")
        m.energy(G * (m.strain * m.strain).trace() + lame / 2 * m.strain.trace() ** 2)

    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    study.add("body", material=hooke, G=0.4, lame=0.6)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    study.fix("right", u_x=0.5)
    result = study.solve()
    across = -0.5 * 0.6 / (0.6 + 2 * 0.4)
    assert result.iterations == 1
    expected = {
        "sigma_xx": 1.4 * 0.5 + 0.6 * across,
        "sigma_yy": 0.0,
        "sigma_zz": 0.6 * (0.5 + across),
    }
    for name, value in expected.items():
        assert np.allclose(result.fields("body")[name], value, atol=1e-14)


FILE = """
import softehl

@softehl.material
def stiff(m):
    (c,) = m.parameters(c="modulus [MPa]")
    m.energy(c * (m.green.T * m.green).trace())
"""
PAGE = """
@softehl.page
def body(m):
    F = m.deformation_gradient(m.vector("u"))
    m.weak(m.stress(stiff, F), F)
    m.fields(of_page=F[0, 0])
"""


def test_a_file_of_materials_gives_bodies_of_them(tmp_path: Path) -> None:
    alone, both = tmp_path / "alone.py", tmp_path / "both.py"
    alone.write_text(FILE)
    both.write_text(FILE + PAGE)
    assert "sigma_xx" in sheared(source=alone, c=1.0).fields("body")
    assert "sigma_xx" in sheared(material=both, c=1.0).fields("body")
    assert "of_page" in sheared(source=both, model="body", c=1.0).fields("body")
    alone.write_text("import softehl\n" + PAGE.replace("stiff, F", "None, F"))
    with pytest.raises(ModelFileError, match="has no material"):
        sheared(material=alone)


def test_what_a_material_cannot_say_is_told() -> None:
    with pytest.raises(ModelError, match=r"neither m\.energy"):
        sheared(material=Law("empty", "", lambda m: None))
    with pytest.raises(ModelError, match="shape that of a scalar, must be"):
        sheared(material=Law("scalar", "", lambda m: m.stress(1)))
    with pytest.raises(StudyError, match="one of them"):
        sheared(source=neo, material=neo)
    with pytest.raises(StudyError, match="one of them"):
        sheared()


def test_a_material_by_itself_has_a_symmetric_tangent_of_nine_gradients() -> None:
    form = neo.at_point()
    assert [q.axis for q in form.unknowns] == [0, 1, 2] * 3
    assert form.definition.conservative
    assert not neo_stress.at_point().definition.conservative


def _bar(F: Array) -> tuple[float, float, Array]:
    """I1bar, I2bar and the squares of the isochoric stretches of F."""
    squares = np.linalg.eigvalsh(F.T @ F) * np.linalg.det(F) ** (-2 / 3)
    return squares.sum(), (1 / squares).sum(), squares


def _linear(strain: Array, E: float, nu: float) -> float:
    lame, G = E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)
    return float(lame / 2 * np.trace(strain) ** 2 + G * (strain**2).sum())


CHAIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
SHIPPED: dict[str, tuple[dict[str, float], Callable[[Array], float]]] = {
    "hooke": ({"E": 2, "nu": 0.3}, lambda F: _linear((F + F.T) / 2 - np.eye(3), 2, 0.3)),
    "saint-venant": ({"E": 2, "nu": 0.3}, lambda F: _linear((F.T @ F - np.eye(3)) / 2, 2, 0.3)),
    "neo_hooke": ({"mu": 0.4}, lambda F: 0.2 * (_bar(F)[0] - 3)),
    "mooney_rivlin": (
        {"mu_1": 0.3, "mu_2": 0.2},
        lambda F: 0.15 * (_bar(F)[0] - 3) + 0.1 * (_bar(F)[1] - 3),
    ),
    "yeoh": (
        {"c_1": 0.3, "c_2": 0.2, "c_3": 0.1},
        lambda F: float(np.polyval([0.1, 0.2, 0.3, 0], _bar(F)[0] - 3)),
    ),
    "gent": (
        {"mu": 0.4, "J_m": 5},
        lambda F: -0.2 * 5 * float(np.log(1 - (_bar(F)[0] - 3) / 5)),
    ),
    "arruda_boyce": (
        {"mu": 0.4, "lambda_m": 2},
        lambda F: (
            0.4 * sum(c * (_bar(F)[0] ** k - 3**k) / 4 ** (k - 1) for k, c in enumerate(CHAIN, 1))
        ),
    ),
    "ogden": (
        {"mu_1": 0.3, "alpha_1": 3, "mu_2": -0.1, "alpha_2": -2, "mu_3": 0.02, "alpha_3": 5},
        lambda F: sum(
            m / a * float((_bar(F)[2] ** (a / 2) - 1).sum())
            for m, a in ((0.3, 3), (-0.1, -2), (0.02, 5))
        ),
    ),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in list(SHIPPED)[3:7])) for n in SHIPPED]
)
def test_a_material_that_ships_has_the_stress_of_its_energy(name: str) -> None:
    """The Cauchy stress of a homogeneous motion, against differences of W(F) written anew."""
    given, energy = SHIPPED[name]
    F = np.array([[1.2, 0.3, 0], [-0.1, 0.9, 0], [0, 0, 1]])
    J = np.linalg.det(F)
    rubber = name not in ("hooke", "saint-venant")

    def W(F: Array) -> float:
        J = np.linalg.det(F)
        return float(energy(F) + rubber * 0.9 / 4 * (J**2 - 1 - 2 * np.log(J)))

    def slope(i: int, k: int) -> float:
        h = np.zeros((3, 3))
        h[i, k] = 1e-3
        rises = [W(F + n * h) - W(F - n * h) for n in (1, 2, 3)]
        return float(np.dot([45, -9, 1], rises)) / 60e-3

    P = np.array([[slope(i, k) for k in range(3)] for i in range(3)])
    cauchy = P if name == "hooke" else P @ F.T / J
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    arguments: dict[str, Any] = given | ({"kappa": 0.9} if rubber else {})
    study.add("body", material=name, **arguments)
    for i, u in enumerate(("u_x", "u_y")):
        study.fix("boundary", **{u: lambda x, t, i=i: x @ (F - np.eye(3))[i, :2]})
    found = study.solve().fields("body")
    for label, (i, k) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1)}.items():
        assert np.allclose(found[f"sigma_{label}"], cauchy[i, k], rtol=1e-8, atol=1e-10), label
        assert not np.allclose(found[f"sigma_{label}"], 1.001 * cauchy[i, k], rtol=1e-5)


def test_a_material_that_does_not_ship_is_an_error_with_those_that_do() -> None:
    with pytest.raises(ValueError, match="no material is called 'rubber'; allowed: hooke, saint"):
        sheared(material="rubber", mu=1.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"material": "Hooke", "E": 1.0, "nu": 0.5}, r"nu = 0.5, must be < 0.5 \(material"),
        (
            {"material": "Neo-Hooke", "mu": -0.4, "kappa": 1.0},
            r"mu = -0.4, must be > 0 \(material",
        ),
        (
            {"material": "neohooke", "mu": 0.4, "kappa": 0.0},
            r"kappa = 0, must be > 0 \(material",
        ),
    ],
)
def test_a_law_by_name_says_what_its_arguments_must_be(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        sheared(**given)


@softehl.material
def saint_venant(m: Material) -> None:
    """An energy of the strain."""
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    E = m.green
    m.energy(lame / 2 * E.trace() ** 2 + mu * (E.T * E).trace())


@softehl.material
def second(m: Material) -> None:
    """The same law as a second Piola-Kirchhoff stress."""
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    m.second_stress(lame * m.green.trace() * sp.eye(3) + 2 * mu * m.green)


def test_an_energy_of_the_strain_and_its_second_stress_are_one_material() -> None:
    a = sheared("axisymmetric", material=saint_venant, mu=0.4, lame=0.6)
    b = sheared("axisymmetric", material=second, mu=0.4, lame=0.6)
    assert np.abs(a.x - b.x).max() < 1e-12
