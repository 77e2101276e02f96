"""Names of a page under SymPy's own calculus: followed, or refused; a blind page is found out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language import named_symbols, weak_form
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model

x = sp.Symbol("x", real=True)
PLAIN = ((1 + x) ** 2, (1 + x) ** 3)
"""J and K of the page below without names."""


class Page:
    """lam = 1 + x, J = lam^2, K = J lam, and what is made of them."""

    def __init__(self) -> None:
        self.m = Model("page", nodes=1, rule=quadrature.gauss(2, 1))
        self.x = self.m.unknown("x")
        self.lam = self.m.define("lam", 1 + self.x)
        self.J = self.m.define("J", self.lam**2)
        self.K = self.m.define("K", self.J * self.lam)
        self.W = self.K**2 / self.J + sp.Piecewise((self.J, self.J > 1), (self.K, True)) + self.lam


def number(e: Any, at: float = 0.75) -> float:
    """Value of an expression at x."""
    return float(e.subs(x, sp.Rational(at)))


@pytest.fixture(params=[False, True], ids=["names", "written out"])
def page(request: pytest.FixtureRequest) -> Iterator[Page]:
    """Both kinds of names."""
    if not request.param:
        yield Page()
        return
    with named_symbols.written_out():
        yield Page()


Q = sp.Rational
POINTS = [
    tuple(map(Q, p)) for p in [(2, -1, 1), (2, -1, 9), (-2, 0, 1), (-2, -1, 1), (Q(1, 2), 1, 0)]
]
"""x, q and s."""
LAM = sp.Symbol("l", positive=True)
W = LAM**4 + LAM**2 + LAM  # the branch that is taken


@pytest.mark.parametrize(
    ("calculus", "expected"),
    [
        (lambda p: sp.diff(p.W, p.lam), sp.diff(W, LAM)),
        (lambda p: sp.diff(p.W, p.x), sp.diff(W, LAM)),
        (lambda p: sp.diff(p.W, p.lam, 2), sp.diff(W, LAM, 2)),
        (lambda p: sp.Derivative(p.W, p.lam).doit(), sp.diff(W, LAM)),
        (lambda p: sp.Matrix([p.W]).jacobian([p.lam])[0], sp.diff(W, LAM)),
        (lambda p: sp.hessian(p.W, [p.lam])[0], sp.diff(W, LAM, 2)),
        (lambda p: sp.Matrix([p.W]).diff(p.lam)[0], sp.diff(W, LAM)),
        (lambda p: p.W.subs(p.lam, 2), sp.Integer(22)),
        (lambda p: p.W.subs(p.x, 1), sp.Integer(22)),
        (lambda p: p.W.subs({p.lam: 2}, simultaneous=True), sp.Integer(22)),
        (lambda p: p.W.xreplace({p.lam: sp.Integer(2)}), sp.Integer(22)),
    ],
)
def test_calculus_sees_through_names(
    calculus: Callable[[Page], Any], expected: Any, page: Page
) -> None:
    right = float(expected.subs(LAM, sp.Rational(7, 4)))
    assert number(calculus(page)) == pytest.approx(right, rel=1e-14)


def test_what_is_not_below_a_name_is_a_constant_of_it() -> None:
    p = Page()
    y = p.m.unknown("y")
    assert sp.diff(p.J * y, y) == p.J
    assert sp.diff(p.lam, p.J) == 0
    assert sp.diff(p.J, p.J) == 1


def test_a_given_derivative_is_the_derivative() -> None:
    p = Page()
    held = p.m.define("held", p.x**2, derivative={p.x: 5 * p.x})
    assert sp.diff(held * p.x, p.x) == held + 5 * p.x**2
    with pytest.raises(ModelError, match=r"named_symbols.py:\d+: x is replaced in held, a name"):
        (held + 1).subs(p.x, 2)


@pytest.mark.parametrize(
    ("calculus", "message"),
    [
        (lambda p, s: sp.diff(s * p.x, p.x), r"use m.derivative\(name, value, x\)"),
        (lambda p, s: sp.Matrix([s]).jacobian([p.lam]), r"use m.derivative\(name, value, lam\)"),
        (lambda p, s: (s + p.J).subs(p.x, 1), "x is replaced in s, a name through which"),
        (lambda p, s: s.xreplace({p.lam: p.x}), "lam is replaced in s, a name through which"),
        (lambda p, s: p.W.replace(p.lam, 2), "lam is looked for in J.*use subs, not replace"),
        (lambda p, s: p.x + sp.Symbol("J", real=True), "use the symbol that the model returned"),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_line(
    calculus: Callable[[Page, Any], Any], message: str
) -> None:
    p = Page()
    s = p.m.implicit("s", lambda s: s**3 + s - p.lam, start=p.x)
    with pytest.raises(ModelError, match=rf"test_named_symbols.py:\d+: .*{message}|{message}"):
        p.m.define("made", calculus(p, s))


def test_implicit_names_refuse_also_through_other_names() -> None:
    p = Page()
    s = p.m.implicit("s", lambda s: s**3 + s - p.lam, start=p.x)
    t = p.m.define("t", s**2)
    with pytest.raises(ModelError, match="derivative by x meets s"):
        sp.diff(t, p.x)
    assert sp.diff(t, s) == 2 * s


@pytest.mark.parametrize("seen", [lambda s, x, q: s, lambda s, x, q: s - q * x])
def test_conditions_on_an_implicit_name_are_folded(seen: Callable[[Any, Any, Any], Any]) -> None:
    """SymPy asks whether both sides are equal, which it cannot know: the branches stay."""
    m = Model("folded", nodes=1, rule=quadrature.point_rule())
    x, (q,) = m.unknown("x"), m.data(q="q")
    s = m.implicit("s", lambda s: s**3 + s - q, start=q)
    inner = sp.Piecewise((Q(-3, 2), seen(s, x, q) < x**3), (-3, True))
    outer = sp.Piecewise((x, inner < sp.cosh(x) * q), (x**2, x < q), (-1, True))
    folded = sp.Piecewise((1, x < outer), (2, True))
    value = {(a, b, c): folded.xreplace({x: a, s: c}).xreplace({q: b}) for a, b, c in POINTS}
    for (a, b, c), found in value.items():
        low = -1.5 if seen(c, a, b) < a**3 else -3.0
        side = a if low < sp.cosh(a) * b else a**2 if a < b else -1.0
        assert found == (1 if a < side else 2)
    assert (s - x**3).is_constant(q) is None
    with pytest.raises(ModelError, match="does not see"):
        sp.diff(s - x**3, q)  # nothing is remembered of what SymPy asked


def test_names_of_two_models_are_different() -> None:
    """SymPy remembers derivatives of equal expressions: names of equal labels must not be equal."""
    one, two = Page(), Page()
    other = two.m.define("other", two.lam**5)
    mine = one.m.define("other", one.lam**4)
    assert sp.diff(mine, one.lam) == 4 * one.lam**3
    assert sp.diff(other, two.lam) == 5 * two.lam**4
    with pytest.raises(ModelError, match="symbol other is not declared in the model: use the"):
        one.m.define("mixed", other)


# --------------------------------------------------------------------------- the check of a page


def test_the_inverse_of_a_matrix_of_a_page_is_written_out() -> None:
    """SymPy's elimination would prove for minutes that sums of 24 unknowns are not zero."""

    def write(m: Fields) -> None:
        F = m.deformation_gradient(m.vector("u"))
        for A in (F, F.T * F, sp.eye(3) + F, F[:2, :2], F[:1, :1]):
            found = A.inv()
            at = {s: sp.Rational(k + 2, 7 + k * k) for k, s in enumerate(F)}
            right = np.linalg.inv(np.array(sp.Matrix(A).xreplace(at).tolist(), dtype=float))
            values = np.array(sp.Matrix(found).xreplace(at).tolist(), dtype=float)
            np.testing.assert_allclose(values, right, rtol=1e-12)
        assert F.inv() == F**-1
        with pytest.raises(ModelError, match=r"inv: the determinant of a matrix \(2, 2\) is zero"):
            (F[:2, :2] * 0).inv()
        m.minimise((F.inv() * F.inv().T).trace())

    assert weak_form.Page("write", write).definition("hex8").name == "write_hex8"
