"""What the shear stress of a film moves: the edge of contact at which the instroke draws oil in.

Under a high sealed pressure the section lies in the corner between rod and wall. The rod of an
instroke pulls it out of there, and the edge moves outward along the arc, by many inlets. Couette's
stress eta U / h grows like the length of the inlet, U^0.4, so that one linear solution of the
contact problem says where the edge is at every speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softehl.cases.seal.contact import contact_problem
from softehl.cases.seal.contacts import contact_edges, contacts
from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.film import film_on
from softehl.cases.seal.grading import MULTIPLE, film_thickness
from softehl.cases.seal.path import PathSettings
from softehl.cases.seal.system import ROD
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import LinearSolver, SingularMatrix


def dragged(
    system: SealSystem, settings: PathSettings, offset: float, x: Array, linear: LinearSolver
) -> float:
    """How far the slowest film of the instroke moves the edge of its inlet outward, mm.

    offset: of the rod in the contact state x (n,), mm. 0 where contact has no edges or no tangent.
    """
    p, edges = system.parameters, contact_edges(system, x)
    if not edges or not p.shear_traction:
        return 0.0
    edge, nodes = edges[-1], contacts(system, x)[-1][::-1][1:3]
    speed = min(p.speeds)
    thin = MULTIPLE * film_thickness(p, [edge], speed)
    film = film_on(system, "in", x, speed * offset / thin)
    problem = contact_problem(system, replace(settings, offset=offset), p.sealed_pressure)
    r, K = problem.linearise(x)
    force = system.sheared(problem, replace(film, shear=1.0)).residual(x) - r
    try:
        change = -linear.factorise(K).solve(force)
    except SingularMatrix:
        return 0.0
    rod = system.layout.part(ROD)
    # the square of the pressure is a straight line from the edge on, which moves with it
    squares = 2.0 * x[rod][nodes] * change[rod][nodes]
    return float(np.mean(squares) / edge.rise)
