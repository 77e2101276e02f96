"""Reading by what results are differentiated: {"rubber": ["mu", "K"], "load:right": ["u_y"]}."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.definition.problem_definition import Block, Force, Statement, StudyError, shown
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.sensitivity.inputs import (
    Amounts,
    Input,
    PageDatum,
    PageParameter,
    Places,
    Support,
)
from softehl.runtime.suggestions import listed, meant

By: TypeAlias = Mapping[str, Any]
"""Block, load, support or "nodes" -> names of it; of nodes, names or modes (points, dim)."""

_FORM = 'by={"rubber": ["mu", "K"]}'


def inputs(statement: Statement, by: By) -> list[Input]:
    """The inputs that are meant, in order.  Raises StudyError for a name that is not there."""
    if not isinstance(by, Mapping) or not by:
        raise StudyError(f"by = {by!r}: say by what, as in {_FORM}")
    found: list[Input] = []
    for place, given in by.items():
        names = (given,) if isinstance(given, str) else given
        if not isinstance(names, Sequence | Mapping) or not names:
            raise StudyError(f"by: {place!r} needs a list of names, as in {_FORM}")
        for name in names:
            mode = names[name] if isinstance(names, Mapping) else None
            if mode is not None and place != "nodes":
                raise StudyError(f'by: modes are those of "nodes", not of {place!r}')
            found.append(_input(statement, place, name, mode))
    return found


def of_keys(statement: Statement, keys: Sequence[tuple[str, str]]) -> list[Input]:
    """Inputs by their keys.  Raises StudyError."""
    for key in keys:
        if not (isinstance(key, tuple) and len(key) == 2):
            raise StudyError(f'{key!r}: an input is a pair, ("rubber", "mu")')
    return [_input(statement, place, name, None) for place, name in keys]


def _input(statement: Statement, place: str, name: str, mode: Any) -> Input:
    blocks = _blocks(statement, place)
    if blocks:
        return _of_page(place, name, blocks)
    head, _, rest = str(place).partition(":")
    if head == "nodes":
        return _of_nodes(statement, place, name, rest, mode)
    if head == "fix" and rest in {_plain(c.where) for c in statement.conditions}:
        return _support(statement, place, name, rest)
    if any(_words(f) == place for f in statement.forces):
        return _amounts(statement, place, name)
    known = [*statement.blocks, *dict.fromkeys(_words(f) for f in statement.forces)]
    known += dict.fromkeys(f"fix:{_plain(c.where)}" for c in statement.conditions)
    known.append("nodes")
    raise StudyError(f"by: there is no {place!r}{meant(place, known)}; there are {listed(known)}")


def _blocks(statement: Statement, place: str) -> list[Block]:
    """Of that name, on all kinds of cells."""
    blocks = statement.blocks
    if place in blocks:
        return [blocks[place]]
    return [b for n, b in blocks.items() if n == f"{place}:{b.kernel.cell}"]


def _of_page(place: str, name: str, blocks: list[Block]) -> Input:
    kernel = blocks[0].kernel
    if name in blocks[0].parameters:
        return PageParameter((place, name), blocks)
    if name in blocks[0].data:
        return PageDatum((place, name), blocks)
    known = [*blocks[0].parameters, *blocks[0].data]
    raise StudyError(
        f"by: {place!r} ({kernel.name}) has no {name!r}{meant(name, known)}; it has {listed(known)}"
    )


def _support(statement: Statement, place: str, name: str, where: str) -> Input:
    here = [(k, c) for k, c in enumerate(statement.conditions) if _plain(c.where) == where]
    mine = [(k, c) for k, c in here if c.name == name]
    _known(place, name, mine, [c.name for _, c in here])
    _alike(place, name, [c.value for _, c in mine])
    return Support((place, name), [k for k, _ in mine], [c for _, c in mine])


def _amounts(statement: Statement, place: str, name: str) -> Input:
    here = [(k, f) for k, f in enumerate(statement.forces) if _words(f) == place]
    pressure = place.startswith("pressure:")
    mine = [(k, f) for k, f in here if name == "pressure" or (not pressure and name in f.names)]
    known = ["pressure"] if pressure else [n for _, f in here for n in f.names]
    _known(place, name, mine, known)
    _alike(place, name, [_given(f) for _, f in mine])
    return Amounts((place, name), [k for k, _ in mine], [f for _, f in mine])


def _of_nodes(statement: Statement, place: str, name: str, side: str, mode: Any) -> Input:
    mesh = statement.mesh
    points, dimension = mesh.points.shape
    targets = np.zeros(points, dtype=np.int64)
    if mode is not None:
        found = np.asarray(mode(mesh.points) if callable(mode) else mode, dtype=np.float64)
        if found.shape != mesh.points.shape:
            raise StudyError(
                f"by: the mode {name!r} of the nodes has the shape {found.shape}, must be "
                f"{mesh.points.shape}"
            )
        return Places((place, name), mesh, targets, found, np.zeros(1), scalar=True)
    axes = "xyz"[:dimension]
    if name not in tuple(axes):
        raise StudyError(
            f"by: {place!r} has no {name!r}; it has {listed(axes)}, or a mode that is given, "
            'by={"nodes": {"width": (points, dim) array}}'
        )
    nodes = mesh.nodes(side) if side else np.arange(points)
    targets[:] = -1
    targets[nodes] = np.arange(len(nodes))
    along = np.zeros((points, dimension))
    along[nodes, axes.index(name)] = 1.0
    return Places((place, name), mesh, targets, along, mesh.points[nodes, axes.index(name)])


def _known(place: str, name: str, found: Sequence[object], known: Sequence[str]) -> None:
    if not found:
        names = list(dict.fromkeys(known))
        raise StudyError(
            f"by: {place!r} has no {name!r}{meant(name, names)}; it has {listed(names)}"
        )


def _alike(place: str, name: str, values: Sequence[object]) -> None:
    """Raise StudyError for several statements of one place with different values."""
    if any(value is not values[0] and value != values[0] for value in values):
        raise StudyError(
            f"by: {place!r} has several values of {name!r}: give their places other names"
        )


def _given(force: Force) -> object:
    kernel: Any = force.kernel
    if isinstance(kernel, Spring):
        return kernel.stiffness
    return kernel.offset if isinstance(kernel, Tie) else kernel.value


def _words(force: Force) -> str:
    """As a load is asked for: "load:right"."""
    return f"{force.what}:{force.where}"


def _plain(where: object) -> str:
    return where if isinstance(where, str) else shown(where)
