"""Potentials, weak forms, fields and offers that a page says in several calls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from softehl.codegen.elements import quadrature
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from tests.codegen.workshop import compiled


def model() -> Model:
    return Model("sums", nodes=1, rule=quadrature.point_rule())


def test_potentials_weak_forms_fields_and_offers_add_up(tmp_path: Path) -> None:
    m = model()
    x, y = m.unknown("x"), m.unknown("y")
    m.potential(x**2 * y)
    m.potential(3 * x)
    m.weak_form([(x**3, x)])
    m.weak_form([(5, x), (x * y, y)])
    m.fields(a=x)
    m.fields(b=2 * y)
    m.offer(tasks=["tangent"])
    m.offer(tasks=["fields"], product=True)
    kernel = compiled(m.finish(), tmp_path, "-O0")
    assert set(kernel.tasks) == {"tangent", "fields", "product"}
    state = np.empty((1, 0)), np.array([[2.0, 7.0]])
    R, K = kernel.tangent(*state)
    assert R[0].tolist() == [28 + 3 + 8 + 5, 4 + 14]
    assert K[0].tolist() == [[14 + 12, 4], [4 + 7, 2]]
    assert kernel.fields_at(*state)[0].tolist() == [[2.0, 14.0]]


@pytest.mark.parametrize("call", ["fields", "history"])
def test_a_name_that_is_given_twice_is_refused(call: str) -> None:
    m = model()
    (old,) = m.point_data(v="history")
    getattr(m, call)(v=old)
    with pytest.raises(ModelError, match="v is given twice in model sums"):
        getattr(m, call)(v=old)


def test_what_is_frozen_in_one_potential_varies_in_another_under_its_own_name() -> None:
    m = model()
    x = m.unknown("x")
    a = m.define("a", x**2)
    m.potential(a * x, constant=[a])
    m.potential(a)
    with pytest.raises(ModelError, match=r"a is constant in one potential.*m.define\('a_frozen'"):
        m.finish()
