"""Large pages whose build is timed: shells, plates, three fields, series, inverses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

import softehl
from softehl.codegen.elements import quadrature
from softehl.codegen.elements.cells import element
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.models.material_elements import law


def solid(cell: str) -> Callable[[], Definition]:
    """Neo-Hooke by name on a cell."""
    return lambda: law("neo_hooke").page().definition(cell)


def _rotated(r: Any, d: Any) -> sp.Matrix:
    """Rotate d by the vector r (Rodrigues), by series to r^8."""
    q = (r.T * r)[0]
    sinc = 1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72)))
    cosc = sp.Rational(1, 2) * (1 - q / 12 * (1 - q / 30 * (1 - q / 56 * (1 - q / 90))))
    once = r.cross(d)
    return d + sinc * once + cosc * r.cross(once)


def mitc4(*, finite: bool = True) -> Definition:
    """Shell of 24 unknowns after Dvorkin and Bathe, 1984: shear strains tied at mid-sides.

    Directors turn by a rotation vector, about their first place; strains are Green's in the
    covariant basis, linear in zeta, in plane stress.
    """
    name = "mitc4" if finite else "mitc4_linear"
    m = Model(name, nodes=4, rule=quadrature.gauss(2, 3), doc=mitc4.__doc__ or "")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z", "r_x", "r_y", "r_z")
    D = m.nodal_data("D_x", "D_y", "D_z", meaning="director")
    mu, lame, thickness, drill = m.parameters(
        mu="shear modulus", lame="first Lame parameter", thickness="[mm]", drill="of drilling"
    )
    xi, eta, zeta = m.point()
    old = [sp.Matrix([X[i][a] for i in range(3)]) for a in range(4)]
    directors = [sp.Matrix([D[i][a] for i in range(3)]) for a in range(4)]
    turns = [sp.Matrix([u[i][a] for i in range(3, 6)]) for a in range(4)]
    moved = [sp.Matrix([u[i][a] for i in range(3)]) for a in range(4)]
    if finite:
        new = [
            m.define(f"d{a}", _rotated(r, d))
            for a, (r, d) in enumerate(zip(turns, directors, strict=True))
        ]
        changes = [n - d for n, d in zip(new, directors, strict=True)]
    else:
        changes = [r.cross(d) for r, d in zip(turns, directors, strict=True)]
    cell = element("quad4")

    def basis(at: Any, middles: Any, ends: Any) -> list[Any]:
        """Covariant vectors of the places of mid-surface and directors."""
        N, dN, half = cell.shape(*at[:2]), cell.gradient(*at[:2]), thickness / 2
        nodes = [p + at[2] * half * d for p, d in zip(middles, ends, strict=True)]
        along = [
            sum((slope[k] * p for slope, p in zip(dN, nodes, strict=True)), sp.zeros(3, 1))
            for k in (0, 1)
        ]
        across = sum((n * half * d for n, d in zip(N, ends, strict=True)), sp.zeros(3, 1))
        return [*along, across]

    def strain(name: str, at: Any, i: int, j: int) -> Any:
        G, g = basis(at, old, directors), basis(at, moved, changes)
        linear = (G[i].dot(g[j]) + G[j].dot(g[i])) / 2
        return m.define(name, linear + g[i].dot(g[j]) / 2 if finite else linear)

    half = sp.Rational(1, 2)
    top, bottom = strain("E13_t", (0, 1, zeta), 0, 2), strain("E13_b", (0, -1, zeta), 0, 2)
    right, left = strain("E23_r", (1, 0, zeta), 1, 2), strain("E23_l", (-1, 0, zeta), 1, 2)
    E13 = m.define("E13", half * ((1 + eta) * top + (1 - eta) * bottom))
    E23 = m.define("E23", half * ((1 + xi) * right + (1 - xi) * left))
    at = (xi, eta, zeta)
    E11, E22, E12 = (strain(f"E{i + 1}{j + 1}", at, i, j) for i, j in ((0, 0), (1, 1), (0, 1)))
    E = [[E11, E12, E13], [E12, E22, E23], [E13, E23, 0]]
    G = m.define("G", sp.Matrix.hstack(*basis(at, old, directors)))
    inverse = m.define("G_inv", G.inv())
    metric = m.define("metric", inverse * inverse.T)
    mixed = m.define("mixed", sp.Matrix(E) * metric)
    reduced = 2 * mu * lame / (lame + 2 * mu)
    energy = reduced / 2 * mixed.trace() ** 2 + mu * (mixed * mixed).trace()
    m.potential(m.integral("Pi", energy * m.define("detG", G.det())))
    m.potential(drill / 2 * sum(r.dot(d) ** 2 for r, d in zip(turns, directors, strict=True)))
    m.example(**{f"D_z{a}": 1 for a in (1, 2, 3, 4)})
    return m.finish()


def _bernstein(t: Any) -> list[list[Any]]:
    """Cubic Bernstein polynomials on [-1, 1], with first and second derivatives."""
    s = (1 + t) / 2
    values = [(1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3]
    first = [-3 * (1 - s) ** 2, 3 * (1 - s) * (1 - 3 * s), 3 * s * (2 - 3 * s), 3 * s**2]
    second = [6 * (1 - s), 18 * s - 12, 6 - 18 * s, 6 * s]
    return [values, [d / 2 for d in first], [d / 4 for d in second]]


def _bicubic(xi: Any, eta: Any) -> Callable[[int, int], list[Any]]:
    """Derivatives (i, j) of the 16 functions of a Bezier cell."""
    along, across = _bernstein(xi), _bernstein(eta)
    return lambda i, j: [a * b for b in across[j] for a in along[i]]


def iga_plate() -> Definition:
    """Kirchhoff's plate on a bicubic Bezier cell: 16 deflections, an exact map with curvature."""
    m = Model("iga_plate", nodes=16, rule=quadrature.gauss(4, 2), doc=iga_plate.__doc__ or "")
    X = m.coordinates("X", "Y")
    (w,) = m.nodal_unknowns("w")
    E, nu, t, load = m.parameters(
        E="Young's modulus", nu="Poisson's ratio", t="thickness", load="pressure"
    )
    N = _bicubic(*m.point())

    def field(name: str, values: Any, i: int, j: int) -> Any:
        return m.define(name, sum(n * v for n, v in zip(N(i, j), values, strict=True)))

    first, second = ((1, 0), (0, 1)), ((2, 0), (1, 1), (0, 2))
    J = sp.Matrix(2, 2, lambda r, c: field(f"{'xy'[r]}_{c}", X[r], *first[c]))
    detJ = m.define("detJ", J.det())
    back = m.define("back", J.adjugate() / detJ)
    slope = m.define("slope", back.T * sp.Matrix([field(f"w_{c}", w, *first[c]) for c in (0, 1)]))
    bent = [
        m.define(
            f"bent{k}",
            field(f"w_2{k}", w, *ij)
            - slope[0] * field(f"x_2{k}", X[0], *ij)
            - slope[1] * field(f"y_2{k}", X[1], *ij),
        )
        for k, ij in enumerate(second)
    ]
    kappa = m.define("kappa", back.T * sp.Matrix([[bent[0], bent[1]], [bent[1], bent[2]]]) * back)
    D = m.define("D", E * t**3 / (12 * (1 - nu**2)))
    energy = D / 2 * (kappa.trace() ** 2 - 2 * (1 - nu) * kappa.det())
    m.potential(m.integral("Pi", (energy - load * field("deflection", w, 0, 0)) * detJ))
    m.fields(kappa_xx=kappa[0, 0], kappa_yy=kappa[1, 1])
    m.example(**{f"{x}{4 * j + i + 1}": v / 3.0 for j in range(4) for i in range(4)
                 for x, v in (("X", i), ("Y", j))}, nu=0.3)  # fmt: skip
    return m.finish()


