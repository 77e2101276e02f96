"""SymPy to graph: sharing, exact numbers, branches; errors name what is wrong in the model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mpmath
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import evaluate
from softehl.codegen.graph.graph import Graph, Node
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.language.sympy_lowering import Lowering
from tests.codegen.workshop import close, inputs, unknowns

x, y = sp.symbols("x y", real=True)


def lowering() -> tuple[Graph, Lowering]:
    g = Graph()
    return g, Lowering(g, dict(zip((x, y), unknowns(g, 2), strict=True)))


def lowered(expression: Any) -> Node:
    return lowering()[1](expression)


def value(expression: Any, *at: Any) -> Any:
    return evaluate(lowered(expression), inputs(*at))


def model(**kwargs: Any) -> Model:
    return Model("throwaway", nodes=1, rule=quadrature.gauss(1, 1), **kwargs)


# ------------------------------------------------------------------------------------- conversion


@pytest.mark.parametrize(
    "expression",
    [
        (x + y) ** 2 / (x - y) - 3 * x * y,
        sp.sqrt(x) * sp.log(y) + sp.exp(-x / y) - sp.sin(x) * sp.cos(y),
        x ** sp.Rational(-2, 3) + y ** sp.Rational(7, 5) + sp.cbrt(x * y),
        x**y + sp.pi * x + sp.E + sp.exp(1 + x),
        sp.Max(x, y, 2) - sp.Min(x, 3 * y, 7) + sp.Abs(x - y) + sp.Abs(y - x),
        sp.tan(x / 9) + sp.asin(x / 9) - sp.acos(y / 9) * sp.atan(x) + sp.atan2(y, x - 3),
        sp.sinh(x) * sp.cosh(y) - sp.tanh(x / y),
        sp.asinh(x - 4) + sp.acosh(1 + y) * sp.atanh(x / 7),
        sp.erf(x - 4) * sp.erfc(y) + sp.erfc(x - 4),
        sp.sign(x - 3) * y + sp.Heaviside(y - 3) + 2 * sp.Heaviside(x - 5, 1),
        sp.Piecewise((x**2, x > y), (y**3, x >= 0), (sp.Integer(1), True)),
    ],
    ids=str,
)
@pytest.mark.parametrize("at", [(2, 3), (5, 4), ("0.3", "1.7")], ids=str)
def test_graph_and_sympy_have_one_value(expression: Any, at: tuple[Any, Any]) -> None:
    point = {x: sp.Rational(str(at[0])), y: sp.Rational(str(at[1]))}
    expected = mpmath.mpf(0)
    with mpmath.workdps(60):
        expected = mpmath.mpf(str(expression.subs(point).evalf(60)))
        numbers = [mpmath.mpf(v.p) / v.q for v in point.values()]
        assert close(value(expression, *numbers), expected, 1e-45)


# --------------------------------------------------------------------------------------- branches


@pytest.mark.parametrize(
    ("relation", "expected"),
    [
        (x < y, [1, 0, 0]),
        (x <= y, [1, 1, 0]),
        (x > y, [0, 0, 1]),
        (x >= y, [0, 1, 1]),
        (sp.Eq(x, y), [0, 1, 0]),
        (sp.Ne(x, y), [1, 0, 1]),
        (sp.And(x <= y, x >= y), [0, 1, 0]),
        (sp.Or(x < y, x > y, x > y + 5), [1, 0, 1]),
        (sp.Not(sp.And(x <= y, y < 3)), [0, 0, 1]),
    ],
    ids=str,
)
def test_relations_and_logic(relation: Any, expected: list[int]) -> None:
    indicator = sp.Piecewise((1, relation), (0, True))
    assert [value(indicator, at, 2) for at in (1, 2, 3)] == expected


# ----------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (x * (1 / 3), "0.33333333333333331 is a rounded number; write an exact one"),
        (x ** (2 / 3), "0.66666666666666663 is a rounded number"),
        (x * (0.1 + 0.2), "0.30000000000000004 is a rounded number; .*where decimals are added"),
        (x * sp.pi.evalf(), "3.14159265358979.* is a rounded number"),
        (x * sp.Float("inf"), "inf"),
        (x + sp.Symbol("stiffness", real=True), "symbol stiffness is not declared"),
        (sp.Symbol("x"), "symbol x is not declared"),  # not the real one that was declared
        (
            sp.Piecewise((x, x > 0)),
            r"a branch without a last condition: .*end it with \(.., True\)",
        ),
        (sp.gamma(x), r"gamma in gamma\(x\) has no kernel operation"),
        (
            1 + sp.erfi(y) ** 2,
            r"erfi in erfi\(y\) has no kernel operation; there are .* atan2, sinh",
        ),
        (sp.DiracDelta(x), "DiracDelta in"),
        (sp.Matrix([[x, y]]), r"a matrix of shape \(1, 2\) where a scalar is needed"),
        (sp.sqrt(-2) * x, "I has no kernel operation: kernels compute with real numbers"),
        (sp.log(-3), "I has no kernel operation: kernels compute with real numbers"),
        ("x +", "'x \\+' is no mathematical expression"),
        (sp.Function("f")(x), r"f in f\(x\)"),
        (sp.zoo, "zoo is no number: something is divided by zero"),
        (sp.nan, "nan is no number"),
        (sp.I * x, "I has no kernel operation"),
        (sp.Integral(sp.sin(x), x), r"Integral\(sin\(x\), x\) is not carried out: use"),
    ],
    ids=str,
)
def test_what_a_kernel_cannot_hold_is_named(expression: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        lowered(expression)


def test_a_name_stands_for_one_thing() -> None:
    m = model()
    u = m.unknown("u")
    h = m.define("h", u + 1)
    assert m.define("h", u + 1) == h, "the same definition again is the same node"
    with pytest.raises(ModelError, match="the name h is used twice in model throwaway"):
        m.define("h", u + 2)
    with pytest.raises(ModelError, match=r"u is used twice .* an unknown and a parameter: rename"):
        m.parameters(u="something else")
    with pytest.raises(ModelError, match="the name u is used twice"):
        m.unknown("u")
    m.define("weight", u)
    with pytest.raises(ModelError, match="the name weight is used twice"):
        _ = m.weight


def test_a_model_without_a_potential_is_refused() -> None:
    m = model()
    m.unknown("u")
    with pytest.raises(ModelError, match="throwaway has neither a potential nor a weak form"):
        m.finish()


def test_decimals_are_what_they_are_written_as() -> None:
    assert lowered(x * 0.1) is not None
    half, one, other = sp.Rational(1, 2), sp.Rational(1, 10), sp.Rational(-37, 10**9)
    for written, exact_one in ((x * 0.1, x * one), (x**0.5, x**half), (y - 3.7e-8, y + other)):
        _, lower = lowering()
        assert lower(written) is lower(exact_one)
    _, lower = lowering()
    assert lower(sp.Float("0.1", 40) * x) is lower(x / 10)


def test_a_given_derivative_of_a_matrix_is_refused() -> None:
    m = model()
    u = m.unknown("u")
    with pytest.raises(ModelError, match="derivative"):
        m.define("M", sp.Matrix([[u]]), derivative={u: sp.Integer(7)})


def test_a_potential_that_varies_with_the_point_is_refused() -> None:
    m = model()
    u, (xi,) = m.unknown("u"), m.point()
    with pytest.raises(ModelError, match="integral"):
        m.potential(u**2 * xi)


def test_an_undeclared_constant_is_named() -> None:
    m = model()
    u = m.unknown("u")
    with pytest.raises(ModelError, match="symbol a is not declared"):
        m.potential(u**2, constant=[sp.Symbol("a", real=True)])


# ------------------------------------------------------------------------- the line of the page


def line_of(text: str) -> int:
    """Line of this file that holds `text` first."""
    rows = Path(__file__).read_text(encoding="utf-8").splitlines()
    return next(k for k, row in enumerate(rows, 1) if text in row)


def test_errors_name_file_and_line_of_the_page() -> None:
    m = model()
    u = m.unknown("u")
    with pytest.raises(ModelError) as failed:
        m.define("g", sp.gamma(u))  # the line that is named
    place = f"{__file__}:{line_of('the line that ' + 'is named')}: "
    assert str(failed.value).startswith(place)


def test_what_is_never_used_is_named_where_it_was_declared() -> None:
    m = model()
    u = m.unknown("u")
    m.unknown("v")  # the idle unknown
    m.potential(u**2)
    place = f"sympy_lowering.py:{line_of('# the idle ' + 'unknown')}: the unknown v is never used"
    with pytest.raises(ModelError, match=place):
        m.finish()
    m = model()
    u = m.unknown("u")
    k, c = m.parameters(k="used in a field only", c="never")
    m.potential(u**2)
    m.fields(k=k)
    with pytest.raises(ModelError, match="the argument c is never used"):
        m.finish()
    m.fields(both=k + c)
    assert m.finish().fields


def test_idle_unknowns_need_not_be_used() -> None:
    m = model()
    (u,), _ = m.nodal_unknowns("u", "v", idle=["v"])
    m.potential(u**2)
    assert m.finish().unknowns == ("u1", "v1")


def test_a_division_by_zero_is_named() -> None:
    m = model()
    u = m.unknown("u")
    z = m.define("z", sp.Integer(0))
    for e in (u / z, 1 / z, z ** sp.Rational(-1, 2)):
        with pytest.raises(ModelError, match="divides by zero"):
            m.potential(e)
