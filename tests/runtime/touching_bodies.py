"""Bodies that touch, for tests: an elastic page, and meshes of discs, half-spaces and gaskets."""

from __future__ import annotations

import numpy as np
import sympy as sp

import softehl
from softehl import Mesh
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result


@softehl.page
def elastic(m):  # type: ignore[no-untyped-def]
    """Compressible neo-Hooke, isochoric and volumetric part."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() * J ** sp.Rational(-2, 3) - 3) + K / 2 * (J - 1) ** 2)
    m.fields(J=J)


def graded(s: Array, rate: float, even: float = 0.25) -> Array:
    """[-1, 1] to itself: even about zero, then steps that grow."""
    near, far = np.minimum(np.abs(s), even), np.maximum(np.abs(s) - even, 0.0)
    end = even + np.expm1(rate * (1 - even)) / rate
    return np.asarray(np.sign(s) * (near + np.expm1(rate * far) / rate) / end)


def lower_disc(n: int, radius: float, order: int, *, rate: float = 7.0) -> Mesh:
    """The lower half of a disc on (0, 0), without its core; sides "bottom" and "top" (inside)."""

    def move(x: Array) -> Array:
        angle = np.pi / 2 * (graded(x[:, 0] - 1, rate) if rate else x[:, 0] - 1)
        inwards = np.expm1(5 * x[:, 1]) / np.expm1(5) if rate else x[:, 1]
        r = radius * (1 - 0.7 * inwards)
        return np.stack([r * np.sin(angle), radius - r * np.cos(angle)], axis=1)

    return Mesh.rectangle(2, 1, cells=(2 * n, n if rate else n // 4), order=order).map(move)


def half_space(n: int, size: float, order: int) -> Mesh:
    """[-size, size] x [-size, 0], fine about (0, 0)."""

    def move(x: Array) -> Array:
        down = np.expm1(5 * (1 - x[:, 1])) / np.expm1(5)
        return size * np.stack([graded(x[:, 0] - 1, 9.0), -down], axis=1)

    return Mesh.rectangle(2, 1, cells=(2 * n, n), order=order).map(move)


def gasket(k: int, order: int) -> Mesh:
    """An X of four arms 1 long and 0.5 wide; sides "upper" and "lower", the ends of the arms."""
    square = Mesh.rectangle(2.5, 2.5, cells=(5 * k, 5 * k), order=order).map(lambda x: x - 1.25)
    ((kind, cells),) = square.cells.items()
    kept = cells[(np.abs(square.points[cells].mean(axis=1)) < 0.25).any(axis=1)]
    used, nodes = np.unique(kept, return_inverse=True)
    mesh = Mesh(square.points[used], {kind: nodes.reshape(kept.shape)})
    half = np.sqrt(0.5)
    mesh = mesh.map(lambda x: x @ np.array([[half, half], [-half, half]]))
    end = 1.25 / half - 1e-9
    mesh = mesh.with_side("upper", lambda x: np.abs(x[:, 0]) + x[:, 1] > end)
    mesh = mesh.with_side("lower", lambda x: np.abs(x[:, 0]) - x[:, 1] > end)
    return mesh


def extruded(flat: Mesh, length: float) -> Mesh:
    """Quadrilaterals in the plane as one layer of hexahedra, with their sides; "skin" is what the
    boundary in the plane becomes.
    """
    n, quads = len(flat.points), flat.cells["quad4"]
    points = np.concatenate([np.column_stack([flat.points, np.full(n, z)]) for z in (0, length)])
    lines = {name: faces["line2"] for name, faces in flat.sides.items()}
    lines["skin"] = flat.boundary["line2"]
    sides = {k: {"quad4": np.column_stack([v, v[:, ::-1] + n])} for k, v in lines.items()}
    return Mesh(points, {"hex8": np.column_stack([quads, quads + n])}, sides=sides)


def force(result: Result) -> float:
    """Integral of the pressure of a contact."""
    found = result.fields("contact")
    return float((found["pressure"] * found["area"]).sum())
