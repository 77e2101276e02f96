"""Linear elasticity on quadrilaterals of four nodes, with and without enhanced strains."""

import sympy as sp

import softehl


def elastic(m, gradient):
    """W = lambda / 2 tr(strain)^2 + mu strain : strain."""
    E, nu = m.parameters(E="Young's modulus [Pa]", nu="Poisson's ratio")
    strain = (gradient + gradient.T) / 2
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    m.minimise(lame / 2 * strain.trace() ** 2 + mu * (strain.T * strain).trace())


@softehl.page
def plain(m):
    """Q1: the strains are those of the displacements."""
    elastic(m, m.grad(m.vector("u")))


@softehl.page
def enhanced(m):
    """Q1E4: a cell has four strains of its own, which are condensed."""
    u, a = m.vector("u"), sp.Matrix(2, 2, m.internal("a", 4))
    J, middle = m.jacobian, m.centroid(m.jacobian)
    added = middle.det() / J.det() * a * sp.diag(*m.parent) * middle.inv()
    elastic(m, m.grad(u)[:2, :2] + added)
