"""What the shear stress of a film moves: the edge of contact at which the instroke draws oil in.

Under a high sealed pressure the section lies in the corner between rod and wall. The rod of an
instroke pulls it out of there, and the edge moves outward along the arc, by many inlets. Couette's
stress eta U / h grows like the length of the inlet, U^0.4, so that one linear solution of the
contact problem says where the edge is at every speed. That of an outstroke pushes the section, and
the end of the arc with it, against the wall.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.system import ROD
from softehl.cases.seal.solve.contact import contact_problem
from softehl.cases.seal.solve.film import film_on, start_speed
from softehl.cases.seal.solve.grading import MULTIPLE, film_thickness
from softehl.cases.seal.solve.path import PathSettings
from softehl.cases.seal.states.contacts import Edge, contact_edges, contacts
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import LinearSolver, SingularMatrix


def dragged(
    system: SealSystem, settings: PathSettings, offset: float, x: Array, linear: LinearSolver
) -> float:
    """How far the slowest film of the instroke moves the edge of its inlet outward, mm.

    offset: of the rod in the contact state x (n,), mm. 0 where contact has no edges or no tangent.
    """
    p, edges = system.parameters, contact_edges(system, x)
    if not edges:
        return 0.0
    at = replace(settings, offset=offset)
    change = _change(system, at, "in", min(p.speeds), edges[-1], x, linear)
    if change is None:
        return 0.0
    edge, nodes = edges[-1], contacts(system, x)[-1][::-1][1:3]
    rod = system.layout.part(ROD)
    # the square of the pressure is a straight line from the edge on, which moves with it
    squares = 2.0 * x[rod][nodes] * change[rod][nodes]
    return float(np.mean(squares) / edge.rise)


def pushed(system: SealSystem, settings: PathSettings, x: Array, linear: LinearSolver) -> float:
    """How far the first film of the outstroke moves the arc towards the wall of the air side, mm.

    x: contact state. 0 where contact has no edges or no tangent.
    """
    edges = contact_edges(system, x)
    if not edges:
        return 0.0
    speed = start_speed(system, settings)
    change = _change(system, settings, "out", speed, edges[0], x, linear)
    if change is None:
        return 0.0
    moved = system.displacements(change)[system.mesh.arc_nodes, 0]
    return float(max(moved.max(), 0.0))


def _change(
    system: SealSystem,
    settings: PathSettings,
    stroke: Stroke,
    speed: float,
    inlet: Edge,
    x: Array,
    linear: LinearSolver,
) -> Array | None:
    """What the shear stress of a film changes in the contact state x: (n,), to first order."""
    p = system.parameters
    if not p.shear_traction:
        return None
    thin = MULTIPLE * film_thickness(p, [inlet], speed)
    film = film_on(system, stroke, x, speed * settings.offset / thin)
    problem = contact_problem(system, settings, p.sealed_pressure)
    r, K = problem.linearise(x)
    force = system.sheared(problem, replace(film, shear=1.0)).residual(x) - r
    try:
        return -linear.factorise(K).solve(force)
    except SingularMatrix:
        return None