def iga_shell() -> Definition:
    """Kirchhoff and Love's shell on a bicubic Bezier cell (Kiendl et al., 2009): 48 unknowns."""
    m = Model("iga_shell", nodes=16, rule=quadrature.gauss(4, 2), doc=iga_shell.__doc__ or "")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    E, nu, t = m.parameters(E="Young's modulus", nu="Poisson's ratio", t="thickness")
    N = _bicubic(*m.point())

    def vector(name: str, values: Any, i: int, j: int) -> Any:
        shape = N(i, j)
        return m.define(
            name, sp.Matrix([sum(n * v for n, v in zip(shape, c, strict=True)) for c in values])
        )

    def surface(name: str, values: Any) -> tuple[list[Any], list[Any], Any]:
        """Two tangents, three second derivatives."""
        tangents = [vector(f"{name}{k}", values, *ij) for k, ij in enumerate(((1, 0), (0, 1)))]
        orders = ((2, 0), (0, 2), (1, 1))
        second = [vector(f"{name}_2{k}", values, *ij) for k, ij in enumerate(orders)]
        return tangents, second, m.define(f"{name}_n", tangents[0].cross(tangents[1]))

    pairs = ((0, 0), (1, 1), (0, 1))
    A, AA, normal = surface("A", X)
    H, HH, _ = surface("H", u)
    a = [m.define(f"a{k}", p + q) for k, (p, q) in enumerate(zip(A, H, strict=True))]
    aa = [m.define(f"aa{k}", p + q) for k, (p, q) in enumerate(zip(AA, HH, strict=True))]
    n = m.define("n", a[0].cross(a[1]))
    area, now = m.define("area", m.norm(normal)), m.define("now", m.norm(n))
    membrane = [
        m.define(f"e{k}", (A[i].dot(H[j]) + A[j].dot(H[i]) + H[i].dot(H[j])) / 2)
        for k, (i, j) in enumerate(pairs)
    ]
    bending = [m.define(f"k{k}", AA[k].dot(normal) / area - aa[k].dot(n) / now) for k in range(3)]
    metric = sp.Matrix(2, 2, lambda i, j: A[i].dot(A[j]))
    metric = m.define("metric", metric)
    back = m.define("back", metric.adjugate() / metric.det())

    def energy(name: str, e: Any) -> Any:
        mixed = m.define(name, sp.Matrix([[e[0], e[2]], [e[2], e[1]]]) * back)
        return nu * mixed.trace() ** 2 + (1 - nu) * (mixed * mixed).trace()

    C = E * t / (2 * (1 - nu**2))
    m.potential(
        m.integral("Pi", C * (energy("m", membrane) + t**2 / 12 * energy("b", bending)) * area)
    )
    m.example(**{f"{x}{4 * j + i + 1}": v / 3.0 for j in range(4) for i in range(4)
                 for x, v in (("X", i), ("Y", j), ("Z", 0))}, nu=0.3)  # fmt: skip
    return m.finish()


