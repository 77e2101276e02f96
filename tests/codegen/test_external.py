"""C functions of a user: derivatives against mpmath, wrong ones, orders, addresses, hosts."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

import ctypes
import pickle
import subprocess
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Model, Study, quadrature
from softehl.codegen.external_function import ExternalFunction, ExternalFunctionError
from softehl.codegen.hosts.material_response import point
from softehl.codegen.language.definition import functions_of_user
from softehl.codegen.language.errors import ModelError
from softehl.codegen.tools import host_files, kernel_cache
from softehl.codegen.tools.model_text import ModelFileError
from softehl.runtime.study import StudyError

LAW = """
#include <math.h>
int law(const double *x, double *y, double *dy, double *ddy)
{
    const double e = x[0], d = x[1], q = exp(e * d);
    y[0] = q * e + d * d * d;
    if (dy) { dy[0] = q * (1 + e * d); dy[1] = q * e * e + 3 * d * d; }
    if (ddy) {
        ddy[0] = q * d * (2 + e * d);
        ddy[1] = ddy[2] = q * e * (2 + e * d);
        ddy[3] = q * e * e * e + 6 * d;
    }
    return !(e < 9);
}
"""
BY_STEPS = """
#include <complex.h>
typedef double complex Z;
int law(const double complex *x, double complex *y, double complex *dy, double complex *ddy)
{
    const Z e = x[0], d = x[1], q = cexp(e * d);
    y[0] = q * e + d * d * d;
    if (dy) { dy[0] = q * (1 + e * d); dy[1] = q * e * e + 3 * d * d; }
    return 0;
}
"""
VALUES = BY_STEPS.replace("if (dy) { dy[0] = q * (1 + e * d); dy[1] = q * e * e + 3 * d * d; }", "")


def exact(e: Any, d: Any) -> Any:
    """The law in mpmath."""
    return mpmath.exp(e * d) * e + d**3


def spring(source: str | None, derivatives: int | None = None, **more: Any) -> Any:
    """A potential of one unknown."""
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    (d,) = m.parameters(d="factor")
    law = m.external("law", [u**2, d], source=source, derivatives=derivatives, **more)
    m.potential(law + u)
    m.fields(law=law)
    m.offer(product=True, derivatives=[d])
    return m.finish()


@pytest.mark.parametrize(("source", "order"), [(LAW, 2), (BY_STEPS, 1)])
def test_derivatives_against_mpmath(source: str, order: int) -> None:
    kernel = softehl.load_kernel(spring(source, order))
    u = np.array([[-1.1], [-1e-9], [0.0], [0.3], [1e3**0.5 / 13], [0.9], [1.4]])
    K = kernel.tangent(np.empty((7, 0)), u, parameters=[0.7])[1][:, 0, 0]
    R = kernel.residual(np.empty((7, 0)), u, parameters=[0.7])[:, 0]
    S = kernel.derivative("d", np.empty((7, 0)), u, parameters=[0.7])[:, 0]
    with mpmath.workdps(60):
        for k, v in enumerate(u[:, 0]):
            energy = lambda a, d: exact(a**2, d) + a  # noqa: E731
            for found, n in ((R[k], (1, 0)), (K[k], (2, 0)), (S[k], (1, 1))):
                expected = mpmath.diff(energy, (v, mpmath.mpf(0.7)), n)
                assert abs(found - expected) <= 4e-15 * max(1, abs(expected))


def test_calls_of_several_functions() -> None:
    """One function at two places, and another one of the same name, in one kernel."""
    m = Model("several", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    first = m.external("law", [u, 2], source=LAW, derivatives=2)
    second = m.external("again", [2, u], source=LAW, derivatives=2, function="law")
    more = BY_STEPS.replace("+ d * d * d", "+ d * d * d + e * e").replace(
        "(1 + e * d)", "(1 + e * d) + 2 * e"
    )
    third = m.external("other", [u, 1], source=more, derivatives=1, function="law")
    m.potential(first + 3 * second + 5 * third)
    kernel = softehl.load_kernel(m.finish())
    R, K = kernel.tangent(np.empty((1, 0)), np.array([[0.3]]))
    with mpmath.workdps(40):
        energy = lambda u: exact(u, 2) + 3 * exact(2, u) + 5 * (exact(u, 1) + u**2)  # noqa: E731
        assert R[0, 0] == pytest.approx(float(mpmath.diff(energy, mpmath.mpf(0.3))), rel=1e-14)
        assert K[0, 0, 0] == pytest.approx(
            float(mpmath.diff(energy, mpmath.mpf(0.3), 2)), rel=1e-14
        )


def test_where_it_has_no_value_the_element_is_not_a_number() -> None:
    kernel = softehl.load_kernel(spring(LAW, 2))
    R = kernel.residual(np.empty((3, 0)), np.array([[0.1], [3.1], [0.2]]), parameters=[0.1])
    assert np.isnan(R[:, 0]).tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("3 * d * d;", "2 * d * d;", r"dy\[0\]\[1\] of law, the derivative of y\[0\] by x\[1\]"),
        ("6 * d", "5 * d", r"ddy\[0\]\[1\]\[1\] of law"),
        ("ddy[1] = ddy[2]", "ddy[1] = 0; ddy[2]", r"ddy\[0\]\[1\]\[0\] .* is 0 at"),
        ("ddy[0] = q * d * (2 + e * d);", "", r"ddy\[0\]\[0\]\[0\] .* is nan"),
        ("(1 + e * d)", "(1.00001 + e * d)", r"dy\[0\]\[0\] of law"),
    ],
)
def test_a_wrong_derivative_is_named(right: str, wrong: str, message: str) -> None:
    assert right in LAW
    with pytest.raises(ExternalFunctionError, match=message):
        kernel_cache.derive([spring(LAW.replace(right, wrong), 2)])


@pytest.mark.parametrize(
    ("source", "order", "message"),
    [
        (LAW, 1, "law has derivatives of order 1, .* of order 2: return them as ddy"),
        (
            LAW,
            0,
            "law has derivatives of order 0, .* of order 1: write it for numbers of type",
        ),
        (VALUES, None, "law has derivatives of order 1, .* of order 2: return dy as well"),
    ],
)
def test_orders_that_are_missing(source: str, order: int | None, message: str) -> None:
    with pytest.raises(ModelFileError, match=r"test_external\.py:\d+: " + message):
        kernel_cache.derive([spring(source, order)])


def test_a_page_that_is_wrong() -> None:
    for source, more, message in (
        ("law.c", {}, "no file law.c"),
        (LAW, {"function": "rule"}, "has no function rule"),
        (LAW, {"derivatives": 3}, "derivatives = 3, must be 0, 1 or 2"),
        (LAW, {"outputs": 0}, "outputs = 0, must be a number"),
        (1234, {}, "give a C file, its text, or a function of ctypes"),
    ):
        with pytest.raises(ModelError, match=message):
            spring(source, **{"derivatives": None, **more})  # type: ignore[arg-type]
    with pytest.raises(softehl.BuildError, match="another prototype than int law"):
        kernel_cache.derive([spring(LAW.replace("const double *x", "double x[]"), 2)])
    m = Model("stretches", nodes=1, rule=quadrature.point_rule())
    C = sp.diag(*(m.unknown(f"c{k}") for k in range(3)))
    with pytest.raises(ModelError, match="which has no divided differences"):
        m.principal("W", C, lambda a, b, c: m.external("law", [a * b * c, 1], source=LAW))


def test_an_edited_file_gives_another_kernel(tmp_path: Path) -> None:
    (tmp_path / "law.c").write_text('#include "inner.h"\n' + LAW.replace("d * d * d", "cube(d)"))
    (tmp_path / "inner.h").write_text("static double cube(double a) { return a * a * a; }\n")
    page = tmp_path / "spring.py"
    page.write_text(
        "from softehl import Definition, Model, quadrature\n"
        "def spring() -> Definition:\n"
        "    m = Model('filed', nodes=1, rule=quadrature.point_rule())\n"
        "    m.potential(m.external('law', [m.unknown('u'), 1], source='law.c', derivatives=2))\n"
        "    return m.finish()\n"
    )
    X, u = np.empty((1, 0)), np.array([[0.3]])
    before = softehl.load_kernel(page).energy(X, u)[0]
    assert before == pytest.approx(float(exact(0.3, 1)), rel=1e-15)
    (tmp_path / "inner.h").write_text("static double cube(double a) { return a * a * a + 1; }\n")
    assert softehl.load_kernel(page).energy(X, u)[0] == before + 1


def test_local_unknowns_call_it() -> None:
    """s exp(s d) + d^3 = u by Newton's method; ds/du = 1 / law'(s)."""
    m = Model("inverse", nodes=1, rule=quadrature.point_rule())
    u, (d,) = m.unknown("u"), m.parameters(d="factor")
    s = m.implicit("s", lambda s: m.external("law", [s, d], source=VALUES) - u, start=0)
    m.weak_form([(s, u)])
    kernel = softehl.load_kernel(m.finish())
    R, K = kernel.tangent(np.empty((1, 0)), np.array([[0.8]]), parameters=[0.4])
    with mpmath.workdps(40):
        found = mpmath.findroot(lambda s: exact(s, mpmath.mpf(0.4)) - mpmath.mpf(0.8), 0.5)
        slope = 1 / mpmath.diff(lambda s: exact(s, mpmath.mpf(0.4)), found)
    assert R[0, 0] == pytest.approx(float(found), rel=1e-14)
    assert K[0, 0, 0] == pytest.approx(float(slope), rel=1e-14)


@softehl.page
def diffusion(m):
    """A flux that is called by its address."""
    T = m.scalar("T")
    (d,) = m.parameters(d="factor")
    g = m.grad(T)
    flux = m.external("law", [g[0], d])
    m.weak(sp.Matrix([flux, g[1]]), g)


@ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.POINTER(ctypes.c_double)] * 4)
def law_in_python(x, y, dy, ddy):
    e, d = x[0], x[1]
    q = np.exp(e * d)
    y[0] = q * e + d**3
    if dy:
        dy[0], dy[1] = q * (1 + e * d), q * e * e + 3 * d * d
    return 0


@softehl.page
def by_text(m):
    """The same flux by its text."""
    T = m.scalar("T")
    (d,) = m.parameters(d="factor")
    g = m.grad(T)
    m.weak(sp.Matrix([m.external("law", [g[0], d], source=VALUES), g[1]]), g)


def heat(page: Any, d: float = 0.4, **given: Any) -> Study:
    study = Study(Mesh.rectangle(1, 1, cells=(2, 2)))
    study.add("body", page, d=d, **given)
    study.fix("left", T=0)
    study.load("right", T=0.5)
    return study


def test_an_address_is_given_to_a_study(tmp_path: Path) -> None:
    (tmp_path / "law.c").write_text(LAW)
    target = tmp_path / "law.so"
    subprocess.run(["cc", "-shared", "-fPIC", tmp_path / "law.c", "-o", target, "-lm"], check=True)
    function = ctypes.CDLL(str(target)).law
    expected = heat(by_text).solve().values("T")
    for given in (function, ctypes.cast(function, ctypes.c_void_p).value, law_in_python):
        found = heat(diffusion, law=given).solve().values("T")
        assert np.abs(found - expected).max() < 1e-14
    for wrong in (3.0, None, "law", 0, True):
        with pytest.raises(StudyError, match="give the address of a C function"):
            heat(diffusion, law=wrong)
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(heat(diffusion, law=function))
    result = heat(diffusion, law=function).solve()
    with pytest.raises(StudyError, match="is a C function, not a number"):
        result.sensitivity("T", at=(1.0, 0.5), by={"body": ["law"]})
    with pytest.raises(softehl.TargetError, match="has no addresses"):
        host_files.files(diffusion.definitions(cell_options())[0], "c")


def test_a_page_knows_the_address_itself(tmp_path: Path) -> None:
    """Its derivatives are checked, a study needs no more, and a wrong function is named."""

    def page(function: Any) -> Any:
        @softehl.page
        def known(m):
            T = m.scalar("T")
            (d,) = m.parameters(d="factor")
            g = m.grad(T)
            m.weak(sp.Matrix([m.external("law", [g[0], d], source=function), g[1]]), g)

        return known

    expected = heat(by_text).solve().values("T")
    assert np.abs(heat(page(law_in_python)).solve().values("T") - expected).max() < 1e-14
    with pytest.raises(ExternalFunctionError, match=r"dy\[0\]\[0\] of law"):
        kernel_cache.derive(page(wrong_law_in_python).definitions(cell_options()))


@ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.POINTER(ctypes.c_double)] * 4)
def wrong_law_in_python(x, y, dy, ddy):
    law_in_python(x, y, dy, ddy)
    if dy:
        dy[0] *= 2
    return 0


def cell_options() -> Any:
    from softehl.codegen.language.weak_form import CellOptions

    return CellOptions(("quad4",))


@pytest.mark.parametrize("given", [{"page": by_text}, {"page": diffusion, "law": law_in_python}])
def test_sensitivity_and_fit(given: dict[str, Any]) -> None:
    at = (1.0, 0.5)
    result = heat(**given).solve()
    slope = result.sensitivity("T", at=at, by={"body": ["d"]})["body", "d"]
    plus, minus = (heat(**given, d=0.4 + h).solve().at(at)["T"] for h in (1e-5, -1e-5))
    assert slope == pytest.approx((plus - minus) / 2e-5, rel=1e-8)
    fit = heat(**given, d=0.6).fit({at: {"T": result.at(at)["T"]}}, by={"body": ["d"]})
    assert fit.values["body", "d"] == pytest.approx(0.4, rel=1e-9)


@softehl.material
def foreign(m):
    """Saint Venant's law, its stress in C."""
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    S = m.external("stress", [m.green, mu, lame], outputs=(3, 3), source=STRESS)
    m.second_stress(S)


