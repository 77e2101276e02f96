"""The contact state of a fine mesh from that of a mesh of half its density, without a path.

Displacements, multipliers and element pressures are prolonged and corrected by Newton's method,
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

Array = NDArray[np.float64]

DENSITIES = (1, 2, 4, 8)
"""Densities at which a path through the contact stage may start, coarsest first."""


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


def refined_contact(
    coarse: OringSection, fine: OringSection, settings: PathSettings, x: Array
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on the fine mesh, and its start.

    x: unknowns of the contact state of the coarse mesh, which has half the density.
    """
    p = fine.parameters
    p_s, density = p.sealed_pressure, coarse.parameters.density
    pressures = element_pressures(contact_problem(coarse, settings, p_s), "solid", x)
    problem = HeldPressure.of(
        contact_problem(fine, settings, p_s),
        "solid",
        load_kernel("follower_pressure"),
        prolong_elements(pressures, density),
        p.bulk_modulus,
    )
    stage = Stage(
        name=f"contact at density {p.density}",
        problem_at=lambda _: problem,
        start=p_s,
        stop=p_s,
        steps=StepRule(1.0, 1.0),
        sealed_pressure=p_s,
        stroke="both",
        method=f"newton, prolonged from density {density}",
    )
    return stage, prolong_contact(coarse, fine, x)