@softehl.page
def exponential(m: Fields) -> None:
    """Energy mu tr exp(2 e) + lame / 2 (tr e)^2, the exponential by 12 terms of its series."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    F = m.deformation_gradient(u)
    A = m.define("A", F + F.T - 2 * sp.eye(3))
    total, power = sp.eye(3) + A, A
    for k in range(2, 13):
        power = power * A / k
        total += power
    m.minimise(mu / 2 * (total.trace() - 3 - A.trace()) + lame / 8 * A.trace() ** 2)


@softehl.page
def exponential_by_names(m: Fields) -> None:
    """Exponential with a name for each term."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    F = m.deformation_gradient(u)
    A = m.define("A", F + F.T - 2 * sp.eye(3))
    total, power = sp.eye(3) + A, A
    for k in range(2, 13):
        power = m.define(f"P{k}", power * A / k)
        total += power
    m.minimise(mu / 2 * (total.trace() - 3 - A.trace()) + lame / 8 * A.trace() ** 2)


@softehl.page
def inverse(m: Fields) -> None:
    """Neo-Hooke by its stress with F.inv()."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    F = m.deformation_gradient(u)
    back = F.inv().T
    m.weak(mu * (F - back) + lame * sp.log(F.det()) * back, F)


@softehl.page
def adjugate(m: Fields) -> None:
    """Inverse with names, by the adjugate over the determinant."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    back = m.define("back", (F.adjugate() / J).T)
    m.weak(mu * (F - back) + lame * sp.log(J) * back, F)


def on_hex8(page: Any) -> Callable[[], Definition]:
    """A page on hex8."""
    return lambda: page.definition("hex8")


