"""Bar with two nodes at large displacements and strains, in space.

Cells: line2
Source: Bonet and Wood (2008), Nonlinear Continuum Mechanics, chapter 3.
Benchmark: snap-through of the shallow truss of von Mises, limit load.
"""

import sympy as sp

from softehl import Definition, Model, quadrature


def truss() -> Definition:
    """Logarithmic strain, Kirchhoff stress E ln(stretch), volume kept."""
    m = Model("truss", nodes=2, rule=quadrature.point_rule(), doc="Bar with logarithmic strain.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    E, A = m.parameters(E="Young's modulus [MPa]", A="area of the undeformed bar [mm2]")
    m.require(E > 0, A > 0)
    across = [x[1] - x[0] for x in X]
    along = [d + v[1] - v[0] for d, v in zip(across, u, strict=True)]
    length = m.define("length", m.norm(across))
    stretch = m.define("stretch", m.norm(along) / length)
    m.potential(E * A * length / 2 * sp.log(stretch) ** 2)
    m.fields(stretch=stretch, force=E * A * sp.log(stretch) / stretch)
    return m.finish()
