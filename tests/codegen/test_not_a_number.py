"""Branches whose conditions compare what is not-a-number, and powers with any exponent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.elements import quadrature
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import Kernel, load_kernel

u, v, k = sp.symbols("u v k", real=True)
SPOILT = [
    sp.Min(5 + u, sp.sqrt(u)),
    sp.Min(5 + u, sp.log(u)),
    sp.Max(-5, u ** sp.Rational(3, 4)) * v,
    sp.sign(sp.log(u)) * v,
    sp.Heaviside(sp.sqrt(u), 0) * v,
    sp.Piecewise((u * v, sp.sqrt(u) < v), (v, True)),
    sp.Piecewise((u * v, sp.Or(sp.sqrt(u) < v, v < 0)), (v, True)),
    sp.Piecewise((u * v, sp.Ne(sp.log(u), v)), (v, True)),
    sp.Abs(sp.sqrt(u)),
]
"""Not-a-number at u = -1, v = 0.5; numbers at u = 1.5."""
SOUND = [
    sp.Piecewise((v**2, sp.And(u > 0, sp.sqrt(u) < 1)), (u * v, True)),
    sp.Piecewise((u * v, sp.Or(sp.sqrt(u) < v, v < 1)), (v, True)),
    sp.Piecewise((sp.sqrt(u), u > 0), (u * v, True)),
]
"""What decides has a value: u v at u = -1."""
POWERS = [u**k, v * sp.Abs(u) ** k]


def model(name: str, density: sp.Expr) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    symbols = {u: m.unknown("u"), v: m.unknown("v")}
    (symbols[k],) = m.parameters(k="exponent")
    m.potential(density.xreplace(symbols) + symbols[v] * symbols[k] + symbols[u])
    return m


def local(name: str) -> Model:
    """A local unknown s with a minimum in its equation."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("u"), m.unknown("v")
    (e,) = m.parameters(k="exponent")
    s = m.implicit("s", lambda s: s - sp.Min(5 + s, sp.sqrt(a + s)) - b, start=b)
    m.potential(s**2 + e * a)
    return m


@pytest.fixture(scope="module", params=[Target.SIMD, Target.SCALAR])
def kernels(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(str(request.param))
    models = [
        *(model(f"spoilt_{i}", e) for i, e in enumerate(SPOILT)),
        *(model(f"sound_{i}", e) for i, e in enumerate(SOUND)),
        *(model(f"power_{i}", e) for i, e in enumerate(POWERS)),
        local("local"),
    ]
    made = [pipeline.compile_model(m.finish(), request.param) for m in models]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O1"))
    return folder


def values(kernel: Kernel, at: float, exponent: float = 2.0) -> list[np.ndarray]:
    """Energy, residual and tangent of the second of five elements, at u = `at`, v = 1/2."""
    dofs = np.array([[1.5, 0.5], [at, 0.5], [1.5, 0.5], [1.5, 0.5], [1.5, 0.5]])
    nowhere, given = np.empty((5, 0)), {"parameters": [exponent]}
    found = [kernel.energy(nowhere, dofs, **given), *kernel.tangent(nowhere, dofs, **given)]
    assert all(np.isfinite(x[[0, 2, 3, 4]]).all() for x in found)
    return [x[1] for x in found]


@pytest.mark.parametrize("name", [*(f"spoilt_{i}" for i in range(len(SPOILT))), "local"])
def test_a_condition_on_not_a_number_spoils_energy_residual_and_tangent(
    kernels: Path, name: str
) -> None:
    kernel = load_kernel(name, kernels)
    assert [bool(np.isnan(x).any()) for x in values(kernel, -1.0)] == [True] * 3


@pytest.mark.parametrize("i", range(len(SOUND)))
def test_a_condition_that_is_decided_takes_its_side(kernels: Path, i: int) -> None:
    energy, R, K = values(load_kernel(f"sound_{i}", kernels), -1.0, 0.0)
    assert energy == -1.5
    assert R.tolist() == [1.5, -1.0]
    assert K.tolist() == [[0, 1], [1, 0]]


@pytest.mark.parametrize(
    ("i", "at", "exponent", "energy", "slope", "curvature"),
    [
        (0, -3.0, 2.0, 9.0, -6.0, 2.0),
        (0, -2.0, 3.0, -8.0, 12.0, -12.0),
        (0, 0.0, 2.5, 0.0, 0.0, 0.0),
        (0, 0.0, 2.0, 0.0, 0.0, 2.0),
        (0, -2.0, 2.5, np.nan, np.nan, np.nan),
        (0, 4.0, 0.5, 2.0, 0.25, -1 / 32),
        (1, 0.0, 2.5, 0.0, 0.0, 0.0),
        (1, -4.0, 2.5, 16.0, -10.0, 3.75),
        (1, 0.0, 1.5, 0.0, 0.0, np.inf),
    ],
)
def test_a_power_is_that_of_c(
    kernels: Path, i: int, at: float, exponent: float, energy: float, slope: float, curvature: float
) -> None:
    found, R, K = values(load_kernel(f"power_{i}", kernels), at, exponent)
    assert found - at - exponent / 2 == pytest.approx(energy, rel=1e-14, nan_ok=True)
    assert R[0] - 1 == pytest.approx(slope, rel=1e-14, nan_ok=True)
    assert K[0, 0] == pytest.approx(curvature, rel=1e-14, nan_ok=True)