@softehl.page
def thermo(m: Fields) -> None:
    """Displacement, pressure, temperature: rubber that swells and heats."""
    u, p, T = m.vector("u"), m.scalar("p"), m.scalar("T")
    mu, K, a, k, c, T0 = m.parameters(
        mu="shear modulus", K="bulk modulus", a="expansion", k="conductivity", c="capacity",
        T0="reference",
    )  # fmt: skip
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = m.define("I1", (F.T * F).trace())
    theta = m.define("theta", T / T0)
    W = mu / 2 * theta * (I1 * J ** sp.Rational(-2, 3) - 3)
    free = p * (J - 1 - a * (T - T0)) - p**2 / (2 * K)
    m.minimise(W + free)
    C_inverse = m.define("Ci", (F.T * F).inv())
    m.weak(k * J * C_inverse * m.grad(T), m.grad(T))
    m.weak(c * m.rate(T) + a * p * J * m.rate(T), T)


@softehl.page
def poroelastic(m: Fields) -> None:
    """Displacement, pore pressure, phase field with a split, by small strains and a rate."""
    u, p, d = m.vector("u"), m.scalar("p"), m.scalar("d")
    mu, lame, k, b, Gc, ell = m.parameters(
        mu="shear modulus", lame="first Lame parameter", k="permeability", b="of Biot",
        Gc="toughness", ell="length",
    )  # fmt: skip
    H = m.grad(u)
    e = m.define("e", (H + H.T) / 2)
    tr = m.define("tr", e.trace())
    g = m.define("g", (1 - d) ** 2 + sp.Rational(1, 1000))
    dev = m.define("dev", e - sp.eye(3) * tr / 3)
    bulk = lame + 2 * mu / 3
    opened = bulk / 2 * sp.Max(tr, 0) ** 2 + mu * (dev * dev).trace()
    closed = bulk / 2 * sp.Max(-tr, 0) ** 2
    slope = m.grad(d)
    m.minimise(g * opened + closed + Gc / 2 * (d**2 / ell + ell * (slope.T * slope)[0]))
    m.minimise(-b * p * tr)
    m.weak(k * (1 + 1000 * sp.Max(tr, 0) ** 3) * m.grad(p), m.grad(p))
    m.weak(b * m.rate(u).T * sp.Matrix([1, 1, 1]), sp.Matrix([p]))


@softehl.page
def electro(m: Fields) -> None:
    """Displacement, potential, concentration: a dielectric gel."""
    u, f, c = m.vector("u"), m.scalar("phi"), m.scalar("c")
    mu, eps, chi, k, V = m.parameters(
        mu="shear modulus", eps="permittivity", chi="of mixing", k="mobility", V="molar volume"
    )
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    field = m.define("E", F.inv().T * m.grad(f))
    I1 = (F.T * F).trace()
    swollen = m.define("swollen", 1 + V * c)
    m.minimise(mu / 2 * (I1 - 3 - 2 * sp.log(J)) - eps / 2 * J * (field.T * field)[0])
    m.minimise(10 * mu / 2 * (J - swollen) ** 2)
    mixing = sp.log(1 - 1 / swollen) + 1 / swollen + chi / swollen**2
    C_inverse = (F.T * F).inv()
    m.weak(k * c * J * C_inverse * m.grad(c) * (1 + mixing**2), m.grad(c))
    m.weak(m.rate(c), c)


PAGES: dict[str, tuple[Callable[[], Definition], float]] = {
    "hex64": (solid("hex64"), 3),
    "hex125": (solid("hex125"), 6),
    "mitc4": (mitc4, 8),
    "mitc4_linear": (lambda: mitc4(finite=False), 8),
    "iga_plate": (iga_plate, 8),
    "iga_shell": (iga_shell, 20),
    "thermo": (on_hex8(thermo), 20),
    "poroelastic": (on_hex8(poroelastic), 20),
    "electro": (on_hex8(electro), 20),
    "exponential": (on_hex8(exponential), 4),
    "exponential_by_names": (on_hex8(exponential_by_names), 4),
    "inverse": (on_hex8(inverse), 4),
    "adjugate": (on_hex8(adjugate), 4),
}
"""Pages by name, and the seconds in which they should be built."""
