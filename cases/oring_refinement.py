"""The contact state of a mesh from that of another, without a path.

Displacements, multipliers and element pressures are carried over, from a mesh of half the density
or of other spacing, and corrected by Newton's method,
which holds on to the pressures in its tangent (`runtime.held_pressure`). The multipliers are
unknowns, so contact is stiff from the first iteration on. What is solved is the same as on the
path of `cases.oring_path`; only the start is another one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cases.oring_parameters import ORing
from cases.oring_path import PathSettings, contact_problem
from cases.oring_section import HOUSING, OringSection
from cases.stages import Stage
from runtime.continuation import StepRule
from runtime.held_pressure import HeldPressure, element_pressures
from runtime.kernels import load_kernel
from runtime.prolongation import prolong_chain, prolong_elements, prolong_nodes
from runtime.transfer import transfer_chain, transfer_elements, transfer_nodes

Array = NDArray[np.float64]


def finer(parameters: ORing) -> ORing:
    """The same case at twice the density."""
    return parameters.model_copy(update={"density": 2 * parameters.density})


def prolong_contact(coarse: OringSection, fine: OringSection, x: Array) -> Array:
    """Unknowns of the fine section from those, x, of a contact state of the coarse one."""
    of, to, density = coarse.layout, fine.layout, coarse.parameters.density
    y = fine.at_rest()
    u = x[of.part("displacement")].reshape(-1, 2)
    y[to.part("displacement")] = prolong_nodes(u, density).ravel()
    for name in ("rod", *HOUSING):
        y[to.part(name)] = prolong_chain(x[of.part(name)])
    y[to.part("rotation")] = x[of.part("rotation")]
    return y


def move_contact(old: OringSection, new: OringSection, x: Array) -> Array:
    """Unknowns of the new section from those, x, of a contact state on another mesh of it."""
    of, to, mesh = old.layout, new.layout, new.mesh
    y = new.at_rest()
    u = x[of.part("displacement")].reshape(-1, 2)
    y[to.part("displacement")] = transfer_nodes(old.mesh, mesh, u).ravel()
    parts = {"rod": (old.mesh.arc_nodes, mesh.arc_nodes)}
    parts |= dict.fromkeys(HOUSING, (old.mesh.outer_nodes, mesh.outer_nodes))
    for name, (nodes, new_nodes) in parts.items():
        y[to.part(name)] = transfer_chain(old.mesh, mesh, nodes, new_nodes, x[of.part(name)])
    y[to.part("rotation")] = x[of.part("rotation")]
    return y


def refined_contact(
    coarse: OringSection, fine: OringSection, settings: PathSettings, x: Array
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on the fine mesh, and its start.

    x: unknowns of the contact state of the coarse mesh, which has half the density.
    """
    density = coarse.parameters.density
    pressures = prolong_elements(_pressures(coarse, settings, x), density)
    stage = _corrected(
        fine,
        settings,
        pressures,
        name=f"contact at density {fine.parameters.density}",
        method=f"newton, prolonged from density {density}",
    )
    return stage, prolong_contact(coarse, fine, x)


def regraded_contact(
    old: OringSection, new: OringSection, settings: PathSettings, x: Array, name: str
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on another mesh of the same section.

    x: unknowns of the contact state on the old mesh. name: of the stage.
    """
    pressures = transfer_elements(old.mesh, new.mesh, _pressures(old, settings, x))
    stage = _corrected(
        new,
        settings,
        pressures,
        name=name,
        method="newton, moved from another mesh",
    )
    return stage, move_contact(old, new, x)


def _pressures(section: OringSection, settings: PathSettings, x: Array) -> Array:
    problem = contact_problem(section, settings, section.parameters.sealed_pressure)
    return element_pressures(problem, "solid", x)


def _corrected(
    section: OringSection, settings: PathSettings, pressures: Array, *, name: str, method: str
) -> Stage:
    """The stage of one step that solves for contact while it holds on to element pressures."""
    p = section.parameters
    problem = HeldPressure.of(
        contact_problem(section, settings, p.sealed_pressure),
        "solid",
        load_kernel("follower_pressure"),
        pressures,
        p.bulk_modulus,
    )
    return Stage(
        name=name,
        problem_at=lambda _: problem,
        start=p.sealed_pressure,
        stop=p.sealed_pressure,
        steps=StepRule(1.0, 1.0),
        sealed_pressure=p.sealed_pressure,
        stroke="both",
        method=method,
    )
