"""Kinematics of solids: any dimension first, then the axisymmetric ones of the paper, (3)-(6).

Axisymmetric coordinates are ordered (axial, radial) = (z, r); the deformation gradient of an
axisymmetric motion is a 2x2 block and the hoop stretch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.elements import cells, shapes
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import CheckedList
from softehl.codegen.language.model import Model


@dataclass(frozen=True)
class Isoparametric:
    """Geometry at a point: gradients of the shape functions, and the Jacobian.

    Attributes
    ----------
    dN : list of list of Expr
        Gradients by the reference coordinates, [node][component].
    detJ : Expr
        Determinant of the Jacobian.
    inverse : Matrix
        Inverse of the Jacobian, (coordinate of the cell, reference coordinate).
    matrix : Matrix
        The Jacobian.
    """

    dN: list[list[Any]]
    detJ: Any
    inverse: Any
    matrix: Any


def isoparametric(m: Model, X: Any, parent: Any, label: str = "") -> Isoparametric:
    """Return the geometry at the point, in one, two or three dimensions.

    Parameters
    ----------
    m : Model
        The model.
    X : list of list of Symbol
        Reference coordinates, [component][node].
    parent : list of tuple of Expr
        Gradients of the shape functions in the cell, such as
        `element("hex8").gradient(*m.point())`.
    label : str
        Begins the names dX, detJ, dX_inverse and dN, for models that use these names.

    Returns
    -------
    Isoparametric
        Gradients and Jacobian.

    Raises
    ------
    ModelError
        The gradients or the rule belong to another cell.
    """
    size = len(X)
    _require_parent(m, size, parent)
    J = sp.Matrix(size, size, lambda i, k: shapes.interpolate([g[k] for g in parent], X[i]))
    J = m.define(f"{label}dX", J)
    detJ = m.define(f"{label}detJ", J.det(method="berkowitz"))
    inverse = m.define(f"{label}dX_inverse", J.adjugate() / detJ)
    m.measure(detJ, inverse)
    dN = [list(sp.Matrix([list(g)]) * inverse) for g in parent]
    gradients = [
        [m.define(f"{label}dN_{a}{k}", v) for k, v in enumerate(row)] for a, row in enumerate(dN)
    ]
    rows = (
        CheckedList(row, f"dN[{a}], the gradient of a shape function")
        for a, row in enumerate(gradients)
    )
    return Isoparametric(CheckedList(rows, "dN, one row for each node"), detJ, inverse, J)


def _require_parent(m: Model, size: int, parent: Any) -> None:
    """Refuse gradients of other cells, and a rule that does not fit the cell they are of."""
    widths = {len(row) for row in parent}
    if len(parent) != m.nodes or widths != {size}:
        raise ModelError(
            f"isoparametric: gradients of {len(parent)} shape functions by "
            f"{', '.join(map(str, sorted(widths)))} coordinates, but {m.name} has {m.nodes} nodes "
            f"and {size} coordinates"
        )
    match = cells.of(m.nodes, m.rule.dimension)
    if match is None or match.cell.fits(m.rule):
        return
    sample = {s: sp.Rational(1, 7 + 2 * k) for k, s in enumerate(m.point())}
    values = [sp.sympify(g).subs(sample) for row in parent for g in row]
    if values == [g for row in match.gradient(*sample.values()) for g in row]:
        raise ModelError(
            f"{m.name} has shape functions of {match.name}, but {cells.misfit(match.cell)}"
        )


def deformation_gradient(m: Model, dN: Any, u: Any) -> Any:
    """Return F = 1 + Grad u, with the names F_00, F_01, ...

    Parameters
    ----------
    m : Model
        The model.
    dN : list of list of Expr
        Gradients of the shape functions, [node][component].
    u : list of list of Symbol
        Displacements, [component][node].

    Returns
    -------
    Matrix
        (dim, dim).

    Raises
    ------
    ModelError
        Displacements and gradients differ in dimension.
    """
    size = len(u)
    widths = {len(row) for row in dN}
    if widths != {size}:
        raise ModelError(
            f"deformation_gradient: {size} displacements, but gradients by "
            f"{', '.join(map(str, sorted(widths)))} coordinates; as many are needed"
        )
    F = sp.Matrix(
        size, size, lambda i, k: (1 if i == k else 0) + shapes.interpolate([g[k] for g in dN], u[i])
    )
    return m.define("F", F, interface=True)


@dataclass(frozen=True)
class Gradient:
    """Axisymmetric deformation gradient.

    Attributes
    ----------
    plane : Matrix
        Block (2, 2) of the section.
    hoop : Expr
        Hoop stretch.
    """

    plane: Any
    hoop: Any

    @property
    def J(self) -> Any:
        """Volume ratio det F."""
        F = self.plane
        return (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) * self.hoop

    def scaled(self, factor: Any) -> Gradient:
        """The gradient `factor` * F."""
        return Gradient(factor * self.plane, factor * self.hoop)


@dataclass(frozen=True)
class Quad4:
    """Geometry of the axisymmetric element of 4 nodes at a point.

    Attributes
    ----------
    N : list of Expr
        Shape functions.
    dN : list of tuple of Expr
        Their gradients by (Z, R).
    R : Expr
        Radius.
    dX : list of list of Expr
        Jacobian.
    detJ : Expr
        Its determinant.
    """

    N: list[Any]
    dN: list[tuple[Any, Any]]
    R: Any
    dX: list[list[Any]]
    detJ: Any


def quad4(m: Model, label: str, X: Any, xi: Any, eta: Any) -> Quad4:
    """Return the geometry of the axisymmetric element of 4 nodes at a point.

    Parameters
    ----------
    m : Model
        The model.
    label : str
        Part of the names of its values.
    X : list of list of Symbol
        Reference coordinates (Z, R), [component][node].
    xi : Expr
        First coordinate of the point in the cell.
    eta : Expr
        Second coordinate.

    Returns
    -------
    Quad4
        Shape functions, gradients, radius and Jacobian.
    """
    N = [m.define(f"N{label}_{a}", n) for a, n in enumerate(shapes.quad4(xi, eta))]
    parent = shapes.quad4_gradient(xi, eta)
    J = [[shapes.interpolate([g[k] for g in parent], x) for k in range(2)] for x in X]
    J = [[m.define(f"X{label}_{i}{k}", J[i][k]) for k in range(2)] for i in range(2)]
    detJ = m.define(f"detJ{label}", J[0][0] * J[1][1] - J[0][1] * J[1][0])
    dN = [
        (
            m.define(f"dN{label}_{a}z", (g[0] * J[1][1] - g[1] * J[1][0]) / detJ),
            m.define(f"dN{label}_{a}r", (g[1] * J[0][0] - g[0] * J[0][1]) / detJ),
        )
        for a, g in enumerate(parent)
    ]
    m.measure(detJ, [g for row in dN for g in row])
    radius = m.define(f"R{label}", shapes.interpolate(N, X[1]))
    return Quad4(N, dN, radius, J, detJ)


def gradient(
    m: Model, label: str, dN: Any, hoop_shape: Any, u: Any, *, interface: bool = True
) -> Gradient:
    """Return F = 1 + Grad u of an axisymmetric motion, with hoop stretch 1 + u_r / R.

    Parameters
    ----------
    m : Model
        The model.
    label : str
        Part of the names of its values.
    dN : list of tuple of Expr
        Gradients of the shape functions by (Z, R).
    hoop_shape : list of Expr
        N_a / R.
    u : list of list of Symbol
        Displacements, [component][node].
    interface : bool
        As in `Model.define`.

    Returns
    -------
    Gradient
        F.
    """
    F = sp.Matrix(
        2, 2, lambda i, k: (1 if i == k else 0) + shapes.interpolate([g[k] for g in dN], u[i])
    )
    hoop = 1 + shapes.interpolate(hoop_shape, u[1])
    return Gradient(
        m.define(f"F{label}", F, interface=interface),
        m.define(f"F{label}_t", hoop, interface=interface),
    )


def invariants(m: Model, label: str, F: Gradient) -> tuple[Any, Any, Any]:
    """Return the invariants of equations (4) and (5) of the paper.

    Parameters
    ----------
    m : Model
        The model.
    label : str
        Part of the names of their values.
    F : Gradient
        Deformation gradient.

    Returns
    -------
    tuple of Expr
        I1bar, I2bar, I3.
    """
    B = F.plane * F.plane.T
    b = [m.define(f"B{label}_{k}", v) for k, v in enumerate((B[0, 0], B[1, 1], B[0, 1]))]
    bt = m.define(f"B{label}_t", F.hoop**2)
    I3 = m.define(f"I3{label}", F.J**2)
    scale = m.define(f"I3{label}_cbrt_inverse", I3 ** sp.Rational(-1, 3))
    I1 = m.define(f"I1{label}", b[0] + b[1] + bt)
    trace_B2 = b[0] ** 2 + b[1] ** 2 + 2 * b[2] ** 2 + bt**2
    I2 = (I1**2 - trace_B2) / 2
    return scale * I1, scale**2 * I2, I3


def isochoric_right_cauchy_green(m: Model, label: str, F: Gradient) -> Any:
    """Return J^(-2/3) F^T F.

    Parameters
    ----------
    m : Model
        The model.
    label : str
        Part of the names of its values.
    F : Gradient
        Deformation gradient.

    Returns
    -------
    Matrix
        (3, 3); the squares of its principal stretches have the product 1.
    """
    scale = m.define(f"J{label}_to_minus_two_thirds", (F.J**2) ** sp.Rational(-1, 3))
    C = sp.diag(scale * (F.plane.T * F.plane), scale * F.hoop**2)
    return m.define(f"C{label}", C)


def cauchy(m: Model, W: Callable[[Gradient], Any], F: Gradient) -> tuple[Any, ...]:
    """Return the volume ratio and the Cauchy stress P F^T / J, P = dW/dF.

    Parameters
    ----------
    m : Model
        The model.
    W : callable
        Function of a Gradient that returns the energy.
    F : Gradient
        Deformation gradient.

    Returns
    -------
    tuple of Expr
        J, sigma_zz, sigma_rr, sigma_tt, sigma_zr.
    """
    plane, hoop = m.define("F_of_stress", F.plane), m.define("F_of_stress_t", F.hoop)
    F = Gradient(plane, hoop)
    *P, P_t = m.derivative("P", W(F), [*plane, hoop])
    tau = sp.Matrix(2, 2, P) * plane.T
    J = m.define("J_of_stress", F.J)
    return J, tau[0, 0] / J, tau[1, 1] / J, P_t * hoop / J, tau[0, 1] / J
