"""Heat in a bar whose conductivity jumps far from zero: the flux of the closed form."""

from __future__ import annotations

import pytest
import sympy as sp

from softehl import Definition, Mesh, Model, Study, element, kinematics, quadrature


def conductor() -> Definition:
    """Conductivity 1 below 1000 K and 10 above, by a logistic function 10 K wide."""
    m = Model("conductor", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    (xi,) = m.point()
    bar = element("line2")
    e = kinematics.isoparametric(m, X, bar.gradient(xi))
    slope = m.define("slope", sum(d[0] * v for d, v in zip(e.dN, T, strict=True)))
    here = m.define("here", sum(N * v for N, v in zip(bar.shape(xi), T, strict=True)))
    k = 1 + 9 / (1 + sp.exp(-(here - 1000) / 10))
    m.weak_form([(k * slope * e.detJ, slope)])
    return m.finish()


def test_a_conductivity_that_is_constant_near_zero_is_not_constant() -> None:
    """The integral of k from 0 to 2000 K is 11000; half of it is reached at 1450 K."""
    study = Study(Mesh.line(1.0, cells=200))
    study.add("bar", conductor())
    study.start(T=lambda x: 2000 * x[:, 0])
    study.fix("left", T=0)
    study.fix("right", T=2000)
    result = study.solve()
    assert abs(result.reaction("right")["T"]) == pytest.approx(11000, rel=1e-3)
    assert result.at((0.5,))["T"] == pytest.approx(1450, rel=1e-3)
