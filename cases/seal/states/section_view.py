"""The deformed section as it is kept: what moves, stretches and presses, at nodes and in cells.

Units are mm and MPa.
"""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.states.state import Section
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.rigid_obstacles import tributary_areas
from softehl.runtime.discretisation.postprocessing import nodal_average, von_mises

_SLOPES = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]])
"""Derivatives of a cell's corners by its own coordinates, in its middle, times 4."""


def section_view(system: SealSystem, x: Array, rod_pressure: Array) -> Section:
    """The deformed section in a state x, with the pressure (arc nodes,) between it and the rod.

    At nodes: displacement, Cauchy stresses, contact_pressure (of the housing and its walls) and
    rod_pressure; both are zero elsewhere. In cells: von_mises, the mean over its points, and the
    principal stretches in their middle.
    """
    mesh = system.mesh
    fields_by_solid = [system.problem.fields(solid, x) for solid in system.solids]
    fields = {
        name: np.concatenate([f[name] for f in fields_by_solid]) for name in fields_by_solid[0]
    }
    stresses = {name: fields[f"sigma_{name}"] for name in ("zz", "rr", "tt", "zr")}
    nodal_fields = {name: value for name, value in fields.items() if name not in ("z", "r")}
    on_rod = np.zeros(len(mesh.points))
    on_rod[mesh.arc_nodes] = rod_pressure
    deformed = system.deformed(x)
    return Section(
        points=deformed,
        cells=mesh.quads,
        point_data={
            "displacement": system.displacements(x).copy(),
            "contact_pressure": housing_pressure(system, x),
            "rod_pressure": on_rod,
            **nodal_average(mesh.quads, nodal_fields, len(mesh.points)),
        },
        cell_data={
            "von_mises": von_mises(**stresses).mean(axis=1),
            **principal_stretches(mesh.points, deformed, mesh.quads),
        },
    )


def principal_stretches(points: Array, deformed: Array, quads: Integers) -> dict[str, Array]:
    """Principal stretches (cells,) in the middle of each cell.

    points, deformed: (nodes, 2), as (z, r). stretch_1 >= stretch_2 are those in the plane of the
    section, stretch_hoop that around the axis.
    """
    previous, after = points[quads], deformed[quads]
    gradient = np.linalg.solve(_SLOPES @ previous, _SLOPES @ after)  # transposed
    first, second = np.linalg.svd(gradient, compute_uv=False).T
    hoop = after[:, :, 1].mean(axis=1) / previous[:, :, 1].mean(axis=1)
    return {"stretch_1": first, "stretch_2": second, "stretch_hoop": hoop}


def film_pressure(system: SealSystem, x: Array) -> Array:
    """Pressure (arc nodes,) of the film in a state x, the mean of both sides of a facet, MPa."""
    first, last = x[system.pressure_dofs()[:, [0, -1]]].T
    return np.asarray(0.5 * (np.append(first, last[-1]) + np.insert(last, 0, first[0])))


def housing_pressure(system: SealSystem, x: Array) -> Array:
    """True pressure (nodes,) where the housing or a wall is touched, zero elsewhere, MPa.

    The multipliers per current area, and p_s where it acts.
    """
    pressure, force = np.zeros(len(system.mesh.points)), system.wall_forces(x)
    nodes, segments = system.mesh.boundary, system.mesh.segments
    deformed = system.deformed(x)
    current = tributary_areas(deformed, segments, nodes)
    wet = tributary_areas(deformed, system.section.elements["sealed_side"], nodes)
    fluid = wet * system.parameters.sealed_pressure
    pressure[nodes] = np.where(force[nodes] > 0.0, (force[nodes] + fluid) / current, 0.0)
    return pressure
