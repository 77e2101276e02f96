"""Universal files of I-DEAS (.unv): nodes (dataset 2411), elements (2412) and groups (2435, 2452,
2467, 2477); and back, with groups as 2467.

Other datasets are passed over. Nodes and elements of older datasets, and nodes in a coordinate
system of their own (2420), are refused by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softehl.errors import SoftehlError
from softehl.log import warn
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import first_occurrences
from softehl.runtime.mesh.readers.file_content import Content
from softehl.runtime.suggestions import join_names

_NODES, _ELEMENTS, _SYSTEMS, _GROUPS = 2411, 2412, 2420, (2435, 2452, 2467, 2477)
_OLDER = {15: _NODES, 781: _NODES, 71: _ELEMENTS, 780: _ELEMENTS}
"""Older datasets of nodes and elements, and what holds them now."""
_OLDER_GROUPS = (752, 2417, 2429, 2430, 2432)
_NODE, _ELEMENT = 7, 8
"""Codes of the members of groups."""
_TYPES = {
    "point1": (161,),
    "line2": (21, 11, 22, 31, 121),
    "line3": (24, 23, 32),
    "tri3": (91, 41, 51, 61, 74, 81),
    "tri6": (92, 42, 52, 62, 72, 82),
    "quad4": (94, 44, 54, 64, 71, 84),
    "quad8": (95, 45, 55, 65, 75, 85),
    "tet4": (111,),
    "tet10": (118,),
    "pyramid5": (312,),
    "wedge6": (112, 101),
    "wedge15": (113, 102),
    "hex8": (115, 104),
    "hex20": (116, 105),
}
"""Numbers of the elements that are read as a kind of cell; the first is written in space, the
second in the plane.
"""
_KINDS = {number: kind for kind, numbers in _TYPES.items() for number in numbers}
_BEAMS = range(11, 33)
"""Elements with a line about their section before that of their nodes."""
_ORDER = {
    "line3": (0, 2, 1),
    "tri6": (0, 2, 4, 1, 3, 5),
    "quad8": (0, 2, 4, 6, 1, 3, 5, 7),
    "tet10": (0, 2, 4, 9, 1, 3, 5, 6, 7, 8),
    "wedge15": (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8),
    "hex20": (
        *range(0, 8, 2),
        *range(12, 20, 2),
        *range(1, 8, 2),
        *range(13, 20, 2),
        *range(8, 12),
    ),
}
"""Our nodes as numbers of theirs: around the lower face, upwards, around the upper face."""
_LONGEST = 40
"""Letters of the name of a group."""


class UnvError(SoftehlError, ValueError):
    """Error about a file."""


@dataclass
class _Model:
    """State of reading.

    nodes: label -> coordinate system and place in the list. elements: label -> kind and row.
    systems: labels of those that are not the global one. members: name -> code -> labels.
    """

    nodes: dict[int, tuple[int, int]] = field(default_factory=dict)
    points: list[list[float]] = field(default_factory=list)
    rows: dict[str, list[list[int]]] = field(default_factory=dict)
    elements: dict[int, tuple[str, int]] = field(default_factory=dict)
    systems: set[int] = field(default_factory=set)
    members: dict[str, dict[int, list[int]]] = field(default_factory=dict)
    older: set[int] = field(default_factory=set)


def read(path: Path) -> Content:
    """Content of a file.  Raises UnvError, ValueError, OSError."""
    model = _Model()
    for number, lines in _datasets(path.read_text("utf-8", "replace").splitlines()):
        if number in _OLDER:
            raise UnvError(
                f"dataset {number} is an older form of {_OLDER[number]}, which is read: save the "
                "mesh in a newer version"
            )
        try:
            if number == _NODES:
                _read_nodes(model, lines)
            elif number == _ELEMENTS:
                _read_elements(model, lines)
            elif number == _SYSTEMS:
                _read_systems(model, lines)
            elif number in _GROUPS:
                _read_group(model, lines)
        except StopIteration:
            raise UnvError(f"dataset {number} ends in the middle") from None
        if number in _OLDER_GROUPS:
            model.older.add(number)
    if not model.points or not model.rows:
        raise UnvError("there are no nodes (dataset 2411) or no elements (2412)")
    turned = sorted({s for s, _ in model.nodes.values()} & model.systems)
    if turned:
        raise UnvError(f"nodes are in coordinate system {turned[0]}: save them in the global one")
    if model.older:
        warn(
            f"groups of dataset {join_names(map(str, sorted(model.older)))} are left out; those of "
            f"{join_names(map(str, _GROUPS))} are read",
            stacklevel=2,
        )
    return _content(model)


def _datasets(lines: Iterable[str]) -> Iterator[tuple[int, Iterator[str]]]:
    """Numbers and lines of the datasets, which stand between lines of -1."""
    inside: list[str] | None = None
    for line in lines:
        if line.strip() != "-1":
            if inside is not None:
                inside.append(line)
        elif inside is None:
            inside = []
        else:
            if inside:
                yield int(inside[0].split()[0]), iter(inside[1:])
            inside = None
    if inside is not None:
        raise UnvError("the file ends in a dataset")


def _integers(line: str) -> list[int]:
    return [int(text) for text in line.split()]


def _reals(line: str) -> list[float]:
    return [float(text) for text in line.upper().replace("D", "E").split()]


def _read_nodes(model: _Model, lines: Iterator[str]) -> None:
    for line in lines:
        label, system, *_ = _integers(line)
        if label in model.nodes:
            raise UnvError(f"node {label} is given again")
        model.nodes[label] = system, len(model.points)
        point = _reals(next(lines))
        if len(point) != 3:
            raise UnvError(f"node {label} has {len(point)} coordinates, must be 3")
        model.points.append(point)


def _read_elements(model: _Model, lines: Iterator[str]) -> None:
    for line in lines:
        fields = _integers(line)
        label, number, count = fields[0], fields[1], fields[5]
        if number not in _KINDS:
            allowed = ", ".join(f"{n[0]} ({kind})" for kind, n in _TYPES.items())
            raise UnvError(f"element {label}: type {number} has no cell here; there are {allowed}")
        if number in _BEAMS:
            next(lines)
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += _integers(next(lines))
        kind = _KINDS[number]
        order = _ORDER.get(kind, range(len(CELLS[kind].nodes)))
        if len(nodes) != len(order):
            raise UnvError(
                f"element {label} has {len(nodes)} nodes, type {number} ({kind}) has {len(order)}"
            )
        if label in model.elements:
            raise UnvError(f"element {label} is given again")
        rows = model.rows.setdefault(kind, [])
        model.elements[label] = kind, len(rows)
        rows.append([nodes[k] for k in order])


def _read_systems(model: _Model, lines: Iterator[str]) -> None:
    """Two lines of the part, then six of each system: label and type, name, axes, origin."""
    next(lines), next(lines)
    for line in lines:
        label, kind, *_ = _integers(line)
        next(lines)
        axes = np.array([_reals(next(lines)) for _ in range(4)])
        if kind or not np.array_equal(axes, np.eye(4, 3)):
            model.systems.add(label)


def _read_group(model: _Model, lines: Iterator[str]) -> None:
    """Groups of a dataset: their size, their name, and two members a line of four numbers each."""
    for line in lines:
        count = _integers(line)[7]
        name = next(lines).strip()
        numbers: list[int] = []
        while len(numbers) < 4 * count:
            numbers += _integers(next(lines))
        members = model.members.setdefault(name, {})
        for code, label in zip(numbers[::4], numbers[1::4], strict=True):
            members.setdefault(code, []).append(label)


def _content(model: _Model) -> Content:
    cells: dict[str, Integers] = {}
    positions: dict[str, Integers] = {}
    for kind, rows in model.rows.items():
        absent = next((n for row in rows for n in row if n not in model.nodes), None)
        if absent is not None:
            raise UnvError(f"a {kind} has node {absent}, which is not in the file")
        numbers = np.array([[model.nodes[n][1] for n in row] for row in rows])
        first, positions[kind] = first_occurrences(numbers)
        cells[kind] = numbers[first]
    names: dict[str, dict[str, Integers]] = {}
    sides: dict[str, dict[str, Integers]] = {}
    for name, members in model.members.items():
        by_kind: dict[str, list[int]] = {}
        for label in members.get(_ELEMENT, ()):
            if label not in model.elements:
                raise UnvError(f"group {name!r} has element {label}, which is not in the file")
            kind, row = model.elements[label]
            by_kind.setdefault(kind, []).append(int(positions[kind][row]))
        names[name] = {kind: np.unique(rows) for kind, rows in by_kind.items()}
        if _NODE in members:
            absent = next((n for n in members[_NODE] if n not in model.nodes), None)
            if absent is not None:
                raise UnvError(f"group {name!r} has node {absent}, which is not in the file")
            nodes = np.unique([model.nodes[n][1] for n in members[_NODE]])
            sides[name] = {"point1": nodes[:, None]}
    return Content(np.array(model.points), cells, names, sides=sides)


# writing ------------------------------------------------------------------------------------------


def text(
    points: Array,
    cells: Mapping[str, Integers],
    names: Mapping[str, Mapping[str, Integers]],
    dimension: int,
) -> str:
    """A file that reads back as the same mesh.  Raises UnvError.

    points: (n, 3). cells: those of the mesh and the faces of its sides. names: name -> kind ->
    numbers of cells of that kind; those of points are groups of nodes.
    """
    for kind in cells:
        if kind not in _TYPES:
            raise UnvError(f"{kind} has no type in a .unv file; there are {', '.join(_TYPES)}")
    lines = ["    -1", f"{_NODES:6d}"]
    for label, point in enumerate(points.tolist(), start=1):
        lines += [_line((label, 1, 1, 11)), "".join(f"{x:25.16E}".replace("E", "D") for x in point)]
    lines += ["    -1", "    -1", f"{_ELEMENTS:6d}"]
    first, count = {}, 0
    for kind, nodes in cells.items():
        if kind == "point1":  # groups of nodes
            continue
        first[kind] = count + 1
        numbers = _TYPES[kind]
        number = numbers[1] if dimension == 2 == CELLS[kind].dimension else numbers[0]
        order = np.argsort(_ORDER.get(kind, range(nodes.shape[1])))
        for row in (nodes[:, order] + 1).tolist():
            count += 1
            lines.append(_line((count, number, 1, 1, 7, len(row))))
            if number in _BEAMS:
                lines.append(_line((0, 1, 1)))
            lines += [_line(row[k : k + 8]) for k in range(0, len(row), 8)]
    lines += ["    -1"]
    if names:
        lines += ["    -1", f"{_GROUPS[2]:6d}"]
        for label, (name, members) in enumerate(names.items(), start=1):
            entities = [
                (_NODE, node + 1) if kind == "point1" else (_ELEMENT, first[kind] + node)
                for kind, rows in members.items()
                for node in (cells[kind][rows].ravel() if kind == "point1" else rows).tolist()
            ]
            lines += [_line((label, 0, 0, 0, 0, 0, 0, len(entities))), _checked(name)]
            flat = [n for code, number in entities for n in (code, number, 0, 0)]
            lines += [_line(flat[k : k + 8]) for k in range(0, len(flat), 8)]
        lines += ["    -1"]
    return "\n".join(lines) + "\n"


def _line(numbers: Sequence[int]) -> str:
    return "".join(f"{n:10d}" for n in numbers)


def _checked(name: str) -> str:
    """The name of a group."""
    if len(name) > _LONGEST or name != " ".join(name.splitlines()).strip() or name in ("", "-1"):
        raise UnvError(
            f"{name!r} cannot be a name in a .unv file: at most {_LONGEST} letters on one line, "
            "without blanks at its ends"
        )
    return name
