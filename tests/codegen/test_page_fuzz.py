"""Random pages: SymPy's derivatives through names are the model's; errors name their line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import State, Walk
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.tools import model_loader
from softehl.codegen.tools.model_text import ModelFileError
from tests.codegen.random_models import UNKNOWNS, expressions

FUZZ = settings(
    derandomize=True,
    max_examples=30,
    database=None,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
A, B = sp.symbols("a b", real=True)
AT = (0.37, -0.81, 1.23)


@given(
    expressions(UNKNOWNS, 4),
    expressions((*UNKNOWNS, A), 4),
    expressions((*UNKNOWNS, A, B), 5),
    st.sampled_from(["x", "y", "z", "a", "b"]),
)
@FUZZ
def test_sympy_and_the_model_differentiate_alike(a: Any, b: Any, w: Any, by: str) -> None:
    """Values of sp.diff(W, s) and m.derivative(W, s), for inputs and for names, in 50 digits."""
    m = Model("fuzz", nodes=1, rule=quadrature.point_rule())
    known: dict[Any, Any] = {u: m.unknown(str(u)) for u in UNKNOWNS}
    for symbol, value in ((A, a + UNKNOWNS[0] / 3), (B, b + A * UNKNOWNS[1])):
        known[symbol] = m.define(str(symbol), value.xreplace(known))
    W = (w + A * B).xreplace(known)
    s = next(v for k, v in known.items() if str(k) == by)
    try:
        theirs = m._lower(sp.diff(W, s))
    except ModelError as error:  # SymPy's |log y|' holds imaginary parts
        assume("real numbers" not in str(error))
        raise
    ours = m._lower(m.derivative("slope", W, s))
    with mpmath.workdps(50):
        walk = Walk(State((), AT), {})
        try:
            found, expected = walk.value(theirs), walk.value(ours)
            smooth = abs(found) < 1e30
        except (ArithmeticError, ValueError, TypeError):
            smooth = False  # no real value there
        assume(smooth)
        assert abs(found - expected) <= mpmath.mpf(10) ** -30 * (1 + abs(expected))


PAGE = """
import sympy as sp
from softehl import Definition, Model, quadrature

def page() -> Definition:
    m = Model("page", nodes=1, rule=quadrature.gauss(2, 1))
    u, v = m.unknown("u"), m.unknown("v")
    (k,) = m.parameters(k="stiffness")
    a = m.define("a", u**2 + v)
    s = m.implicit("s", lambda s: s**3 + s - a, start=u)
    m.potential(m.integral("Pi", k * a**2 + s * u))
    return m.finish()
"""
LEGAL = ("u**2 + v", "s**3 + s - a", "k * a**2 + s * u", "start=u", '"a"', '"page"', "2, 1", "k=")
WRONG = (
    *(
        "1 / 0",
        "sp.oo",
        "0.1 * u",
        "w",
        "sp.gamma(u)",
        "sp.I * u",
        "u if u > 0 else v",
        "1 / (u - u)",
    ),
    *("sp.Matrix([u, v])", "sp.diff(s, u)", "sp.Piecewise((u, u > 0))", "'text +'", "None", "[u]"),
    *(
        '"a b"',
        '""',
        "sp.Symbol('a', real=True)",
        "sp.Derivative(u**2, u)",
        "0, 1",
        "2, 9",
        "'x', 1",
    ),
    *("sp.nan", "s.subs(u, 1)", "lambda: u", "u.missing", "u +* v", "m.unknown('u')"),
)


@given(st.sampled_from(LEGAL), st.sampled_from(WRONG))
@FUZZ
def test_a_page_is_right_or_an_error_with_its_line(
    tmp_path_factory: pytest.TempPathFactory, legal: str, wrong: str
) -> None:
    """One part of a page replaced by something strange: no error but ours, and it names a line."""
    path: Path = tmp_path_factory.mktemp("fuzz") / "page.py"
    path.write_text(PAGE.replace(legal, wrong, 1))
    message = ""
    try:
        (d,) = model_loader.definitions(path)
        assert d.name
    except ModelFileError as error:
        message = str(error)
    assert not message or re.fullmatch(r"\S*page\.py:\d+: .+", message), message
