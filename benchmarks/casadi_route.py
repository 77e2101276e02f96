"""CasADi by every route that a careful user would try; the report keeps the fastest.

It is an optional package, so it is imported when asked for.

| route             | what is differentiated                                                     |
|-------------------|----------------------------------------------------------------------------|
| SX                | energy (F-bar: nodal forces) of the element, in scalars; K is the Jacobian  |
| SX, cse           | the same, then CasADi's common subexpression elimination                   |
| SX, Hessian       | K is the Hessian of the energy, upper triangle mirrored; cse (not F-bar)   |
| SX through F      | P(F) at the point, chain rule by hand: B^T P and B^T (dP/dF) B; cse        |
| MX of SX points   | a function per Gauss point, called four times, differentiated as a graph   |
"""

from __future__ import annotations

import functools
import importlib
import itertools
import math
from collections.abc import Callable
from typing import Any

from benchmarks.candidate import ENTRY, Candidate, Layout, Stopwatch
from benchmarks.problem import Case

LAYOUT = Layout(column_major=True)
OWN_FLAGS = ("-O3",)
"""CasADi sets none; its own compiler interface would leave the code unoptimised."""

CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
POINTS = tuple(itertools.product((-1 / math.sqrt(3), 1 / math.sqrt(3)), repeat=2))


def derive(case: Case, route: str) -> Candidate:
    """Every route applies to every case, but the Hessian only to the plain tangent."""
    build = _ROUTES[route]
    ca = importlib.import_module("casadi")
    watch = Stopwatch()
    function = build(ca, case)
    generator = ca.CodeGenerator("kernel.c")
    generator.add(function)
    text = generator.dump()
    seconds = watch.seconds()
    files = {"kernel.c": f"#include <stddef.h>\n{text}\n{_entry(function, case)}"}
    name = f"CasADi {ca.__version__}"
    return Candidate(name, route, case, seconds, files, LAYOUT, OWN_FLAGS)


def _entry(f: Any, case: Case) -> str:
    """Loop over the elements with the work arrays that the function asks for."""
    sizes = [max(1, size) for size in (f.sz_arg(), f.sz_res(), f.sz_iw(), f.sz_w())]
    second = "        res[1] = tangent + 64 * e;\n" if case.tangent else ""
    return f"""{ENTRY}
{{
    const casadi_real *arg[{sizes[0]}];
    casadi_real *res[{sizes[1]}];
    casadi_int iw[{sizes[2]}];
    casadi_real w[{sizes[3]}];
    (void)tangent;
    for (ptrdiff_t e = 0; e < n; ++e) {{
        arg[0] = X + 8 * e, arg[1] = u + 8 * e, arg[2] = p;
        res[0] = values + 8 * e;
{second}        bench(arg, res, iw, w, 0);
    }}
}}
"""


# The mathematics, in scalars of any CasADi type --------------------------------------------------


def _geometry(X: Any, xi: Any, eta: Any) -> tuple[list[Any], list[Any], Any, Any]:
    """N, (dN/dZ, dN/dR), R and the Jacobian at a parent point."""
    N = [(1 + a * xi) * (1 + b * eta) / 4 for a, b in CORNERS]
    parent = [(a * (1 + b * eta) / 4, b * (1 + a * xi) / 4) for a, b in CORNERS]
    z, r = (
        [sum(g[k] * X[2 * a + c] for a, g in enumerate(parent)) for k in (0, 1)] for c in (0, 1)
    )
    det = z[0] * r[1] - z[1] * r[0]
    dN = [((g * r[1] - h * r[0]) / det, (h * z[0] - g * z[1]) / det) for g, h in parent]
    return N, dN, sum(n * X[2 * a + 1] for a, n in enumerate(N)), det


def _gradient(X: Any, u: Any, xi: Any, eta: Any) -> tuple[list[Any], list[list[Any]], Any]:
    """F = (zz, zr, rz, rr, tt), dF/du (5 rows of 8) and 2 pi R dA."""
    N, dN, R, det = _geometry(X, xi, eta)
    rows: list[list[Any]] = [[0] * 8 for _ in range(5)]
    for a in range(4):
        rows[0][2 * a], rows[1][2 * a] = dN[a]
        rows[2][2 * a + 1], rows[3][2 * a + 1] = dN[a]
        rows[4][2 * a + 1] = N[a] / R
    slope = [sum(g * u[k] for k, g in enumerate(row) if not _is_zero(g)) for row in rows]
    F = [1 + slope[0], slope[1], slope[2], 1 + slope[3], 1 + slope[4]]
    return F, rows, 2 * math.pi * R * det


def _is_zero(entry: Any) -> bool:
    return isinstance(entry, int) and entry == 0


def _volume_ratio(F: Any) -> Any:
    return (F[0] * F[3] - F[1] * F[2]) * F[4]


def _energy(ca: Any, F: Any, p: Any) -> Any:
    """W(F) of (3)-(6)."""
    zz, rr, zr = F[0] ** 2 + F[1] ** 2, F[2] ** 2 + F[3] ** 2, F[0] * F[2] + F[1] * F[3]
    tt, I3 = F[4] ** 2, _volume_ratio(F) ** 2
    I1 = zz + rr + tt
    I2 = (I1**2 - zz**2 - rr**2 - 2 * zr**2 - tt**2) / 2
    isochoric = p[0] * (I3 ** (-1 / 3) * I1 - 3) / 2 + p[1] * (I3 ** (-2 / 3) * I2 - 3) / 2
    return isochoric + p[2] * ((I3 - 1) / 2 - ca.log(I3) / 2) / 2


