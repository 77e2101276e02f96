"""Parsing of inputs of derivatives: {"rubber": ["mu", "K"], "load:right": ["u_y"]}."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import (
    Block,
    Load,
    ProblemDefinition,
    StudyError,
    display_name,
)
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.sensitivity.inputs import (
    Input,
    LawParameter,
    LoadAmount,
    NodeCoordinates,
    PageArray,
    PageDatum,
    PageParameter,
    PagePointDatum,
    SupportValue,
)
from softehl.runtime.suggestions import did_you_mean, join_names

By: TypeAlias = Mapping[str, Any]
"""Block, load, support or "nodes" -> names of it; of nodes, names or modes (points, dim)."""

_FORM = 'by={"rubber": ["mu", "K"]}'


def inputs(definition: ProblemDefinition, by: By) -> list[Input]:
    """The inputs that are meant, in order.  Raises StudyError for a name that is not there."""
    if not isinstance(by, Mapping) or not by:
        raise StudyError(f"by = {by!r}: say by what, as in {_FORM}")
    selected: list[Input] = []
    for owner, listed_names in by.items():
        names = (listed_names,) if isinstance(listed_names, str) else listed_names
        if not isinstance(names, Sequence | Mapping) or not names:
            raise StudyError(f"by: {owner!r} needs a list of names, as in {_FORM}")
        for name in names:
            mode = names[name] if isinstance(names, Mapping) else None
            if mode is not None and owner != "nodes":
                raise StudyError(f'by: modes are those of "nodes", not of {owner!r}')
            selected.append(_input(definition, owner, name, mode))
    return selected


def inputs_of_keys(definition: ProblemDefinition, keys: Sequence[tuple[str, str]]) -> list[Input]:
    """Inputs by their keys.  Raises StudyError."""
    for key in keys:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise StudyError(f'{key!r}: an input is a pair, ("rubber", "mu")')
    return [_input(definition, owner, name, None) for owner, name in keys]


def components(
    selected: Sequence[Input], direction: Mapping[tuple[str, str], float | Array]
) -> Array:
    """All components (k,) of a direction; zero for inputs without one.  Raises StudyError."""
    keys = [item.key for item in selected]
    if not isinstance(direction, Mapping) or not direction:
        raise StudyError(f"direction = {direction!r}: say how inputs move, {{{keys[0]!r}: 1.0}}")
    for key in direction:
        if key not in keys:
            raise StudyError(
                f"direction: {key!r} is no input of by; there are {join_names(map(str, keys))}"
            )
    parts = []
    for item in selected:
        n, value = len(item.value), np.asarray(direction.get(item.key, 0.0))
        if value.dtype.kind not in "fiu" or value.shape not in ((), (n,)):
            raise StudyError(
                f"direction: {item.key!r} needs a number, or an array ({n},), given "
                f"{type(direction[item.key]).__name__} of shape {value.shape}"
            )
        if not np.isfinite(value).all():
            raise StudyError(f"direction: {item.key!r} must be finite, given {value}")
        parts.append(np.broadcast_to(value.astype(np.float64), n))
    return np.concatenate(parts)


def _input(definition: ProblemDefinition, owner: str, name: str, mode: Any) -> Input:
    blocks = _blocks(definition, owner)
    if blocks:
        return _of_page(owner, name, blocks)
    laws = {c.name: c for c in definition.contacts if c.law is not None}
    if owner in laws:
        parameters = [*laws[owner].law.parameters]
        _require_matches(owner, name, [n for n in parameters if n == name], parameters)
        return LawParameter((owner, name), laws[owner])
    head, _, side = str(owner).partition(":")
    if head == "nodes":
        return _of_nodes(definition, owner, name, side, mode)
    if head == "fix" and side in {_plain(c.where) for c in definition.conditions}:
        return _support(definition, owner, name, side)
    if any(_key_of(f) == owner for f in definition.forces):
        return _amounts(definition, owner, name)
    owners = [*definition.blocks, *laws, *dict.fromkeys(_key_of(f) for f in definition.forces)]
    owners += dict.fromkeys(f"fix:{_plain(c.where)}" for c in definition.conditions)
    owners.append("nodes")
    raise StudyError(
        f"by: there is no {owner!r}{did_you_mean(owner, owners)}; there are {join_names(owners)}"
    )


def _blocks(definition: ProblemDefinition, owner: str) -> list[Block]:
    """Of that name, on all kinds of cells."""
    blocks = definition.blocks
    if owner in blocks:
        return [blocks[owner]]
    return [b for n, b in blocks.items() if n == f"{owner}:{b.kernel.cell}"]


def _of_page(owner: str, name: str, blocks: list[Block]) -> Input:
    kernel = blocks[0].kernel
    if name in kernel.functions:
        raise StudyError(f"by: {name!r} of {owner!r} is a C function, not a number")
    if name in blocks[0].parameters:
        return PageParameter((owner, name), blocks)
    if name in blocks[0].data:
        return PageDatum((owner, name), blocks)
    if name in blocks[0].arrays:
        return PageArray((owner, name), blocks)
    at_points = [n for n in kernel.point_data if "[" not in n]
    if name in at_points:
        return PagePointDatum((owner, name), blocks)
    numbers = [n for n in blocks[0].parameters if n not in kernel.functions]
    names = [*numbers, *blocks[0].data, *blocks[0].arrays, *at_points]
    raise StudyError(
        f"by: {owner!r} ({kernel.name}) has no {name!r}{did_you_mean(name, names)}; it has "
        f"{join_names(names)}"
    )


def _support(definition: ProblemDefinition, owner: str, name: str, where: str) -> Input:
    conditions = [(k, c) for k, c in enumerate(definition.conditions) if _plain(c.where) == where]
    matching = [(k, c) for k, c in conditions if c.name == name]
    _require_matches(owner, name, matching, [c.name for _, c in conditions])
    _require_equal_values(owner, name, [c.value for _, c in matching])
    return SupportValue((owner, name), [k for k, _ in matching], [c for _, c in matching])


def _amounts(definition: ProblemDefinition, owner: str, name: str) -> Input:
    forces = [(k, f) for k, f in enumerate(definition.forces) if _key_of(f) == owner]
    pressure = owner.startswith("pressure:")
    matching = [
        (k, f) for k, f in forces if name == "pressure" or (not pressure and name in f.names)
    ]
    names = ["pressure"] if pressure else [n for _, f in forces for n in f.names]
    _require_matches(owner, name, matching, names)
    _require_equal_values(owner, name, [_value_of(f) for _, f in matching])
    return LoadAmount((owner, name), [k for k, _ in matching], [f for _, f in matching])


def _of_nodes(definition: ProblemDefinition, owner: str, name: str, side: str, mode: Any) -> Input:
    mesh = definition.mesh
    points, dimension = mesh.points.shape
    targets = np.zeros(points, dtype=np.int64)
    if mode is not None:
        directions = np.asarray(mode(mesh.points) if callable(mode) else mode, dtype=np.float64)
        if directions.shape != mesh.points.shape:
            raise StudyError(
                f"by: the mode {name!r} of the nodes has the shape {directions.shape}, must be "
                f"{mesh.points.shape}"
            )
        return NodeCoordinates((owner, name), mesh, targets, directions, np.zeros(1), scalar=True)
    axes = "xyz"[:dimension]
    if name not in tuple(axes):
        raise StudyError(
            f"by: {owner!r} has no {name!r}; it has {join_names(axes)}, or a mode that is given, "
            'by={"nodes": {"width": (points, dim) array}}'
        )
    nodes = mesh.nodes(side) if side else np.arange(points)
    targets[:] = -1
    targets[nodes] = np.arange(len(nodes))
    along = np.zeros((points, dimension))
    along[nodes, axes.index(name)] = 1.0
    return NodeCoordinates(
        (owner, name), mesh, targets, along, mesh.points[nodes, axes.index(name)]
    )


def _require_matches(
    owner: str, name: str, matching: Sequence[object], allowed: Sequence[str]
) -> None:
    if not matching:
        names = list(dict.fromkeys(allowed))
        raise StudyError(
            f"by: {owner!r} has no {name!r}{did_you_mean(name, names)}; it has {join_names(names)}"
        )


def _require_equal_values(owner: str, name: str, values: Sequence[object]) -> None:
    """Raise StudyError for several values of one support or load."""
    if any(value is not values[0] and value != values[0] for value in values):
        raise StudyError(
            f"by: {owner!r} has several values of {name!r}: give their places other names"
        )


def _value_of(force: Load) -> object:
    kernel: Any = force.kernel
    if isinstance(kernel, Spring):
        return kernel.stiffness
    return kernel.offset if isinstance(kernel, Tie) else kernel.value


def _key_of(force: Load) -> str:
    """Key of a load: "load:right"."""
    return f"{force.what}:{force.where}"


def _plain(where: object) -> str:
    return where if isinstance(where, str) else display_name(where)