STRESS = """
#include <complex.h>
int stress(const double complex *x, double complex *y, double complex *dy, double complex *ddy)
{
    for (int k = 0; k < 9; ++k)
        y[k] = 2 * x[9] * x[k] + (k % 4 == 0 ? x[10] * (x[0] + x[4] + x[8]) : 0);
    return 0;
}
"""


def test_a_material_goes_to_hosts(tmp_path: Path) -> None:
    for target in ("c", "calculix", "abaqus"):
        texts = host_files.files(foreign, target)
        assert sum("int stress(const double complex" in t for t in texts.values()) == 1
        if target == "c":
            host_files.write(tmp_path, texts)
    subprocess.run(["make", "-C", tmp_path, "test"], check=True, capture_output=True)
    assert len(functions_of_user(point(foreign))) == 1


def test_the_polynomial_has_the_derivatives_of_the_function() -> None:
    """What the reference evaluator differentiates, in 50 digits."""
    f = ExternalFunction("law", 2, 1, 2, LAW, "law.c")
    with mpmath.workdps(50):
        x = [mpmath.mpf("0.31"), mpmath.mpf("0.72")]
        found = mpmath.diff(lambda a: f.near([a, x[1]], mpmath.mpf)[0], x[0], 2)  # type: ignore
        assert abs(found - mpmath.diff(lambda a: exact(a, x[1]), x[0], 2)) < 1e-15
