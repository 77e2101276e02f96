"""Rigid bodies of a study: their reference points, and the nodes that move with them.

The motion of a body is a displacement and a rotation, unknowns at a node of the mesh, by which they
are prescribed and loaded as all others. Each node of the body is at its place by the multipliers of
a page (`rigid_link_2`, `rigid_link_3`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.element_blocks import page_on
from softehl.runtime.definition.problem_definition import (
    Block,
    PageOptions,
    PrescribedValues,
    ProblemDefinition,
    RigidBody,
    StudyError,
    Where,
    display_name,
)
from softehl.runtime.discretisation.dofmap import Slot
from softehl.runtime.discretisation.loads import Amount
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.suggestions import did_you_mean, join_names

ROTATIONS = ("finite", "small")
_FLAT = 1e-9
"""Of the size of a body: nodes that are nearer to a line leave a rotation about it undetermined."""


def add_rigid_body(
    definition: ProblemDefinition,
    where: Where | None,
    *,
    at: Sequence[float] | None,
    name: str,
    rotations: str,
    of: Sequence[str] | None,
) -> str:
    """Add a rigid body and return its name; see `Study.rigid`."""
    mesh = definition.mesh
    context = f"rigid({'' if where is None else display_name(where)}, name={name!r})"
    mesh.require_whole(context)
    _require_free_name(definition, context, name)
    if mesh.dimension not in (2, 3):
        raise StudyError(
            f"{context}: rigid bodies are for meshes in 2-D and 3-D, this one is a line"
        )
    if rotations not in ROTATIONS:
        raise StudyError(
            f"{context}: rotations = {rotations!r}: allowed are {join_names(ROTATIONS)}"
        )
    if where is None and at is None:
        raise StudyError(f"{context}: give a side, or the reference point at=... of a body alone")
    usual = tuple(f"u_{axis}" for axis in "xyz"[: mesh.dimension])
    names = usual if of is None else tuple(of)
    if len(names) != mesh.dimension:
        raise StudyError(f"{context}: of={list(names)}: {len(usual)} displacements are needed")
    nodes = np.empty(0, dtype=np.int64) if where is None else read.nodes_of(mesh, where)
    point = _reference_point(context, mesh.points[nodes], at, mesh.dimension)
    if where is not None:
        _require_body(context, mesh.points[nodes])
    node = int(nodes[0]) if len(nodes) else 0
    finite = rotations == "finite"
    body = RigidBody(name, nodes, node, point, names, finite, definition.axisymmetric)
    if where is not None:
        definition.blocks[name] = _links(definition, body)
    definition.rigids[name] = body
    for component in body.components[1:] if definition.axisymmetric else ():
        condition = PrescribedValues(name, np.array([node]), body.unknown(component), 0.0)
        definition.conditions.append(condition)
    return name


def component_of(body: RigidBody, context: str, component: str) -> str:
    """Name of the unknown of a component of the motion of a body.  Raises StudyError."""
    if component not in body.components:
        hint = did_you_mean(component, body.components)
        raise StudyError(
            f"{context}: the rigid body {body.name!r} has no {component!r}{hint}; it has "
            f"{join_names(body.components)}"
        )
    if body.axisymmetric and component != body.components[0]:
        raise StudyError(
            f"{context}: {component}: in axisymmetry a rigid body moves along the axis alone, "
            f"{body.components[0]}"
        )
    return body.unknown(component)


def amount_at(body: RigidBody, context: str, component: str, value: Amount) -> Amount:
    """An amount of a body: a number, or a function of its reference point (1, dim) and t."""
    checked = read.amount(context, component, value)
    return _AtPoint(checked, body.point) if callable(checked) else checked


@dataclass(frozen=True, eq=False)
class _AtPoint:
    """A function of places and t, at one place."""

    function: Callable[[Array, float], Array | float]
    point: Array

    def __call__(self, x: Array, t: float) -> Array | float:
        return self.function(self.point[None], t)


def _require_free_name(definition: ProblemDefinition, context: str, name: str) -> None:
    mesh = definition.mesh
    if not isinstance(name, str) or not name:
        raise StudyError(f"{context}: a name is text, as in name='grip'")
    if name in mesh.sides or name in mesh.groups:
        raise StudyError(
            f"{context}: {name!r} is a side or a group of the mesh, and loads on it are no loads "
            "on the body: give another name"
        )
    if name in definition.blocks or name in definition.rigids:
        existing = join_names(dict.fromkeys([*definition.blocks, *definition.rigids]))
        raise StudyError(f"{context}: the name is taken: {existing}; give another name")


def _reference_point(
    context: str, points: Array, at: Sequence[float] | None, dimension: int
) -> Array:
    """The reference point: what is given, or the middle of the box around the nodes."""
    if at is None:
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))
    numbers: Any = at
    try:
        point = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        point = np.empty(0)
    if point.shape != (dimension,) or not np.isfinite(point).all():
        raise StudyError(f"{context}: at = {at!r}: {dimension} finite coordinates are needed")
    return point


def _require_body(context: str, points: Array) -> None:
    """Raise StudyError for nodes that leave a rotation undetermined."""
    dimension, size = points.shape[1], float(np.ptp(points, axis=0).max(initial=0.0))
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    wide = int((extents > _FLAT * max(size, 1e-300)).sum())
    if wide < dimension - 1:
        kind = "at one place" if wide == 0 else "on a line"
        raise StudyError(
            f"{context}: its nodes are {kind}, so that a rotation moves none of them: tie them, "
            "study.tie(side, place, ...), or take a wider side"
        )


def _links(definition: ProblemDefinition, body: RigidBody) -> Block:
    """Elements of the nodes of a body: the node, and the one with the motion of the body."""
    mesh, axes = definition.mesh, "xyz"[: len(body.point)]
    kernel = load_kernel(f"rigid_link_{len(axes)}")
    nodes = np.stack([body.nodes, np.full(len(body.nodes), body.node)], axis=1)
    moves = [f"U_{c}" for c in axes] + [*body.components[len(axes) :]]
    called = dict(zip((f"u_{c}" for c in axes), body.names, strict=True))
    called |= {f"lambda_{c}": body.unknown(f"lambda_{c}") for c in axes}
    called |= {m: body.unknown(c) for m, c in zip(moves, body.components, strict=True)}
    data: dict[str, Any] = {f"a_{c}": float(v) for c, v in zip(axes, body.point, strict=True)}
    data["finite"] = float(body.finite)
    options = PageOptions(called=called, constant=not body.finite)
    block = page_on(mesh, body.name, kernel, ("point1", nodes), options, data)
    at_reference = {body.unknown(c) for c in body.components}
    slots = tuple(Slot(s.name, 1) if s.name in at_reference else s for s in block.slots)
    return replace(block, slots=slots)


def resolved(
    definition: ProblemDefinition, where: Where, context: str, values: Mapping[str, Amount]
) -> tuple[RigidBody, dict[str, Amount]] | None:
    """A rigid body that is meant, and amounts by the names of its unknowns; None for a place."""
    if not isinstance(where, str) or where not in definition.rigids:
        return None
    body = definition.rigids[where]
    return body, {
        component_of(body, context, c): amount_at(body, context, c, v) for c, v in values.items()
    }


def shared_constraints(definition: ProblemDefinition) -> str:
    """Words for what constrains a node of two bodies; empty where none does."""
    owner: dict[int, str] = {}
    for body in definition.rigids.values():
        for node in body.nodes.tolist():
            if node in owner:
                return (
                    f"node {node} belongs to the rigid bodies {owner[node]!r} and {body.name!r}: "
                    "leave it out of one of them"
                )
            owner[node] = body.name
    return ""


def linked_nodes(definition: ProblemDefinition) -> Integers:
    """Nodes of all rigid bodies."""
    parts = [body.nodes for body in definition.rigids.values()]
    return np.concatenate([np.empty(0, dtype=np.int64), *parts])
