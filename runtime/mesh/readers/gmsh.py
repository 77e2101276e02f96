"""Gmsh's mesh files, MSH 2.2, 4.0 and 4.1: every cell once, with all the names that it has.

Numbers of physical groups and of entities are counted for each dimension. A 2.2 file holds a cell
once for each of its groups; the others tell the groups of each entity.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import first_occurrences
from softehl.runtime.mesh.readers.file_content import Content

_KINDS = {cell.gmsh: name for name, cell in CELLS.items() if cell.gmsh}

Group = tuple[int, int]
"""Dimension and number of a physical group."""


class GmshError(SoftehlError, ValueError):
    """Error about a file."""


@dataclass
class _Source:
    """The bytes of a file, and where they are read next; numbers of text and binary files alike."""

    data: bytes
    at: int = 0
    binary: bool = False
    tokens: list[bytes] = field(default_factory=list)
    next: int = 0

    def line(self) -> str:
        """The next line, without its end."""
        end = self.data.find(b"\n", self.at)
        end = len(self.data) if end < 0 else end
        text, self.at = self.data[self.at : end].decode(errors="replace").strip(), end + 1
        return text

    def open(self, name: str) -> None:
        """Begin with the numbers of a section."""
        if not self.binary:
            end = self.data.find(f"$End{name}".encode(), self.at)
            self.tokens, self.next = self.data[self.at : end].split(), 0

    def close(self, name: str) -> None:
        """Go to the line behind a section."""
        end = self.data.find(f"$End{name}".encode(), self.at)
        if end < 0:
            raise GmshError(f"the file ends in ${name}")
        self.at = end
        self.line()

    def reals(self, count: int) -> Array:
        """The next numbers."""
        return np.asarray(self._next("f8", count), dtype=np.float64)

    def integers(self, kind: str, count: int) -> Integers:
        """The next whole numbers, of kind "i4" or "u8" in a binary file."""
        return np.asarray(self._next(kind, count)).astype(np.int64)

    def one(self, kind: str) -> int:
        """The next whole number."""
        return int(self.integers(kind, 1)[0])

    def _next(self, kind: str, count: int) -> Any:
        if self.binary:
            size = np.dtype(kind).itemsize * count
            values = np.frombuffer(self.data[self.at : self.at + size], dtype=f"<{kind}")
            self.at += size
        else:
            values = np.array(self.tokens[self.next : self.next + count], dtype=np.float64)
            self.next += count
        if len(values) < count:
            raise GmshError("a section is shorter than it says")
        return values


@dataclass
class _Parts:
    """State of reading.

    tags, points: of the nodes. rows: kind -> lists of node tags. groups: kind -> for each list the
    groups that all its cells are in. names: of groups. entities: their groups.
    """

    tags: list[Integers] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    rows: dict[str, list[Integers]] = field(default_factory=dict)
    groups: dict[str, list[list[Group]]] = field(default_factory=dict)
    names: dict[Group, str] = field(default_factory=dict)
    entities: dict[Group, list[Group]] = field(default_factory=dict)

    def add(self, kind: str, rows: Integers, groups: list[Group]) -> None:
        """Cells of one kind that are in the same groups."""
        self.rows.setdefault(kind, []).append(rows)
        self.groups.setdefault(kind, []).append(groups)


def parse(data: bytes) -> Content:
    """The content of a file.  Raises GmshError, ValueError or IndexError where it is damaged."""
    source, parts = _Source(data), _Parts()
    version = ""
    while source.at < len(data):
        title = source.line()
        if not title.startswith("$"):
            continue
        name = title[1:]
        if name == "MeshFormat":
            version = _version(source)
        elif name == "PhysicalNames":
            for _ in range(int(source.line())):
                dimension, number, quoted_name = source.line().split(maxsplit=2)
                parts.names[int(dimension), int(number)] = quoted_name.strip('"')
        elif (read := _SECTIONS.get((version[:1], name))) is not None:
            source.open(name)
            read(source, parts, version)
        source.close(name)
    return _content(parts)


def _version(source: _Source) -> str:
    version, binary, size = source.line().split()[:3]
    source.binary = binary == "1"
    if version[:2] not in ("2", "2.", "4", "4.") or (source.binary and version in ("4", "4.0")):
        raise GmshError(f"version {version}{' binary' * source.binary}: save it as 4.1 or 2.2")
    if size != "8" or (source.binary and source.one("i4") != 1):
        raise GmshError("a binary file of another kind of machine: save it as text")
    return version


def _nodes_2(source: _Source, parts: _Parts, version: str) -> None:
    count = int(source.line()) if source.binary else source.one("u8")
    if source.binary:
        size = 28 * count
        kind = np.dtype([("tag", "<i4"), ("x", "<f8", (3,))])
        table = np.frombuffer(source.data[source.at : source.at + size], dtype=kind)
        source.at += size
        parts.tags.append(table["tag"].astype(np.int64))
        parts.points.append(np.array(table["x"]))
    else:
        lines = source.reals(4 * count).reshape(count, 4)
        parts.tags.append(lines[:, 0].astype(np.int64))
        parts.points.append(lines[:, 1:])


def _parametric_2(source: _Source, parts: _Parts, version: str) -> None:
    """Nodes with the dimension and number of their entity, and their parameters on it."""
    count = int(source.line()) if source.binary else source.one("u8")
    tags, points = [], []
    for _ in range(count):
        tags.append(source.one("i4"))
        points.append(source.reals(3))
        dimension = int(source.integers("i4", 2)[0])
        source.reals(dimension if dimension < 3 else 0)
    parts.tags.append(np.array(tags, dtype=np.int64))
    parts.points.append(np.array(points).reshape(-1, 3))


def _cells_2(source: _Source, parts: _Parts, version: str) -> None:
    left = int(source.line()) if source.binary else source.one("u8")
    while left > 0:
        if source.binary:
            number, count, tags = source.integers("i4", 3).tolist()
        else:
            _, number, tags = source.integers("i4", 3).tolist()
            count = 1
        kind = _kind(number)
        width = tags + len(CELLS[kind].nodes) + int(source.binary)  # the cell's own number is first
        table = source.integers("i4", count * width).reshape(count, width)[:, int(source.binary) :]
        for group in np.unique(table[:, 0]) if tags else (0,):
            rows = table[:, 0] == group if tags else slice(None)
            groups = [(CELLS[kind].dimension, abs(int(group)))] if group else []
            parts.add(kind, table[rows, tags:], groups)
        left -= count


def _entities_4(source: _Source, parts: _Parts, version: str) -> None:
    for dimension, count in enumerate(source.integers("u8", 4).tolist()):
        for _ in range(count):
            tag = source.one("i4")
            source.reals(3 if dimension == 0 and version == "4.1" else 6)  # its box
            groups = source.integers("i4", source.one("u8")).tolist()
            # the sign of a group tells the direction of an entity
            parts.entities[dimension, tag] = [(dimension, abs(group)) for group in groups]
            if dimension:
                source.integers("i4", source.one("u8"))  # what bounds it


def _partitions_4(source: _Source, parts: _Parts, version: str) -> None:
    """Entities of a mesh in partitions, with the groups of what they are parts of."""
    source.one("u8")
    source.integers("i4", 2 * source.one("u8"))  # ghosts
    for dimension, count in enumerate(source.integers("u8", 4).tolist()):
        for _ in range(count):
            tag = int(source.integers("i4", 3)[0])
            source.integers("i4", source.one("u8"))  # its partitions
            source.reals(6 if dimension else 3)
            groups = source.integers("i4", source.one("u8")).tolist()
            parts.entities[dimension, tag] = [(dimension, abs(group)) for group in groups]
            if dimension:
                source.integers("i4", source.one("u8"))


def _nodes_4(source: _Source, parts: _Parts, version: str) -> None:
    if version != "4.1":
        for _ in range(int(source.integers("u8", 2)[0])):
            _, dimension, parametric = source.integers("i4", 3).tolist()
            width = 4 + (dimension if parametric else 0)
            lines = source.reals(width * (count := source.one("u8"))).reshape(count, width)
            parts.tags.append(lines[:, 0].astype(np.int64))
            parts.points.append(lines[:, 1:4])
        return
    for _ in range(int(source.integers("u8", 4)[0])):
        dimension, _, parametric = source.integers("i4", 3).tolist()
        count, width = source.one("u8"), 3 + (dimension if parametric else 0)
        parts.tags.append(source.integers("u8", count))
        parts.points.append(source.reals(count * width).reshape(count, width)[:, :3])


def _cells_4(source: _Source, parts: _Parts, version: str) -> None:
    for _ in range(int(source.integers("u8", 4 if version == "4.1" else 2)[0])):
        first, second, number = source.integers("i4", 3).tolist()
        entity = (first, second) if version == "4.1" else (second, first)
        kind, count = _kind(number), source.one("u8")
        width = 1 + len(CELLS[kind].nodes)
        rows = source.integers("u8", count * width).reshape(count, width)[:, 1:]
        parts.add(kind, rows, parts.entities.get(entity, []))


_SECTIONS = {
    ("2", "Nodes"): _nodes_2,
    ("2", "ParametricNodes"): _parametric_2,
    ("2", "Elements"): _cells_2,
    ("4", "Entities"): _entities_4,
    ("4", "PartitionedEntities"): _partitions_4,
    ("4", "Nodes"): _nodes_4,
    ("4", "ParametricNodes"): _nodes_4,
    ("4", "Elements"): _cells_4,
}


def _kind(number: int) -> str:
    if number not in _KINDS:
        allowed = ", ".join(_KINDS.values())
        raise GmshError(f"cells of Gmsh's type {number} are not known; known: {allowed}")
    return _KINDS[number]


def _content(file_parts: _Parts) -> Content:
    """Nodes by their places in the list, each cell once."""
    if not file_parts.points or not file_parts.rows:
        raise GmshError("there are no nodes or no cells")
    tags = np.concatenate(file_parts.tags)
    index_of_tag = np.full(int(tags.max()) + 1, -1)
    index_of_tag[tags] = np.arange(len(tags))
    cells: dict[str, Integers] = {}
    names: dict[str, dict[str, Integers]] = {name: {} for name in file_parts.names.values()}
    for kind, parts in file_parts.rows.items():
        rows = index_of_tag[np.concatenate(parts)]
        if rows.min() < 0:
            raise GmshError(f"a {kind} has a node that is not in the file")
        first, number = first_occurrences(rows)
        cells[kind] = rows[first][:, list(CELLS[kind].gmsh_nodes or range(rows.shape[1]))]
        bounds = np.cumsum([len(part) for part in parts])[:-1]
        members: dict[str, list[Integers]] = {}
        for numbers, groups in zip(np.split(number, bounds), file_parts.groups[kind], strict=True):
            for name in {file_parts.names[group] for group in groups if group in file_parts.names}:
                members.setdefault(name, []).append(numbers)
        for name, lists in members.items():
            names[name][kind] = np.unique(np.concatenate(lists))
    nonempty = {name: members for name, members in names.items() if members}
    return Content(np.concatenate(file_parts.points), cells, nonempty, tags)


def text(
    points: Array, cells: Mapping[str, Integers], names: Mapping[str, Mapping[str, Integers]]
) -> str:
    """A file of MSH 2.2, with a cell once for each of its names as Gmsh writes it.

    points: (n, 3). names: name -> kind -> numbers of cells of that kind.
    """
    groups: dict[Group, str] = {}
    for name, members in names.items():
        for dimension in sorted({CELLS[kind].dimension for kind in members}):
            groups[dimension, len(groups) + 1] = name
    plain: list[str] = []
    again: list[str] = []
    for kind, nodes in cells.items():
        inside: list[list[int]] = [[] for _ in nodes]
        for (dimension, number), name in groups.items():
            if dimension == CELLS[kind].dimension:
                for row in names[name].get(kind, ()):
                    inside[row].append(number)
        order = np.argsort(CELLS[kind].gmsh_nodes or range(nodes.shape[1]))
        for row, numbers in zip(nodes[:, order] + 1, inside, strict=True):
            entity = (numbers or [0])[0]
            for k, number in enumerate(numbers or [0]):
                line = f"{CELLS[kind].gmsh} 2 {number} {entity} {_joined(row)}"
                (again if k else plain).append(line)
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    described = [f'{d} {number} "{name}"' for (d, number), name in groups.items()]
    lines += ["$PhysicalNames", str(len(groups)), *described, "$EndPhysicalNames"]
    described = [f"{k} {_joined(x)}" for k, x in enumerate(points.tolist(), start=1)]
    lines += ["$Nodes", str(len(points)), *described, "$EndNodes"]
    described = [f"{k} {line}" for k, line in enumerate((*plain, *again), start=1)]
    lines += ["$Elements", str(len(described)), *described, "$EndElements"]
    return "\n".join(lines) + "\n"


def _joined(values: Iterable[float]) -> str:
    return " ".join(str(value) for value in values)
