"""Shell with finite rotations of its director and assumed shears, four nodes (MITC4).

Cells: quad4
Source: Dvorkin and Bathe (1984), Engineering Computations 1, 77-88.
Benchmark: roof of Scordelis and Lo, pinched cylinder, hemisphere with a hole.
"""

import sympy as sp

from softehl import Definition, Model, quadrature, shapes


def shell_mitc4() -> Definition:
    """theta_1, theta_2 turn the director n about its axes a and n x a; n and a are nodal data."""
    m = Model("shell_mitc4", nodes=4, rule=quadrature.gauss(2, 2), doc="Shell, MITC4.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    angles = m.nodal_unknowns("theta_1", "theta_2")
    E, nu, t = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio", t="thickness [mm]")
    q = sp.Matrix(m.parameters(q_x="load of an area along x [MPa]", q_y="along y", q_z="along z"))
    m.require(E > 0, nu > -1, nu <= sp.Rational(1, 2), t > 0)
    n = m.nodal_data("n_x", "n_y", "n_z", meaning="normal of the shell")
    a = m.nodal_data("a_x", "a_y", "a_z", meaning="vector near axis 1")
    nodes = range(4)
    start = [sp.Matrix([c[k] for c in X]) for k in nodes]
    moved = [sp.Matrix([c[k] for c in u]) for k in nodes]
    normal = [m.define(f"n_{k}", (v := sp.Matrix([c[k] for c in n])) / m.norm(v)) for k in nodes]
    director = []
    for k in nodes:
        side = normal[k].cross(sp.Matrix([c[k] for c in a]))
        side = m.define(f"side_{k}", side / m.norm(side))
        turn = angles[0][k] * side.cross(normal[k]) + angles[1][k] * side
        size = m.define(f"angle_{k}", m.norm([angles[0][k], angles[1][k]]))
        bent = normal[k] * sp.cos(size) + turn.cross(normal[k]) * m.sinc(size)
        director.append(m.define(f"director_{k}", bent))
    now = [x + v for x, v in zip(start, moved, strict=True)]
    xi, eta = m.point()

    def mean(weights: list[sp.Expr], values: list[sp.Matrix]) -> sp.Matrix:
        return sum((w * v for w, v in zip(weights, values, strict=True)), sp.zeros(3, 1))

    D = shapes.quad4_gradient(xi, eta)
    gradients = [[g[i] for g in D] for i in (0, 1)]
    G = [m.define(f"G_{i}", mean(gradients[i], start)) for i in (0, 1)]
    g = [m.define(f"g_{i}", mean(gradients[i], now)) for i in (0, 1)]
    N_, d_ = ([mean(gradients[i], v) for i in (0, 1)] for v in (normal, director))
    # local axes: L is the Jacobian of the surface
    l1 = m.define("l1", m.norm(G[0]))
    e1 = m.define("e1", G[0] / l1)
    side = m.define("side", G[1] - e1 * e1.dot(G[1]))
    l2 = m.define("l2", m.norm(side))
    m.measure(l1 * l2, [])
    L = sp.Matrix([[l1, 0], [e1.dot(G[1]), l2]])
    inverse = m.define("inverse", L.inv())
    pairs = [[(i, k) for k in (0, 1)] for i in (0, 1)]
    membrane = sp.Matrix([[(g[i].dot(g[k]) - G[i].dot(G[k])) / 2 for i, k in r] for r in pairs])
    bending = sp.Matrix(
        [[(g[i].dot(d_[k]) + g[k].dot(d_[i]) - G[i].dot(N_[k]) - G[k].dot(N_[i])) / 2
          for i, k in r] for r in pairs])  # fmt: skip

    def shear(b: int, c: int) -> sp.Expr:
        """Covariant shear at the middle of the edge from node c to node b."""
        old = (start[b] - start[c]).dot(normal[b] + normal[c])
        return m.define(
            f"shear_{b}{c}", ((now[b] - now[c]).dot(director[b] + director[c]) - old) / 4
        )

    gamma = [(1 - eta) / 2 * shear(1, 0) + (1 + eta) / 2 * shear(2, 3)]
    gamma += [(1 - xi) / 2 * shear(3, 0) + (1 + xi) / 2 * shear(2, 1)]
    gamma = inverse * sp.Matrix(gamma)

    def plane(e: sp.Matrix) -> sp.Expr:
        e = inverse * e * inverse.T
        return E / (2 * (1 - nu**2)) * ((1 - nu) * (e * e).trace() + nu * e.trace() ** 2)

    W = t * plane(membrane) + t**3 / 12 * plane(bending)
    W += sp.Rational(5, 12) * E / (2 + 2 * nu) * t * gamma.dot(gamma)
    W -= q.dot(mean(shapes.quad4(xi, eta), moved))
    m.potential(m.integral("Pi", W * l1 * l2))
    return m.finish()