def _stress(ca: Any) -> Any:
    """P(F, J0; p): the derivative of W, or with F-bar P_eff = (J/J0)^(2/3) P(Fbar).

    `P_eff` is the derivative of W(a F) / a^3 with a frozen, a = (J0/J)^(1/3).
    """
    F, p, a = ca.SX.sym("F", 5), ca.SX.sym("p", 3), ca.SX.sym("a")
    effective = ca.gradient(_energy(ca, a * F, p) / a**3, F)
    frozen = ca.Function("frozen", [F, p, a], [effective])
    J0 = ca.SX.sym("J0")
    ratio = (J0 / _volume_ratio(F)) ** (1 / 3)
    plain = ca.gradient(_energy(ca, F, p), F)
    fbar = ca.Function("fbar", [F, p, J0], [frozen(F, p, ratio)])
    return {"q4": ca.Function("plain", [F, p, J0], [plain]), "fbar": fbar}


# Routes ------------------------------------------------------------------------------------------


def _symbols(kind: Any) -> tuple[Any, Any, Any]:
    return kind.sym("X", 8), kind.sym("u", 8), kind.sym("p", 3)


def _potential(ca: Any, X: Any, u: Any, p: Any) -> Any:
    """Energy of the plain element."""
    parts = [_gradient(X, u, *point) for point in POINTS]
    return sum(volume * _energy(ca, F, p) for F, _, volume in parts)


def _forces(ca: Any, X: Any, u: Any, p: Any, xi: Any, eta: Any) -> Any:
    """F-bar: nodal forces (8) of one point, the variation at frozen a."""
    a = ca.SX.sym("a")
    F, _, volume = _gradient(X, u, xi, eta)
    F0, _, _ = _gradient(X, u, 0, 0)
    Fbar = [a * f for f in F]
    frozen = ca.gradient(volume * _energy(ca, Fbar, p) / a**3, u)
    return ca.substitute(frozen, a, (_volume_ratio(F0) / _volume_ratio(F)) ** (1 / 3))


def _function(ca: Any, case: Case, inputs: Any, R: Any, K: Any, *, cse: bool) -> Any:
    outputs = [R, ca.densify(K)] if case.tangent else [R]
    return ca.Function("bench", list(inputs), ca.cse(outputs) if cse else outputs)


def _scalars(ca: Any, case: Case, *, cse: bool) -> Any:
    X, u, p = _symbols(ca.SX)
    if case.fbar:
        R = sum(_forces(ca, X, u, p, *point) for point in POINTS)
    else:
        R = ca.gradient(_potential(ca, X, u, p), u)
    K = ca.jacobian(R, u) if case.tangent else None
    return _function(ca, case, (X, u, p), R, K, cse=cse)


def _hessian(ca: Any, case: Case) -> Any:
    X, u, p = _symbols(ca.SX)
    H, R = ca.hessian(_potential(ca, X, u, p), u)
    return _function(ca, case, (X, u, p), R, ca.triu2symm(ca.triu(H)), cse=True)


def _through_F(ca: Any, case: Case) -> Any:
    X, u, p = _symbols(ca.SX)
    kind = "fbar" if case.fbar else "q4"
    stress, F_, J0_ = _stress(ca)[kind], ca.SX.sym("F", 5), ca.SX.sym("J0")
    moduli = ca.Function(
        "moduli", [F_, p, J0_], [ca.jacobian(stress(F_, p, J0_), ca.vertcat(F_, J0_))]
    )
    F0, _, _ = _gradient(X, u, 0, 0)
    J0 = _volume_ratio(F0) if case.fbar else ca.SX(1)
    dJ0 = ca.jacobian(J0, u)
    R, K = ca.SX.zeros(8), ca.SX.zeros(8, 8)
    for point in POINTS:
        F, rows, volume = _gradient(X, u, *point)
        B = ca.vertcat(*[ca.horzcat(*[ca.SX(1, 1) if _is_zero(g) else g for g in r]) for r in rows])
        R += volume * (B.T @ stress(ca.vertcat(*F), p, J0))
        if case.tangent:
            A = volume * moduli(ca.vertcat(*F), p, J0)
            K += B.T @ (A[:, :5] @ B + A[:, 5] @ dJ0)
    if not case.fbar:
        K = ca.triu2symm(ca.triu(K))
    return _function(ca, case, (X, u, p), R, K, cse=True)


def _calls(ca: Any, case: Case) -> Any:
    x, v, q, place = *_symbols(ca.SX), ca.SX.sym("place", 2)
    if case.fbar:
        value = _forces(ca, x, v, q, place[0], place[1])
    else:
        F, _, volume = _gradient(x, v, place[0], place[1])
        value = volume * _energy(ca, F, q)
    one = ca.Function("one", [x, v, q, place], [ca.cse(value)])
    X, u, p = _symbols(ca.MX)
    total = sum(one(X, u, p, ca.DM(list(point))) for point in POINTS)
    R = total if case.fbar else ca.gradient(total, u)
    K = ca.jacobian(R, u) if case.tangent else None
    return _function(ca, case, (X, u, p), R, K, cse=False)


_ROUTES: dict[str, Callable[[Any, Case], Any]] = {
    "SX": functools.partial(_scalars, cse=False),
    "SX, cse": functools.partial(_scalars, cse=True),
    "SX, Hessian": _hessian,
    "SX through F": _through_F,
    "MX of SX points": _calls,
}
