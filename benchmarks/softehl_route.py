"""Our own candidates: the page that ships, and the formula as printed without any hint.

| route           | what it is                                                              |
|-----------------|-------------------------------------------------------------------------|
| shipped page    | the kernel of `generated/`: everybody's ratio is to this one            |
| printed formula | (3)-(6) as they stand, no named intermediate, no hint of the author     |
| one lane        | the shipped page with one element at a time, as the peers compute       |
"""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy.core.cache import clear_cache

from benchmarks.candidate import ENTRY, Candidate, Stopwatch
from benchmarks.problem import Case
from softehl.codegen import abi, pipeline
from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.emit import c_source
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import solid
from softehl.codegen.tools import build

SHIPPED = "shipped page"


def derive(case: Case, route: str) -> Candidate:
    """From a page of mathematics to C."""
    page = (printed_fbar if case.fbar else printed) if route == "printed formula" else None
    page = page or (solid.fbar if case.fbar else solid.plain)
    task = abi.Task.TANGENT if case.tangent else abi.Task.RESIDUAL
    clear_cache()
    watch = Stopwatch()
    definition = page()
    function = pipeline.compile_task(definition, task)
    name = definition.name
    header = c_source.header([abi.function_name(name, task)])
    text = c_source.source(definition, [function.text])
    seconds = watch.seconds()
    if route == "one lane":
        header = header.replace("#define SOFTEHL_LANES 4", "#define SOFTEHL_LANES 1")
    files = {f"{name}.c": text, c_source.HEADER: header, "entry.c": _entry(name, task)}
    flags = tuple(f for f in build.FLAGS if f not in ("-fPIC", "-shared"))
    return Candidate("softehl", route, case, seconds, files, own_flags=flags)


def _entry(name: str, task: abi.Task) -> str:
    """The batched kernel is called once for all elements; what it does not use is NULL."""
    given = {"n": "n", "points": "4", "coordinates": "X", "dofs": "u", "parameters": "p"}
    given |= {"values": "values", "tangent": "tangent"}
    names = [a.split()[-1].strip("*") for a in " ".join(abi.ARGUMENTS).split(",")]
    arguments = ", ".join(given.get(n, "0") for n in names)
    call = f"    {abi.function_name(name, task)}({arguments});"
    return f'#include "{c_source.HEADER}"\n\n{ENTRY}\n{{\n{call}\n}}\n'


# The formula as the paper prints it: no named intermediate, no interface, nothing rearranged.


def printed() -> Definition:
    """Pi = integral of W(F) 2 pi R dA with (3)-(6) written down as they stand."""
    m, X, u, material, xi, eta = _element("printed_q4")
    F, volume = _gradient(X, u, xi, eta)
    m.potential(m.integral("Pi", volume * _energy(F, material)))
    return m.finish()


def printed_fbar() -> Definition:
    """The formula with Fbar = a F; a has a name because the variation leaves it alone."""
    m, X, u, material, xi, eta = _element("printed_fbar")
    F, volume = _gradient(X, u, xi, eta)
    F0, _ = _gradient(X, u, sp.Integer(0), sp.Integer(0))
    a = m.define("a", (_det(F0) / _det(F)) ** sp.Rational(1, 3))
    m.potential(m.integral("Pi", volume * _energy(a * F, material) / a**3), constant=[a])
    return m.finish()


def _element(name: str) -> tuple[Model, Any, Any, Any, Any, Any]:
    rule = quadrature.gauss(2, 2)
    m = Model(name, nodes=4, rule=rule, unroll=True, doc="The formula as printed.")
    X, u = m.coordinates("Z", "R"), m.nodal_unknowns("u_z", "u_r")
    material = m.parameters(mu_1="[MPa]", mu_2="[MPa]", kappa="[MPa]")
    xi, eta = m.point()
    return m, X, u, material, xi, eta


def _gradient(X: Any, u: Any, xi: Any, eta: Any) -> tuple[Any, Any]:
    """F (3, 3) in (z, r, theta) and 2 pi R det(dX/dxi)."""
    N, parent = shapes.quad4(xi, eta), sp.Matrix(shapes.quad4_gradient(xi, eta))
    (a, b), (c, d) = (sp.Matrix(X) * parent).tolist()
    area = a * d - b * c
    grad = sp.Matrix(u) * parent * sp.Matrix([[d, -b], [-c, a]]) / area
    R = shapes.interpolate(N, X[1])
    hoop = 1 + shapes.interpolate(N, u[1]) / R
    return sp.diag(sp.eye(2) + grad, hoop), 2 * sp.pi * R * area


def _det(F: Any) -> Any:
    """Volume ratio; SymPy's own `det` multiplies everything out and does not come back."""
    return (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) * F[2, 2]


def _energy(F: Any, material: Any) -> Any:
    """W of (3)-(6)."""
    mu_1, mu_2, kappa = material
    B = F * F.T
    I3 = _det(F) ** 2
    I1, I2 = B.trace(), (B.trace() ** 2 - (B * B).trace()) / 2
    third = sp.Rational(1, 3)
    isochoric = mu_1 * (I3**-third * I1 - 3) / 2 + mu_2 * (I3 ** (-2 * third) * I2 - 3) / 2
    return isochoric + kappa * ((I3 - 1) / 2 - sp.log(I3) / 2) / 2
