"""Solid shell: eight nodes, assumed shears and thickness strain, five enhanced strains.

Cells: hex8
Source: Klinkel, Gruttmann and Wagner (2006), CMAME 195, 179-201; Betsch and Stein (1995).
Benchmark: roof of Scordelis and Lo, pinched cylinder, bending, elastica.
"""

import itertools

import sympy as sp

from softehl import Definition, Model, quadrature, shapes


def solid_shell() -> Definition:
    """Energy of Saint Venant and Kirchhoff; zeta goes across the shell, from nodes 1-4 to 5-8.

    Shears are those of the middles of edges, the strain across that of corners, at zeta = 0.
    """
    m = Model("solid_shell", nodes=8, rule=quadrature.gauss(2, 3), doc="Solid shell.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    a = m.internal("a", 5)
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    q = m.parameters(q_x="load of a volume along x [N/mm3]", q_y="along y", q_z="along z")
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2))
    start = sp.Matrix(3, 8, lambda i, k: X[i][k])
    moved = sp.Matrix(3, 8, lambda i, k: u[i][k])
    xi, eta, zeta = m.point()

    def bases(name: str, *point: sp.Expr) -> tuple[sp.Matrix, sp.Matrix]:
        """Undeformed and deformed base vectors at a place of the parent cell."""
        gradients = sp.Matrix(shapes.hex8_gradient(*point))
        return m.define(f"G_{name}", start * gradients), m.define(
            f"g_{name}", (start + moved) * gradients
        )

    def strain(G: sp.Matrix, g: sp.Matrix, i: int, k: int) -> sp.Expr:
        return (g[:, i].dot(g[:, k]) - G[:, i].dot(G[:, k])) / 2

    G, g = bases("point", xi, eta, zeta)
    zero = sp.Integer(0)
    e = {(i, k): strain(G, g, i, k) for i, k in ((0, 0), (1, 1), (0, 1))}
    for axis, other in ((0, eta), (1, xi)):
        sides = []
        for s in (-1, 1):
            point = (zero, s, zero) if axis == 0 else (s, zero, zero)
            value = strain(*bases(f"{axis}{s + 1}", *point), axis, 2)
            sides.append((1 + s * other) / 2 * m.define(f"shear_{axis}{s + 1}", value))
        e[axis, 2] = sum(sides)
    across = []
    for s, r in itertools.product((-1, 1), repeat=2):
        value = strain(*bases(f"corner{s + 1}{r + 1}", s, r, zero), 2, 2)
        across.append((1 + s * xi) * (1 + r * eta) / 4 * m.define(f"a_{s + 1}{r + 1}", value))
    e[2, 2] = sum(across)
    middle = m.define("middle", start * sp.Matrix(shapes.hex8_gradient(zero, zero, zero)))
    detJ = m.define("detJ", G.det())
    m.measure(detJ, [])
    # enhanced strains in the axes of the middle
    added = sp.Matrix(
        [
            [a[0] * xi, a[2] * xi + a[3] * eta, 0],
            [a[2] * xi + a[3] * eta, a[1] * eta, 0],
            [0, 0, a[4] * zeta],
        ]
    )
    covariant = sp.Matrix(3, 3, lambda i, k: e[min(i, k), max(i, k)])
    inverse = m.define("inverse", G.adjugate() / detJ)
    centre = m.define("centre", middle.adjugate() / middle.det())
    green = inverse.T * covariant * inverse
    green += middle.det() / detJ * centre.T * added * centre
    green = m.define("green", green)
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    W = lame / 2 * green.trace() ** 2 + mu * (green * green).trace()
    displacement = moved * sp.Matrix(shapes.hex8(xi, eta, zeta))
    W -= sum(force * v for force, v in zip(q, displacement, strict=True))
    m.potential(m.integral("Pi", W * detJ))
    return m.finish()
