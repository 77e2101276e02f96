"""Mass matrix of a study: densities by block, and accelerations in pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.definition.argument_checks import datum, require_names
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.mass import PARAMETER, MassKernel, interpolation, mass_matrices
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.suggestions import did_you_mean, join_names

Masses: TypeAlias = Mapping[str, Mapping[str, Any]]
"""Block -> {"rho": density, "of": unknowns that have it}."""

_EXAMPLE = 'mass={"body": {"rho": 1e-9}}'


def mass_blocks(system: System, densities: Masses | None) -> list[ElementBlock]:
    """Elements of mass: block -> {"rho": a number, (n,) numbers or a function of centres}.

    rho: mass per reference volume (in 2-D per area, times 1 or the ring). of: unknowns that have
    it; left out, u_x, u_y, u_z. A page on several kinds of cells is named once. Raises StudyError.
    """
    element_blocks: list[ElementBlock] = []
    if densities is not None and not isinstance(densities, Mapping):
        raise StudyError(f"mass = {densities!r}: give densities by blocks, as in {_EXAMPLE}")
    for name, values in (densities or {}).items():
        blocks = [b for b in system.blocks.values() if b.name == name or _base(b) == name]
        if not blocks:
            names = list(dict.fromkeys(_base(b) for b in system.blocks.values()))
            raise StudyError(
                f"mass: no block {name!r}{did_you_mean(name, names)}; there are {join_names(names)}"
            )
        if isinstance(values, Mapping):
            require_names("key", values, ("rho", "of"), f"mass of {name!r}")
        if not isinstance(values, Mapping) or "rho" not in values:
            raise StudyError(f"mass of {name!r}: give its density, as in {_EXAMPLE}")
        element_blocks += [_elements(system, block, values) for block in blocks]
    return element_blocks


def _base(block: Block) -> str:
    """Name of a page in the study, without the kind of cells."""
    return block.name.removesuffix(f":{block.kernel.cell}") if block.kernel.cell else block.name


def _elements(system: System, block: Block, values: Mapping[str, Any]) -> ElementBlock:
    at = [slot.name for slot in block.slots if slot.node is not None]
    names = _names(system, block, at, values.get("of"))
    count = at.count(names[0])
    if count > len(CELLS[block.kind].nodes):
        raise StudyError(
            f"mass of {block.name!r}: its elements are given by their nodes and have no cells; put "
            "a page or the mass on cells, or write accelerations into the page"
        )
    if count not in (len(CELLS[block.kind].nodes), CELLS[block.kind].corners):
        raise StudyError(
            f"mass of {block.name!r}: {names[0]} stands at {count} nodes of {block.kind}, neither "
            "at all nor at the corners, and has no shape functions; write accelerations into the "
            "page"
        )
    nodes = block.nodes[:, :count]
    centres = system.mesh.points[system.everywhere.blocks[block.name].nodes].mean(axis=1)
    every = datum(f"mass of {block.name}", "rho", values["rho"], centres)
    density = system.comm.restrict_cells(block.name, every)
    if (every < 0.0).any():
        raise StudyError(f"mass of {block.name!r}: rho = {every.min():g}, it cannot be negative")
    axisymmetric = system.definition is not None and system.definition.axisymmetric
    cell, geometry = interpolation(block.kind, count), CELLS[block.kind]
    every_place = system.mesh.points[block.nodes[:, : len(geometry.nodes)]]
    matrices = mass_matrices(cell, every_place, density, ring=axisymmetric, geometry=geometry)
    dofs = np.concatenate([system.numbering.nodal[name][nodes] for name in names], axis=1)
    kernel = MassKernel(matrices, len(names))
    return ElementBlock(
        f"mass of {block.name}", kernel, system.mesh.points[nodes].reshape(len(nodes), -1), dofs,
        check_orientation=False,
    )  # fmt: skip


def _names(
    system: System, block: Block, at: list[str], requested: Sequence[str] | None
) -> tuple[str, ...]:
    """Unknowns at nodes that have the mass.  Raises StudyError."""
    if isinstance(requested, str):
        requested = (requested,)
    if requested is not None:
        require_names("unknown", requested, dict.fromkeys(at), f"mass of {block.name!r}")
    names = (
        tuple(n for n in ("u_x", "u_y", "u_z") if n in at)
        if requested is None
        else tuple(requested)
    )
    if not names or len({at.count(n) for n in names}) > 1:
        raise StudyError(
            f"mass of {block.name!r}: say which unknowns have it, "
            f'"of": ["w"]; at nodes there are {join_names(dict.fromkeys(at))}'
        )
    return names


def has_acceleration(system: System) -> bool:
    """True if a page names the acceleration of an unknown."""
    return any(PARAMETER in b.kernel.parameters for b in system.blocks.values())


def mass_matrix(system: System, problem: Problem, x: Array, densities: Masses | None) -> csc_array:
    """M, (n, n), at unknowns x: of the densities, and of pages with accelerations; of a system that
    is spread over processes what the elements of this one add.

    Raises StudyError where there is none.
    """
    blocks = mass_blocks(system, densities)
    M = csc_array((system.size, system.size))
    if blocks:
        assembler = Assembler.build(system.size, blocks)
        unit = {b.name: np.ones(1) for b in blocks}
        M = csc_array(M + assembler.linearise(x, unit)[1])
    for block in problem.assembler.blocks:
        names = list(block.kernel.parameters)
        if PARAMETER in names and block.name in system.blocks:
            of_page = _of_page(problem, block, x, names.index(PARAMETER))
            _require_one_mass(system, block.name, of_page, blocks)
            M = csc_array(M + of_page)
    if not system.comm.max(float(M.nnz)):
        raise StudyError(
            f"there is no mass: give densities, {_EXAMPLE}, or write accelerations into a page"
        )
    return M


def _require_one_mass(
    system: System, name: str, of_page: csc_array, blocks: Sequence[ElementBlock]
) -> None:
    """Raise StudyError where a page has accelerations of unknowns whose mass is given, too."""
    dofs = [block.dofs for block in blocks if block.name == f"mass of {name}"]
    if system.comm.max(float(any(abs(of_page).sum(axis=1)[d].any() for d in dofs))):
        raise StudyError(
            f"mass of {name!r}: its page has accelerations of these unknowns, and the two would "
            "add: leave mass out, or the acceleration, or put a mass that is added on a block of "
            "its own"
        )


def _of_page(problem: Problem, block: ElementBlock, x: Array, column: int) -> csc_array:
    """Change of the residuals of a page by its accelerations."""
    alone = Assembler.build(problem.assembler.size, [block])
    parts = []
    for value in (1.0, 0.0):
        parameters = problem.parameters[block.name].copy()
        parameters[column] = value
        parts.append(alone.linearise(x, {block.name: parameters})[1])
    return csc_array(parts[0] - parts[1])
