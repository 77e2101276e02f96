"""Fracture by a phase field (AT2), plane strain at small strain, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def at2() -> Definition:
    """(1 - d)^2 psi + Gc / 2 (d^2 / l + l |grad d|^2); psi drives d by its largest value so far."""
    cell = element("quad4")
    m = Model("at2", nodes=4, rule=cell.rule)
    X = m.coordinates("X", "Y")
    u, d = m.nodal_unknowns("u_x", "u_y"), m.nodal_unknowns("d")[0]
    G, lame = m.parameters(G="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    Gc, length = m.parameters(Gc="toughness [N/mm]", length="half the width of a crack [mm]")
    (lag,) = m.parameters(lag="1: psi of the step before drives the crack; 0: of this step")
    (largest,) = m.point_data(largest="largest psi so far [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kinematics.deformation_gradient(m, e.dN, u) - sp.eye(2)
    strain = m.define("strain", (grad + grad.T) / 2)
    damage = m.define("damage", sp.Matrix(cell.shape(*m.point())).dot(sp.Matrix(d)))
    slope = m.define("slope", sp.Matrix(e.dN).T * sp.Matrix(d))
    psi = m.define("psi", lame / 2 * strain.trace() ** 2 + G * (strain * strain).trace())
    driving = m.define("driving", largest + (1 - lag) * sp.Max(psi - largest, 0))
    whole = m.define("whole", (1 - damage) ** 2 + sp.Rational("1e-7"))
    stress = m.define("stress", whole * (lame * strain.trace() * sp.eye(2) + 2 * G * strain))
    terms = [(stress[i, j], strain[i, j]) for i in (0, 1) for j in (0, 1)]
    terms += [(Gc / length * damage - 2 * (1 - damage) * driving, damage)]
    terms += [(Gc * length * slope[i], slope[i]) for i in (0, 1)]
    m.weak_form([(factor * e.detJ, varied) for factor, varied in terms])
    crack = Gc / 2 * (damage**2 / length + length * slope.dot(slope))
    m.fields(elastic=whole * psi * e.detJ, crack=crack * e.detJ, stress=stress[0, 0])
    m.history(largest=sp.Max(psi, largest))
    return m.finish()
