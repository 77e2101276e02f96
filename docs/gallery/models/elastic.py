"""An elastic body at large strain."""

import softehl


@softehl.page
def elastic(m):
    """Neo-Hooke; at small strain Hooke's law with Lame's parameters."""
    G, L = m.parameters(G="shear modulus [MPa]", L="Lame's first parameter [MPa]")
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    m.minimise(G / 2 * ((F.T * F).trace() - 3) - G * (J - 1) + (G + L) / 2 * (J - 1) ** 2)
