"""Pages whose kernels branch, loop over points or hold local unknowns, as a user writes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.elements.cells import element
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL


def _solid(name: str, kind: str, energy: Callable[[Any, Any, Any, Any], Any]) -> Definition:
    """W(I1, J, mu, kappa) on a cell, its loop over the points left as it is."""
    cell = element(kind)
    m = Model(name, nodes=len(cell.nodes), rule=cell.rule, unroll=False)
    X = m.coordinates(*"XYZ"[: cell.dimension])
    u = m.nodal_unknowns(*("u", "v", "w")[: cell.dimension])
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kin.isoparametric(m, X, cell.gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace() + 3 - cell.dimension
    m.potential(m.integral("Pi", energy(I1, J, mu, kappa) * e.detJ))
    m.offer(tasks=["residual", "tangent"])
    return m.finish()


def _rubber(I1: Any, J: Any, mu: Any, kappa: Any) -> Any:
    return mu / 2 * (I1 - 3 - 2 * sp.log(J)) + kappa / 2 * (J - 1) ** 2


def _bimodular(I1: Any, J: Any, mu: Any, kappa: Any) -> Any:
    """Stiffer where the volume shrinks."""
    softer = kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    return mu / 2 * (I1 - 3 - 2 * sp.log(J)) + sp.Piecewise(
        (kappa / 2 * (J - 1) ** 2, J < 1), (softer, True)
    )


def hex8() -> Definition:
    return _solid("hex8", "hex8", _rubber)


def hex27() -> Definition:
    return _solid("hex27", "hex27", _rubber)


def quad9() -> Definition:
    return _solid("quad9", "quad9", _rubber)


def q4_branch() -> Definition:
    return _solid("q4_branch", "quad4", _bimodular)


def q4_smooth() -> Definition:
    return _solid("q4_smooth", "quad4", _rubber)


def j2_hex8() -> Definition:
    """Radial return with Voce hardening: plastic strain and multiplier are local unknowns."""
    cell = element("hex8")
    m = Model("j2_hex8", nodes=8, rule=quadrature.gauss(2, 3), unroll=False)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u", "v", "w")
    G, K, sy, H, more, rate = m.parameters(
        G="shear modulus", K="bulk modulus", sy="yield stress", H="hardening",
        more="saturation", rate="rate of saturation",
    )  # fmt: skip
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    old = m.point_data(
        **{f"p_{i}{j}": "plastic strain" for i, j in pairs}, alpha="equivalent plastic strain"
    )
    e = kin.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kin.deformation_gradient(m, e.dN, u) - sp.eye(3)
    strain = m.define("strain", (grad + grad.T) / 2)

    def matrix(v: Any) -> Any:
        return sp.Matrix(3, 3, lambda i, j: v[pairs.index((min(i, j), max(i, j)))])

    def stress(p: Any) -> Any:
        elastic = strain - p
        return 2 * G * (elastic - elastic.trace() / 3 * sp.eye(3))

    def limit(alpha: Any) -> Any:
        return sy + H * alpha + more * (1 - sp.exp(-rate * alpha))

    trial = m.define("trial", stress(matrix(old)))
    q = m.define("q", sp.sqrt(sp.Rational(3, 2) * (trial * trial).trace()))

    def flow(s: Any) -> list[Any]:
        p, dg = s[:6], s[6]
        now = stress(matrix(p))
        size = sp.sqrt(sp.Rational(3, 2) * (now * now).trace())
        change = [
            p[k] - old[k] - dg * sp.Rational(3, 2) * now[i, j] / size
            for k, (i, j) in enumerate(pairs)
        ]
        return [*change, (size - limit(old[6] + dg)) / G]

    start = [*old[:6], sp.Rational(1, 1000)]
    s = m.implicit("s", flow, start=start, tolerance=1e-9, size=1e-6)
    yields = q > limit(old[6])
    p = matrix([sp.Piecewise((s[k], yields), (old[k], True)) for k in range(6)])
    total = m.define("sigma", stress(p) + K * strain.trace() * sp.eye(3))
    m.weak_form([((1 if i == j else 2) * total[i, j] * e.detJ, strain[i, j]) for i, j in pairs])
    m.offer(tasks=["residual", "tangent"])
    m.example(G=80, K=160, sy=2, H=1, more=1, rate=20, alpha=0.01,
              **{f"p_{i}{j}": 0 for i, j in pairs})  # fmt: skip
    return m.finish()


def maxwell() -> Definition:
    """One local unknown: a dashpot with Norton's law, 3-D bar of 2 nodes."""
    m = Model("maxwell", nodes=2, rule=quadrature.gauss(1, 1), unroll=True)
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    E_0, E_1, A, dt = m.parameters(E_0="spring", E_1="spring in series", A="Norton", dt="step")
    (v_old,) = m.point_data(v_old="viscous strain before")
    length = m.define("length", X[1] - X[0])
    e = m.define("e", (u[1] - u[0]) / length)
    v = m.implicit("v", lambda v: v - v_old - dt * A * (E_1 * (e - v)) ** 3, start=v_old)
    s = m.define("s", E_1 * (e - v))
    m.weak_form([((E_0 * e + s) * length / 2, e)])
    m.offer(tasks=["residual", "tangent"])
    return m.finish()


def film() -> Definition:
    return ALL["film"]()


def contact() -> Definition:
    return ALL["contact"]()


def solid_q4() -> Definition:
    return ALL["solid_q4"]()


def solid_fbar() -> Definition:
    return ALL["solid_fbar"]()


MODELS = {
    f.__name__: f
    for f in (
        solid_q4,
        solid_fbar,
        q4_smooth,
        q4_branch,
        quad9,
        hex8,
        hex27,
        film,
        j2_hex8,
        maxwell,
        contact,
    )
}
