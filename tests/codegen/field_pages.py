"""Pages of fields for tests: each has something that the others do not."""

from __future__ import annotations

import sympy as sp

import softehl
from softehl.codegen.language.fields import Fields


@softehl.page
def rubber(m: Fields) -> None:
    """Gradients only."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)
    m.fields(J=J)


@softehl.page
def mixed(m: Fields) -> None:
    """Fields of two orders, the lower one first; values and gradients."""
    p, u, T = m.scalar("p", order=1), m.vector("u"), m.scalar("T")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    g = m.grad(T)
    m.minimise(mu / 2 * (F.T * F).trace() ** 2 + p * (J - 1) - p**2 / (2 * K))
    m.minimise(T**2 * J + g.dot(g) * (1 + p * T))
    m.fields(J=J, pressure=p)
    m.offer(product=True, pseudo_load=True, fields_rate=True, derivatives=[mu])


@softehl.page
def constant_pressure(m: Fields) -> None:
    """A pressure of every cell, declared first."""
    p, u = m.scalar("p", order=0), m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * K))
    m.fields(pressure=p)
    m.offer(product=True, pseudo_load=True, fields_rate=True, derivatives=[K])


@softehl.page
def heat(m: Fields) -> None:
    """Weak forms without symmetry, rates, data of elements and the place of the point."""
    T = m.scalar("T")
    k, c = m.parameters(k="conductivity", c="heat capacity")
    (q,) = m.data(q="source")
    flux = k * (1 + T**2 + m.position[0]) * m.grad(T)
    m.weak(flux, m.grad(T))
    m.weak(c * (1 + T) * m.rate(T) - q * m.position[1], T)
    m.fields(flux=flux[0], rate_of_T=m.rate(T), slope_of_rate=m.grad(m.rate(T))[1])
    m.offer(product=True, pseudo_load=True, fields_rate=True, derivatives=[k, q])


@softehl.page
def creep(m: Fields) -> None:
    """Local unknowns, history and the field of the step before."""
    u = m.vector("u")
    G, A, eta = m.parameters(G="modulus", A="rate of creep", eta="viscosity")
    v_old, w_old = m.point_data(v_old="strain", w_old="strain")
    F, F_old = m.deformation_gradient(u), m.deformation_gradient(m.previous(u), "F_old")
    C = m.define("C", F.T * F)

    def flow(s: list[sp.Symbol]) -> list[sp.Expr]:
        v, w = s
        return [v - v_old - A * (C[0, 0] - 1 - v) ** 3 - w / 10, w - w_old - A * (C[0, 1] - w) ** 3]

    v, w = m.implicit("v", flow, start=[v_old, w_old])
    m.minimise(G * C.trace() ** 2)
    m.weak(G * (C[0, 0] - 1 - v), C[0, 0])
    m.weak(G * (C[0, 1] - w), C[0, 1])
    m.weak(eta * (F - F_old), F)
    m.history(v_old=v, w_old=w)
    m.fields(v=v)
    m.offer(product=True, pseudo_load=True, fields_rate=True, derivatives=[G])


@softehl.page
def fbar(m: Fields) -> None:
    """F-bar after de Souza Neto et al., 1996: J is that of the centroid; history at the point."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    (J_old,) = m.point_data(J_old="volume ratio of the step before")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    J0 = m.centroid(J)
    a = m.define("a", (J0 / J) ** sp.Rational(1, 3))
    pressure = K * (J0 - 1) + mu * (J - J_old)
    m.weak((F - F.adjugate().T / J / a**2) * mu / a + pressure * F.adjugate().T, F)
    m.history(J_old=J)
    m.fields(J0=J0)
    m.offer(product=True, pseudo_load=True, fields_rate=True, derivatives=[mu])
