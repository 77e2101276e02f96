"""Tasks that are generated when asked for: product with the tangent, derivatives by argument."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import abi, pipeline
from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.discretisation.quadrature import film_rule, several
from softehl.runtime.kernels.kernel import Kernel
from tests.codegen.workshop import compiled, element_state, off, tangent_errors

X = np.array([[0.1, 0.0, 1.1, 0.2, 0.9, 1.0, -0.1, 0.9]])
U = np.array([[0.1, -0.2, 0.05, 0.1, 0.2, 0.15, -0.1, 0.05]])
GIVEN: dict[str, Any] = {"parameters": [0.8], "data": np.array([[0.4, 1.3]])}


def quad(constant: bool, unroll: bool = True) -> Definition:
    """4-node plane solid with a thickness, a branch, and perhaps a frozen volume factor."""
    m = Model("quad", nodes=4, rule=quadrature.gauss(2, 2), unroll=unroll)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u", "v")
    (mu,) = m.parameters(mu="modulus")
    limit, t = m.data(limit="strain", t="thickness")
    e = kin.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = m.define("I1", (F.T * F).trace())
    stiff = sp.Piecewise(((I1 - 2 - limit) ** 3, limit < I1 - 2), (0, True))
    W = mu / 2 * (I1 - 2 - 2 * sp.log(J)) + stiff + J ** sp.Rational(-2, 3) * I1
    m.potential(m.integral("Pi", t * W * e.detJ), constant=[J] if constant else [])
    m.offer(product=True, derivatives=[mu, limit, t, X[0][2], X[1][3]])
    return m.finish()


@pytest.fixture(scope="module", params=[(False, True), (True, True), (False, False)], ids=str)
def family(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Definition, Kernel]:
    d = quad(*request.param)
    return d, compiled(d, tmp_path_factory.mktemp("quad"), "-O0")


def test_product_is_the_tangent_times_the_vector(family: Any, rng: np.random.Generator) -> None:
    d, kernel = family
    v = rng.uniform(-1, 1, (1, 8))
    _, K = kernel.tangent(X, U, **GIVEN)
    product = kernel.product(X, U, v, **GIVEN)
    assert off(product[0], K[0] @ v[0]) <= 1e-14
    at = element_state(kernel, X, U, **GIVEN)
    assert off(product[0], Oracle(d).product(at, v[0].tolist())) <= 1e-14
    assert off(1.001 * product[0], K[0] @ v[0]) > 1e-4


@pytest.mark.parametrize(
    ("name", "array", "index"),
    [
        ("mu", "parameters", 0),
        ("limit", "data", 0),
        ("t", "data", 1),
        ("X3", "coordinates", 4),
        ("Y4", "coordinates", 7),
    ],
)
def test_derivatives_by_arguments(name: str, array: str, index: int, family: Any) -> None:
    d, kernel = family
    at = element_state(kernel, X, U, **GIVEN)
    found = kernel.derivative(name, X, U, **GIVEN)[0]
    exact = Oracle(d).derivative(at, array, index)
    assert off(found, exact) <= 2e-14
    wrong = Oracle(d).derivative(at, "coordinates", 5)
    assert off(found, wrong) > 1e-3


def test_fields_on_different_points_are_refused() -> None:
    with pytest.raises(ValueError, match="each rule needs a basis, and all the same points"):
        several(film_rule(2, "gauss", 3), film_rule(1, "gauss", 2))


# ------------------------------------------------------------------------------------ what is made


def chosen(**asked: Any) -> Definition:
    m = Model("chosen", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness")
    m.potential(k * x**4, constant=asked.pop("constant", []))
    if asked.pop("with_fields", True):
        m.fields(x=x)
    if asked.pop("by_k", False):
        asked["derivatives"] = [k]
    m.offer(**asked)
    return m.finish()


@pytest.mark.parametrize(
    ("asked", "made"),
    [
        ({}, ["energy", "residual", "tangent", "fields"]),
        ({"product": True}, ["energy", "residual", "tangent", "fields", "product"]),
        ({"tasks": ["residual"]}, ["residual"]),
        ({"tasks": ["product", "tangent"]}, ["tangent", "product"]),
        ({"tasks": ["energy"], "product": True}, ["energy", "product"]),
        ({"tasks": ["residual"], "by_k": True}, ["residual", "d_k"]),
    ],
    ids=str,
)
def test_only_what_is_asked_for_is_generated(asked: dict[str, Any], made: list[str]) -> None:
    source = pipeline.compile_model(chosen(**asked))
    assert list(source.functions) == made
    for task in (*abi.Task, "d_k"):
        named = re.search(rf"\b{abi.function_name('chosen', task)}\b", source.text)
        assert (named is not None) == (task in made)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"tasks": ["stress"]}, "no task 'stress'; there are energy, residual, tangent"),
        ({"tasks": ["fields"], "with_fields": False}, "no task fields for chosen"),
        ({"derivatives": [sp.Symbol("x", real=True)]}, "x is no parameter, datum or coordinate"),
        ({"derivatives": [sp.Symbol("z", real=True)]}, "symbol z is not declared"),
        (
            {"tasks": ["energy"], "constant": [sp.Symbol("k", real=True)]},
            "no energy for chosen: its residual is not the gradient of one",
        ),
    ],
    ids=str,
)
def test_what_cannot_be_offered_is_named(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        chosen(**asked)


# ------------------------------------------------------------------------------------- functions


FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "circular": lambda x, y: sp.tan(x) * sp.asin(x) - sp.acos(y / 3) ** 2 + sp.atan(x * y),
    "hyperbolic": lambda x, y: sp.sinh(x) * sp.cosh(y) + sp.tanh(x * y) * x,
    "area": lambda x, y: sp.asinh(x * y) + x * sp.acosh(2 + y) + sp.atanh(y * x) * sp.asinh(y),
    "error": lambda x, y: sp.erf(x) * sp.erfc(3 * y) + x * sp.erfc(2 + x * y) + sp.erf(y) ** 2,
    "plane angle": lambda x, y: sp.atan2(y, x) ** 2 * x + sp.atan2(x, -y) * y,
    "steps": lambda x, y: sp.sign(x) * y**3 + sp.Heaviside(y) * x**3 + sp.Heaviside(x - 9) * x**2,
    "extrema": lambda x, y: sp.Max(x, y) ** 3 + sp.Min(x, y, 0) ** 2 * y + sp.Abs(x - y) ** 3,
    "powers": lambda x, y: (2 + x) ** y + (3 + y) ** (x * y) + sp.sqrt(1 + x**2) + sp.cbrt(2 + y),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("unroll", [True, False])
def test_functions_and_their_derivatives(name: str, unroll: bool, tmp_path: Path) -> None:
    m = Model("functions", nodes=1, rule=quadrature.gauss(1, 1), unroll=unroll)
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="factor, so that some functions have one value for all elements")
    m.potential(m.integral("Pi", FUNCTIONS[name](x, y) * (1 + sp.tanh(k)) + x * y))
    d = m.finish()
    kernel = compiled(d, tmp_path)
    for at in ((0.4, -0.7), (-0.3, 0.2), (0.6, 0.5)):
        assert max(tangent_errors(d, kernel, (), at, parameters=[0.3])) <= 1e-14
