"""Explanations: every named value of a page, and the first operation without one, with its line."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Model, ModelError, Study, load_kernel, quadrature
from softehl.codegen.tools.kernel_cache import fingerprint

THIS = Path(__file__).name


def model(write: Callable[[Model, Any], Any]) -> softehl.Definition:
    """A model of one unknown u at two points, which a function ends."""
    m = Model("one", nodes=2, rule=quadrature.gauss(2, 1))
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    (xi,) = m.point()
    value = m.define("value", u[0] * (1 - xi) / 2 + u[1] * (1 + xi) / 2)
    m.potential(m.integral("Pi", write(m, value) * (X[1] - X[0]) / 2))
    return m.finish()


def explained(d: softehl.Definition, *dofs: float) -> softehl.Explanation:
    kernel = load_kernel(d)
    return kernel.explain(np.array([[0.0, 1.0]]), np.array([dofs]))


def relaxed(m: Model, u: Any) -> Any:
    """A local unknown, a derivative, a branch and fields."""
    s = m.implicit("s", lambda s: m.define("inner", s**3) + s - u, start=u)
    W = m.define("W", sp.exp(s) + u**2)
    m.fields(s=s, slope=m.derivative("slope", W, u), side=sp.Piecewise((u, u > 0), (-u, True)))
    return W


def test_values_are_those_of_the_kernel() -> None:
    d = model(relaxed)
    kernel, X, u = load_kernel(d), np.array([[0.0, 1.0], [0, 2]]), np.array([[0.0, 0], [0.3, -0.8]])
    found = kernel.explain(X, u, element=1)
    for k, name in enumerate(kernel.fields):
        np.testing.assert_allclose(
            found[name], kernel.fields_at(X, u)[1, :, k], rtol=1e-13, err_msg=name
        )
    np.testing.assert_allclose(found["inner"], found["s"] ** 3, rtol=1e-14)
    np.testing.assert_allclose(found["Pi"], kernel.energy(X, u)[1], rtol=1e-14)
    assert found.fault == ""
    assert f"{THIS}:" in found.lines["W"]


@pytest.mark.parametrize(
    ("write", "dofs", "fault"),
    [
        (lambda m, u: sp.sqrt(u), (-1, -1), "sqrt(value) has no value at point 0, value = -1"),
        (lambda m, u: sp.log(u - 2), (3, 1.5), "log(value - 2) has no value at point 1"),
        (
            lambda m, u: 1 / m.define("v", u - 1) ** 2,
            (1, 1),
            "1/(v**2) has no value at point 0, v**2 = 0",
        ),
        (lambda m, u: sp.exp(u), (1e3, 1e3), "exp(value) has no value at point 0, value = 1000"),
        (lambda m, u: sp.sqrt(u) ** 5 * sp.sqrt(u + 1), (0, 0), ""),
        (lambda m, u: u * sp.sqrt(u**2 + u), (0, 0), "in a derivative, of value"),
        (lambda m, u: sp.Piecewise((sp.log(u), u > 0), (u**2, True)), (-1, -1), ""),
        (
            lambda m, u: m.implicit("s", lambda s: s**2 + 1 + u**2, start=u) * u,
            *((1, 1), "s has no solution at point 0"),
        ),
    ],
)
def test_fault_is_the_first_operation_without_a_value(
    write: Callable[[Model, Any], Any], dofs: tuple[float, float], fault: str
) -> None:
    d = model(write)
    found = explained(d, *dofs)
    assert fault in found.fault
    assert bool(found.fault) == bool(fault)
    assert not fault or THIS in found.fault
    # the kernel agrees that there is a value, or none
    kernel, at = load_kernel(d), (np.array([[0.0, 1.0]]), np.array([dofs], dtype=float))
    results = [kernel.energy(*at), kernel.residual(*at), kernel.tangent(*at)[1]]
    assert all(np.isfinite(r).all() for r in results) == (not fault)


def test_probe_changes_no_kernel() -> None:
    def probed(m: Model, u: Any) -> Any:
        assert m.probe("twice", 2 * u) == 2 * u
        m.probe("M", sp.Matrix([[u, 1]]))
        return u**2

    with_probe = model(probed)
    assert fingerprint(with_probe) == fingerprint(model(lambda m, u: u**2))
    assert explained(with_probe, 1, 1)["twice"].tolist() == [2, 2]
    assert explained(with_probe, 1, 1)["M_00"].tolist() == [1, 1]
    with pytest.raises(ModelError, match="probe: the name value is used twice"):
        model(lambda m, u: m.probe("value", u))
    with pytest.raises(KeyError, match=r"no value 'twic' .did you mean 'twice'"):
        explained(with_probe, 1, 1)["twic"]
    with pytest.raises(softehl.ArgumentError, match="element = 2; there are 1 elements"):
        load_kernel(with_probe).explain(np.array([[0.0, 1]]), np.zeros((1, 2)), element=2)


@softehl.page
def heat(m: Any) -> None:
    (a,) = m.parameters(a="[1]")
    T = m.scalar("T")
    (T_old,) = m.point_data(T_old="before")
    m.history(T_old=T)
    root = sp.sqrt(a - T + 0 * T_old)
    m.weak(root, T)
    m.minimise(m.grad(T).dot(m.grad(T)) + T_old * T)


def test_message_of_a_study_names_the_line() -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(2, 1)))
    study.add("body", heat, a=1)
    study.fix("left", T=2)
    line = heat.write.__code__.co_firstlineno + 7
    with pytest.raises(softehl.NotConverged, match=rf"sqrt\(.*{THIS}:{line}\)"):
        study.solve()
    found = study.explain(0, 1.0)
    assert found["T"].max() > 1
    assert f"{THIS}:{line}" in found.fault
    assert study.explain(1, 1.0).fault == ""


def test_explanations_of_results_and_of_shipped_kernels(tmp_path: Path) -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(2, 1)))
    study.add("body", heat, a=9)
    study.fix("left", T=2)
    result = study.solve(steps=2)
    found = result.explain(0)
    assert found["T"] == pytest.approx(result.state["body"][0, :, 0])  # before the step: T_old
    with pytest.raises(KeyError, match="no block 'bod'"):
        result.explain(0, "bod")
    kernel = load_kernel("solid_q4")
    n = len(kernel.parameters)
    X = np.array([[0.0, 1, 1, 1, 1, 2, 0, 2]])
    found = kernel.explain(X, np.zeros((1, 8)), parameters=np.ones(n))
    assert found.fault == ""
    assert all(map(math.isfinite, found["J"]))
    folder = load_kernel(heat, cell="quad4").library.directory
    copied = shutil.copytree(folder, tmp_path / "kernels")
    with pytest.raises(softehl.SoftehlError, match="is not known to this process: load its model"):
        load_kernel(copied).explain(
            X, np.zeros((1, 4)), parameters=[1.0], point_data=np.ones((1, 4, 1))
        )
