"""Initial values: of unknowns at nodes, of history and other data at integration points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Flags
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.element_blocks import facet_nodes
from softehl.runtime.definition.point_data import IntegrationPoints
from softehl.runtime.definition.problem_definition import (
    Block,
    InitialValues,
    ProblemDefinition,
    StudyError,
    Where,
    display_name,
)
from softehl.runtime.definition.rigid_bodies import component_of
from softehl.runtime.mesh.face_matching import match_faces
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.suggestions import did_you_mean, join_names


def add_initial_values(
    definition: ProblemDefinition, where: Where | None, block: str | None, values: Mapping[str, Any]
) -> None:
    """Set initial values of unknowns and of data of points; see `Study.initial`."""
    read.require_unknowns("initial()", values, "T=20")
    for name, value in values.items():
        blocks = _blocks_with(definition, name, block)
        if blocks:
            _set_at_points(definition, where, blocks, name, value)
        else:
            _set_at_nodes(definition, where, name, value)


def point_data_names(block: Block) -> list[str]:
    """Names of the data of points of a block; history of terms once."""
    return list(dict.fromkeys(name.partition("[")[0] for name in block.kernel.point_data))


def _blocks_with(definition: ProblemDefinition, name: str, block: str | None) -> list[Block]:
    """Blocks with data of points of a name; none for an unknown.  Raises StudyError."""
    every = definition.blocks.values()
    if block is None:
        having = [b for b in every if name in point_data_names(b)]
        if having and any(slot.name == name for b in every for slot in b.slots):
            raise StudyError(
                f"initial({name}=...): {name!r} is an unknown, and data of points of "
                f"{having[0].name!r}: say block={having[0].name!r} for the latter"
            )
        return having
    selected = [b for b in every if block in (b.name, b.name.removesuffix(f":{b.kernel.cell}"))]
    if not selected:
        names = list(definition.blocks)
        raise StudyError(
            f"initial(block={block!r}): there is no such block{did_you_mean(block, names)}; there "
            f"are {join_names(names)}"
        )
    names = [n for b in selected for n in point_data_names(b)]
    read.require_names("data of points", [name], names, f"initial: block {block!r}")
    return selected


def _set_at_nodes(
    definition: ProblemDefinition, where: Where | None, name: str, value: Any
) -> None:
    mesh = definition.mesh
    if isinstance(where, str) and where in definition.rigids:
        body = definition.rigids[where]
        number = read.datum("initial", name, value, body.point[None])
        unknown = component_of(body, f"initial({where!r})", name)
        definition.start.append(InitialValues(unknown, np.array([body.node]), number))
        return
    nodes = np.arange(len(mesh.points)) if where is None else read.nodes_of(mesh, where)
    at_nodes = read.datum("initial", name, value, mesh.points[nodes])
    definition.start.append(InitialValues(name, nodes, at_nodes))


def _set_at_points(
    definition: ProblemDefinition, where: Where | None, blocks: list[Block], name: str, value: Any
) -> None:
    mesh = definition.mesh
    selected = [_elements_in(mesh, b, name, where) for b in blocks]
    if not mesh.anywhere(any(rows.any() for rows in selected)):
        raise StudyError(
            f"initial({display_name(where)}, {name}=...): no element of "
            f"{join_names(repr(b.name) for b in blocks)} lies there"
        )
    for block, rows in zip(blocks, selected, strict=True):
        facet = facet_nodes(block.kernel)
        nodes = block.nodes if facet is None else block.nodes[:, facet]
        points = IntegrationPoints.of(mesh, block.kernel, block.kind, nodes, block.options.rule)
        values = points.values(block.name, name, value)
        assert block.initial is not None
        initial = block.initial.copy()
        for column, label in enumerate(block.kernel.point_data):
            if label.partition("[")[0] == name:
                initial[rows, :, column] = values[rows]
        definition.blocks[block.name] = replace(block, initial=initial)
    definition.point_values.append(name)


def _elements_in(mesh: Mesh, block: Block, name: str, where: Where | None) -> Flags:
    """Elements (n,) of a block in a group, or all of whose nodes a predicate selects."""
    if where is None:
        return np.ones(len(block.nodes), dtype=bool)
    if callable(where):
        selected = np.zeros(len(mesh.points), dtype=bool)
        selected[mesh.nodes(where)] = True
        return np.asarray(selected[block.nodes].all(axis=1))
    if not isinstance(where, str) or where not in mesh.groups:
        raise StudyError(
            f"initial({display_name(where)}, {name}=...): {name!r} stands at the points of "
            f"{block.name!r}: a group of cells or a predicate is needed; groups: "
            f"{join_names(mesh.groups)}"
        )
    cells = mesh.cells_of(where).get(block.kind)
    if cells is None:
        return np.zeros(len(block.nodes), dtype=bool)
    return np.asarray(match_faces(block.nodes, cells, block.nodes.shape[1]) >= 0)
