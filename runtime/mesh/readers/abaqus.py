"""Mesh of an input file of Abaqus or CalculiX (.inp): nodes, elements, sets and surfaces; and back.

Read are *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *INCLUDE, *PART, *INSTANCE and *ASSEMBLY; what is
no mesh (materials, sections, steps) is passed over. Keywords that make nodes or elements by a rule
are refused by name. Case and blanks do not count in keywords and names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from softehl.errors import SoftehlError
from softehl.log import warn
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import first_occurrences, match_faces, unrepeated_faces
from softehl.runtime.mesh.readers.file_content import Content

_GENERATORS = {
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY", "NMAP"), "nodes"),
    **dict.fromkeys(("ELGEN", "ELCOPY"), "elements"),
    **dict.fromkeys(("SYSTEM", "SYMMETRICMODELGENERATION", "IMPORT"), "a mesh"),
}
"""Keywords that would make a mesh, and are not read."""
_SOLIDS = {n: name for name, c in CELLS.items() if c.abaqus == (f"C3D{(n := len(c.nodes))}",)}
_SOLID = rf"(?:D?C3D|DCC3D|AC3D|F3D|FC3D|EC3D|Q3D)({'|'.join(map(str, _SOLIDS))})(?!\d)"
_SHELL = r"(?:M3D|SFM3D|R3D|DS|S|STRI)(3|4|6|8|9)(?!\d)"
_PLANE = (
    r"(?:CPEG|CPE|CPS|CGAX|CAX|DC2D|DCAX|DCC2D|DCCAX|AC2D|ACAX|EC2D|Q2D|QAX)(3|4|6|8|9)(?![\d])"
)
_FAMILIES: tuple[tuple[str, str, dict[int, str]], ...] = (
    ("solid", r"C3D(15)V", {15: "wedge18"}),
    ("solid", _SOLID, _SOLIDS),
    ("solid", r"(?:SC|CSS)(6|8)(?!\d)", {6: "wedge6", 8: "hex8"}),
    ("plane", _PLANE, {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}),
    ("shell", r"STRI(65)", {65: "tri6"}),
    ("shell", _SHELL, {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}),
    ("line", r"(?:T[23]D|AC1D|D?CC?1D|R2D|RAX|RB2D|RB3D)(2|3)(?!\d)", {2: "line2", 3: "line3"}),
    ("line", r"(?:SAX|MAX|MGAX|DSAX)(1|2)(?!\d)", {1: "line2", 2: "line3"}),
    ("line", r"(?:B|PIPE|ELBOW)[23](1|2|3)(?!\d)", {1: "line2", 2: "line3", 3: "line2"}),
    ("line", r"(?:CONN[23]D2|FRAME[23]D|SPRING2|SPRINGA|DASHPOT2|DASHPOTA|GAPUNI)", {}),
    ("point", r"(?:MASS|ROTARYI|SPRING1|DASHPOT1|HEATCAP)", {}),
)
_TYPES = {
    dimension: {
        name: cell.abaqus[min(dimension, len(cell.abaqus) + 1) - 2]
        for name, cell in CELLS.items()
        if cell.abaqus and cell.dimension <= dimension
    }
    for dimension in (2, 3)
}
"""Elements that are written, by the number of coordinates."""
_ADVICE = "save the mesh with all its nodes and elements written out"


class AbaqusError(SoftehlError, ValueError):
    """Error about a file."""


@dataclass(frozen=True)
class _Line:
    """A line of a file, and where it stands, for messages."""

    text: str
    location: str


@dataclass(frozen=True)
class _Keyword:
    """A keyword in capitals without its star and blanks, its parameters, and where it stands."""

    name: str
    options: Mapping[str, str]
    location: str

    def option(self, name: str) -> str:
        """A parameter that must be there."""
        if not self.options.get(name):
            raise AbaqusError(f"{self.location}: *{self.name} needs {name}=")
        return self.options[name]


@dataclass
class _Set:
    """Members of a set of nodes or elements, as they are written: the instance that they are of,
    whether they are nodes or elements ("NSET", "ELSET"), and a number, a range or the name of
    another set.
    """

    name: str
    location: str
    members: list[tuple[str, str, int | range | str]] = field(default_factory=list)
    internal: bool = True


@dataclass
class _SurfaceCards:
    """Lines of a surface: name or number of elements or nodes, and a label of faces."""

    name: str
    location: str
    kind: str
    lines: list[tuple[str, str]] = field(default_factory=list)
    internal: bool = False


@dataclass
class _Scope:
    """Nodes, elements and sets of a part, of an instance, or of the model (with the assembly).

    elements: number -> kind, family and node numbers. sets: of "NSET" or "ELSET", by the names in
    capitals.
    """

    name: str = ""
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, str, tuple[int, ...]]] = field(default_factory=dict)
    sets: dict[tuple[str, str], _Set] = field(default_factory=dict)
    surfaces: dict[str, _SurfaceCards] = field(default_factory=dict)

    def set(self, kind: str, name: str, location: str) -> _Set:
        """The set of a name, which is made where it is new."""
        return self.sets.setdefault((kind, name.upper()), _Set(name, location))


# lines and keywords ---------------------------------------------------------------------------


def _lines(path: Path, base: Path, opened: tuple[Path, ...] = ()) -> Iterator[_Line]:
    """Lines that are no comments, those of included files in their place."""
    if path.resolve() in opened:
        raise AbaqusError(f"{path.name} includes itself")
    waiting: _Line | None = None
    for number, raw in enumerate(path.read_text("utf-8", "replace").splitlines(), start=1):
        text = raw.strip()
        if not text or text.startswith("**"):
            continue
        line = _Line(text, f"{path.name}, line {number}")
        if waiting is not None:  # a keyword that ended with a comma goes on, unless data begin
            if text[0] in "+-.0123456789":
                yield waiting
            else:
                line = _Line(f"{waiting.text}{text}", waiting.location)
            waiting = None
        if line.text.startswith("*") and line.text.endswith(","):
            waiting = line
            continue
        if not line.text.startswith("*"):
            yield line
            continue
        keyword = _keyword(line)
        source = keyword.options.get("INPUT")
        if keyword.name != "INCLUDE":
            yield line
        if keyword.name in ("INCLUDE", "NODE", "ELEMENT") and (source or keyword.name == "INCLUDE"):
            file = _file(keyword.option("INPUT"), (path.parent, base), line.location)
            yield from _lines(file, base, (*opened, path.resolve()))
    if waiting is not None:
        yield waiting


def _file(name: str, folders: Iterable[Path], location: str) -> Path:
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise AbaqusError(f"{location}: there is no file {name!r} to include")


def _fields(text: str) -> list[str]:
    """Parts between commas, without those at the end that are empty; commas in quotes are text."""
    if '"' in text:
        parts = re.findall(r'(?:"[^"]*"|[^,"])+|(?<=,)(?=,)|^(?=,)', text)
    else:
        parts = re.split(r',(?=(?:[^"]*"[^"]*")*[^"]*$)', text) if '"' in text else text.split(",")
    parts = [part.strip() for part in parts]
    while parts and not parts[-1]:
        parts.pop()
    return parts


def _keyword(line: _Line) -> _Keyword:
    name, *option_texts = _fields(line.text[1:])
    options = {}
    for part in option_texts:
        key, _, value = part.partition("=")
        options["".join(key.split()).upper()] = value.strip().strip('"')
    return _Keyword("".join(name.split()).upper(), options, line.location)


def _blocks(lines: Iterable[_Line]) -> Iterator[tuple[_Keyword, list[_Line]]]:
    """Keywords with their lines of data."""
    keyword: _Keyword | None = None
    data: list[_Line] = []
    for line in lines:
        if line.text.startswith("*"):
            if keyword is not None:
                yield keyword, data
            keyword, data = _keyword(line), []
        else:
            data.append(line)
    if keyword is not None:
        yield keyword, data


def _real(text: str, location: str) -> float:
    try:
        return float(text.upper().replace("D", "E")) if text else 0.0
    except ValueError:
        raise AbaqusError(f"{location}: {text!r} is no number") from None


def _integer(text: str, location: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise AbaqusError(f"{location}: {text!r} is no whole number") from None


# the model ------------------------------------------------------------------------------------


@dataclass
class _AbaqusModel:
    """State of reading: parts by names in capitals, instances, and what the model itself has.

    rings: a type of axisymmetric elements, if there are some.
    """

    root: _Scope = field(default_factory=_Scope)
    parts: dict[str, _Scope] = field(default_factory=dict)
    instances: dict[str, _Scope] = field(default_factory=dict)
    rings: str = ""
    current: _Scope = field(init=False)

    def __post_init__(self) -> None:
        self.current = self.root

    def read(self, keyword: _Keyword, data: list[_Line]) -> None:
        """Take up a keyword with its lines of data."""
        if keyword.name in _GENERATORS:
            raise AbaqusError(
                f"{keyword.location}: *{keyword.name} makes {_GENERATORS[keyword.name]} by a rule, "
                f"which is not read: {_ADVICE}"
            )
        read = _READERS.get(keyword.name)
        if read is not None:
            read(self, keyword, data)

    def nodes(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*NODE."""
        if keyword.options.get("SYSTEM", "R").upper() != "R":
            raise AbaqusError(
                f"{keyword.location}: *NODE, SYSTEM={keyword.options['SYSTEM']} is not read: "
                f"{_ADVICE}, in x, y, z"
            )
        existing, labels = self.current.nodes, []
        for line in data:
            first, *coordinates = _fields(line.text)
            label = _integer(first, line.location)
            x, y, z = ([_real(text, line.location) for text in coordinates[:3]] + [0.0] * 3)[:3]
            if existing.setdefault(label, (x, y, z)) != (x, y, z):
                raise AbaqusError(f"{line.location}: node {label} is given again, at another place")
            labels.append(label)
        self._add("NSET", keyword, labels)

    def elements(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*ELEMENT: as many numbers as its nodes, on one line or several."""
        family, kind = _kind(keyword)
        if "AX" in keyword.option("TYPE").upper():
            self.rings = keyword.option("TYPE")
        count, existing, labels = len(CELLS[kind].nodes), self.current.elements, []
        numbers: list[int] = []
        for line in data:
            numbers += [_integer(text, line.location) for text in _fields(line.text)]
            if len(numbers) <= count:
                continue
            label, nodes = numbers[0], tuple(numbers[1 : count + 1])
            if len(numbers) > count + 1 and family != "line":  # a beam may have a node beside it
                raise AbaqusError(
                    f"{line.location}: element {label} has {len(numbers) - 1} nodes, "
                    f"{keyword.options['TYPE']} has {count}"
                )
            nodes = tuple(nodes[k] for k in CELLS[kind].abaqus_nodes or range(count))
            if existing.setdefault(label, (kind, family, nodes)) != (kind, family, nodes):
                raise AbaqusError(
                    f"{line.location}: element {label} is given again, as another one"
                )
            labels.append(label)
            numbers = []
        if numbers:
            raise AbaqusError(
                f"{data[-1].location}: element {numbers[0]} has {len(numbers) - 1} nodes, "
                f"{keyword.options['TYPE']} has {count}"
            )
        self._add("ELSET", keyword, labels)

    def _add(self, kind: str, keyword: _Keyword, labels: Iterable[int]) -> None:
        """Put new nodes or elements into the set that their keyword names."""
        if keyword.options.get(kind):
            group = self.current.set(kind, keyword.options[kind], keyword.location)
            group.members += [("", kind, label) for label in labels]
            group.internal = False

    def sets(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*NSET and *ELSET."""
        options, kind = keyword.options, keyword.name
        group = self.current.set(kind, keyword.option(kind), keyword.location)
        group.internal &= "INTERNAL" in options
        instance = options.get("INSTANCE", "")
        if kind == "NSET" and options.get("ELSET"):
            group.members.append((instance, "ELSET", options["ELSET"]))
        for line in data:
            fields = _fields(line.text)
            if "GENERATE" in options:
                numbers = [_integer(text, line.location) for text in fields]
                first = numbers[0]
                last, step = [*numbers[1:], *(first, 1)[len(numbers) - 1 :]][:2]
                if step < 1:
                    raise AbaqusError(
                        f"{line.location}: GENERATE in steps of {step}, must be 1 or more"
                    )
                group.members.append((instance, kind, range(first, last + 1, step)))
            else:
                group.members += [
                    (instance, kind, int(text) if text.isdigit() else text.strip('"'))
                    for text in fields
                    if text
                ]

    def surface(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*SURFACE of faces or nodes, or a union of others."""
        name = keyword.option("NAME")
        kind = keyword.options.get("TYPE", "ELEMENT").upper()
        if "COMBINE" in keyword.options:
            kind = keyword.options["COMBINE"].upper()
        if kind not in ("ELEMENT", "NODE", "UNION"):
            warn(
                f"{keyword.location}: the surface {name!r} is left out, {kind} is not read: faces "
                "of elements and nodes are",
                stacklevel=2,
            )
            return
        target = self.current.surfaces.setdefault(
            name.upper(),
            _SurfaceCards(name, keyword.location, kind, [], "INTERNAL" in keyword.options),
        )
        for line in data:
            fields = _fields(line.text)
            if kind == "UNION":
                target.lines += [(text.strip('"'), "") for text in fields]
            else:
                label = fields[1].upper() if len(fields) > 1 and kind == "ELEMENT" else ""
                target.lines.append((fields[0].strip('"'), label))

    def part(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*PART."""
        name = keyword.option("NAME")
        self.current = self.parts[name.upper()] = _Scope(name)

    def instance(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*INSTANCE: a part that is moved and turned."""
        name, part = keyword.option("NAME"), keyword.option("PART")
        if part.upper() not in self.parts:
            raise AbaqusError(f"{keyword.location}: there is no part {part!r}")
        source = self.parts[part.upper()]
        numbers = [[_real(text, line.location) for text in _fields(line.text)] for line in data]
        moved = _moved(source.nodes, numbers, keyword.location)
        sets = {
            k: _Set(s.name, s.location, list(s.members), s.internal) for k, s in source.sets.items()
        }
        surfaces = {
            k: _SurfaceCards(s.name, s.location, s.kind, list(s.lines), s.internal)
            for k, s in source.surfaces.items()
        }
        self.current = _Scope(name, moved, dict(source.elements), sets, surfaces)
        self.instances[name.upper()] = self.current

    def end(self, keyword: _Keyword, data: list[_Line]) -> None:
        """*END PART and *END INSTANCE."""
        self.current = self.root


_READERS = {
    "NODE": _AbaqusModel.nodes,
    "ELEMENT": _AbaqusModel.elements,
    "NSET": _AbaqusModel.sets,
    "ELSET": _AbaqusModel.sets,
    "SURFACE": _AbaqusModel.surface,
    "PART": _AbaqusModel.part,
    "INSTANCE": _AbaqusModel.instance,
    "ENDPART": _AbaqusModel.end,
    "ENDINSTANCE": _AbaqusModel.end,
}


def _kind(keyword: _Keyword) -> tuple[str, str]:
    """Family and kind of the cells of an *ELEMENT."""
    name = keyword.option("TYPE").upper()
    for family, pattern, kinds in _FAMILIES:
        match = re.match(pattern, name)
        if match:
            if not kinds:
                return family, "line2" if family == "line" else "point1"
            return family, kinds[int(match[1])]
    allowed = ", ".join(name for k, name in _TYPES[3].items() if CELLS[k].dimension == 3)
    raise AbaqusError(
        f"{keyword.location}: elements {name} have no cell here; there are {allowed}, CPS3/4/6/8 "
        "and CPE, CAX, S, M3D likewise, T3D2/3, B31/32 and their variants"
    )


def _moved(
    nodes: Mapping[int, tuple[float, float, float]], data: Sequence[Sequence[float]], location: str
) -> dict[int, tuple[float, float, float]]:
    """Nodes of an instance: first shifted, then turned about an axis through two points."""
    if not data or not nodes:
        return dict(nodes)
    points = np.array(list(nodes.values())) + np.pad(data[0][:3], (0, 3 - len(data[0][:3])))
    if len(data) > 1:
        if len(data[1]) != 7:
            raise AbaqusError(f"{location}: a rotation has two points and an angle, 7 numbers")
        a, b, angle = np.array(data[1][:3]), np.array(data[1][3:6]), math.radians(data[1][6])
        n = (b - a) / np.linalg.norm(b - a)
        r = points - a
        across = np.cross(n, r)
        points = points + math.sin(angle) * across + (1 - math.cos(angle)) * np.cross(n, across)
    return dict(zip(nodes, map(tuple, points.tolist()), strict=True))


# from numbers in the file to those of the mesh ---------------------------------------------------

Side = dict[str, list[tuple[int, ...]]]
"""Kind -> faces by their nodes."""


@dataclass
class _Mesh:
    """The mesh of a model: nodes and cells of all scopes with one numbering.

    scopes: by names in capitals, "" of the model. node, element: scope and number in the file ->
    number here. cells: kind, row of its kind and family of each element here.
    """

    scopes: Mapping[str, _Scope]
    points: list[tuple[float, float, float]] = field(default_factory=list)
    rows: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    node: dict[str, dict[int, int]] = field(default_factory=dict)
    element: dict[str, dict[int, int]] = field(default_factory=dict)
    cells: list[tuple[str, int, str]] = field(default_factory=list)
    free: dict[str, set[tuple[int, ...]]] | None = None

    def __post_init__(self) -> None:
        for key, scope in self.scopes.items():
            first = len(self.points)
            self.node[key] = number = {label: first + k for k, label in enumerate(scope.nodes)}
            self.points += scope.nodes.values()
            self.element[key] = numbers = {}
            for label, (kind, family, nodes) in scope.elements.items():
                rows = self.rows.setdefault(kind, [])
                try:
                    rows.append(tuple([number[n] for n in nodes]))
                except KeyError as error:
                    raise AbaqusError(
                        f"element {label} has node {error}, which is not in the file"
                    ) from None
                numbers[label] = len(self.cells)
                self.cells.append((kind, len(rows) - 1, family))

    def members(self, kind: str, key: str, name: str, seen: tuple[str, ...] = ()) -> list[int]:
        """Nodes or elements of a set of a scope."""
        group = self.scopes[key].sets.get((kind, name.upper()))
        if group is None:
            raise AbaqusError(f"there is no {kind} {name!r}, which another set or surface names")
        if name.upper() in seen:
            return []
        numbers: list[int] = []
        for instance, what, member in group.members:
            inside = self.one(what, self.scope(instance, key), member, (*seen, name.upper()))
            if what != kind:
                inside = [n for e in inside for n in self.rows[self.cells[e][0]][self.cells[e][1]]]
            numbers += inside
        return numbers

    def by_kind(self, numbers: Sequence[int], dimensions: Sequence[int]) -> dict[str, Integers]:
        """Kind -> rows of elements of these dimensions, rising."""
        members: dict[str, set[int]] = {}
        for number in numbers:
            kind, row, _ = self.cells[number]
            if CELLS[kind].dimension in dimensions:
                members.setdefault(kind, set()).add(row)
        return {kind: np.array(sorted(rows)) for kind, rows in members.items()}

    def scope(self, instance: str, key: str) -> str:
        """The scope of an instance, else the same."""
        if instance and instance.upper() not in self.scopes:
            raise AbaqusError(f"there is no instance {instance!r}")
        return instance.upper() or key

    def one(
        self, kind: str, key: str, member: int | range | str, seen: tuple[str, ...] = ()
    ) -> list[int]:
        """Nodes or elements that are meant by a number, a range or a name in a scope."""
        labels = self.node[key] if kind == "NSET" else self.element[key]
        if isinstance(member, range):
            few = member if len(member) <= len(labels) else (n for n in labels if n in member)
            return [labels[n] for n in few if n in labels]
        if isinstance(member, int):
            if member not in labels:
                what = "node" if kind == "NSET" else "element"
                raise AbaqusError(f"a set or surface has {what} {member}, which is not in the file")
            return [labels[member]]
        instance, dot, label = member.rpartition(".")
        plain = (kind, member.upper()) in self.scopes[key].sets
        if dot and not plain and instance.upper() in self.scopes:
            return self.one(kind, instance.upper(), int(label) if label.isdigit() else label)
        return self.members(kind, key, member, seen)

    def side(self, key: str, surface: _SurfaceCards) -> Side:
        """Faces of a surface; its nodes, where it is of nodes."""
        entities: Side = {}
        if surface.kind == "UNION":
            for name, _ in surface.lines:
                other = self.scopes[key].surfaces.get(name.upper())
                if other is None or other is surface:
                    raise AbaqusError(f"{surface.location}: there is no surface {name!r}")
                for kind, faces in self.side(key, other).items():
                    entities.setdefault(kind, []).extend(faces)
            return entities
        for name, label in surface.lines:
            member = int(name) if name.isdigit() else name
            if surface.kind == "NODE":
                nodes = [(n,) for n in self.one("NSET", key, member)]
                entities.setdefault("point1", []).extend(nodes)
                continue
            for element in self.one("ELSET", key, member):
                for kind, face in self.faces(element, label, surface):
                    entities.setdefault(kind, []).append(face)
        return entities

    def faces(
        self, element: int, label: str, surface: _SurfaceCards
    ) -> Iterable[tuple[str, tuple[int, ...]]]:
        """Faces of an element that a label means; without one those on the outside."""
        kind, row, family = self.cells[element]
        nodes = self.rows[kind][row]
        if not label and family in ("solid", "plane"):
            faces = [
                (face.name, tuple(nodes[k] for k in local))
                for face, local in CELLS[kind].side_nodes
            ]
            return [f for f in faces if tuple(sorted(f[1])) in self.outside(f[0])]
        number = _face_number(family, label)
        if number is None or number > len(CELLS[kind].side_nodes):
            raise AbaqusError(f"{surface.location}: a {kind} has no face {label!r}")
        if number > 0:
            face, local = CELLS[kind].side_nodes[number - 1]
            return [(face.name, tuple(nodes[k] for k in local))]
        return [(kind, nodes if number == 0 else tuple(nodes[k] for k in CELLS[kind].mirrored))]

    def outside(self, kind: str) -> set[tuple[int, ...]]:
        """Faces that one cell alone has, by their sorted nodes."""
        if self.free is None:
            lists: dict[str, list[Integers]] = {}
            for cell, rows in self.rows.items():
                for face, local in CELLS[cell].side_nodes:
                    lists.setdefault(face.name, []).append(np.array(rows)[:, list(local)])
            self.free = {
                k: set(
                    map(
                        tuple,
                        np.sort(unrepeated_faces(np.concatenate(v), CELLS[k].corners), 1).tolist(),
                    )
                )
                for k, v in lists.items()
            }
        return self.free[kind]


def _face_number(family: str, label: str) -> int | None:
    """Number of a face from 1; 0 of the cell itself, -1 of the cell turned over."""
    label = {"": "SPOS", "SP": "SPOS", "SN": "SNEG"}.get(label, label)
    if family != "solid" and label in ("SPOS", "SNEG"):
        return 0 if label == "SPOS" else -1
    match = re.fullmatch(r"([SE])(\d+)", label)
    if match is None or (match[1] == "E" and family != "shell"):
        return None
    number = int(match[2])
    if family == "shell" and match[1] == "S":  # CalculiX: its lower and upper face, then edges
        return {1: -1, 2: 0}.get(number, number - 2)
    return number


def read(path: Path) -> Content:
    """Content of a file.  Raises AbaqusError, OSError."""
    model = _AbaqusModel()
    for keyword, data in _blocks(_lines(path, path.parent)):
        model.read(keyword, data)
    if model.rings:
        warn(
            f'elements {model.rings} are rings about y, those of geometry="axisymmetric" about x: '
            "turn the mesh, mesh.map(lambda x: np.column_stack([-x[:, 1], x[:, 0]]))",
            stacklevel=2,
        )
    if model.parts and not model.instances:  # parts without an assembly, as they are
        model.instances = model.parts
    mesh = _Mesh({"": model.root, **model.instances})
    if not mesh.points or not mesh.cells:
        raise AbaqusError("there are no nodes or no elements")
    cells = {kind: np.array(rows, dtype=np.int64) for kind, rows in mesh.rows.items()}
    top = max(CELLS[kind].dimension for kind in cells)
    groups, faces, surfaces, nodes = _Names(), _Names(), _Names(), _Names()
    for key, scope in mesh.scopes.items():
        if len(model.instances) > 1 and key and scope.elements:
            numbers = list(mesh.element[key].values())
            groups.add(scope.name, "", mesh.by_kind(numbers, [top]))
        for (kind, upper), group in scope.sets.items():
            if group.internal:
                continue
            numbers = mesh.members(kind, key, upper)
            if kind == "NSET":
                points = np.unique(np.array(numbers, dtype=np.int64))
                nodes.add(group.name, scope.name, {"point1": points[:, None]})
                continue
            groups.add(group.name, scope.name, mesh.by_kind(numbers, [top]))
            for dimension in range(top - 1, -1, -1):
                lower = mesh.by_kind(numbers, [dimension])
                if lower:
                    members = {k: cells[k][rows] for k, rows in lower.items()}
                    faces.add(group.name, scope.name, members)
                    break
        for surface in scope.surfaces.values():
            if not surface.internal:
                side = {k: np.array(v) for k, v in mesh.side(key, surface).items()}
                side = {k: v[np.sort(first_occurrences(v)[0])] for k, v in side.items()}
                surfaces.add(surface.name, scope.name, side)
    sides = surfaces.named()
    for names, ending in ((faces, ".elements"), (nodes, ".nodes")):
        names_by_upper = {name.upper(): name for name in sides}
        for name, side_too in names.named().items():
            if name.upper() not in names_by_upper:
                sides[name] = side_too
            elif not np.array_equal(_nodes(sides[names_by_upper[name.upper()]]), _nodes(side_too)):
                sides[name + ending] = side_too
    return Content(np.array(mesh.points), cells, groups.named(), sides=sides)


def _nodes(side: Mapping[str, Integers]) -> Integers:
    return np.unique(np.concatenate([np.empty(0, np.int64), *map(np.ravel, side.values())]))


@dataclass
class _Names:
    """Named members of the model or of an instance: name, instance, kind -> numbers or faces."""

    entries: list[tuple[str, str, Mapping[str, Integers]]] = field(default_factory=list)

    def add(self, name: str, scope: str, members: Mapping[str, Integers]) -> None:
        """One more, if it has members."""
        if any(map(len, members.values())):
            self.entries.append((name, scope, members))

    def named(self) -> dict[str, Mapping[str, Integers]]:
        """By their names, with that of the instance before it where a name stands twice."""
        counts: dict[str, int] = {}
        for name, _, _ in self.entries:
            counts[name.upper()] = counts.get(name.upper(), 0) + 1
        return {
            f"{scope}.{name}" if scope and counts[name.upper()] > 1 else name: members
            for name, scope, members in self.entries
        }


# writing ------------------------------------------------------------------------------------------


def text(
    points: Array,
    cells: Mapping[str, Integers],
    groups: Mapping[str, Mapping[str, Integers]],
    sides: Mapping[str, Mapping[str, Integers]],
    dimension: int,
) -> str:
    """A file that reads back as the same mesh.  Raises AbaqusError.

    points: (n, 3). Groups are sets of elements, sides are surfaces where their faces are those of
    cells, sets of nodes where they are nodes, else elements of their own with a name.
    """
    types = _TYPES[max(dimension, 2)]
    lines = ["*HEADING", "mesh", "*NODE"]
    lines += [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(points.tolist(), start=1)]
    first, count = {}, 0
    for kind, nodes in cells.items():
        first[kind] = count + 1
        lines += [f"*ELEMENT, TYPE={types[kind]}", *_element_lines(kind, nodes, count + 1)]
        count += len(nodes)
    names: dict[tuple[str, str], str] = {}
    for name, members in groups.items():
        numbers = [n for kind, rows in members.items() for n in (rows + first[kind]).tolist()]
        lines += [f"*ELSET, ELSET={_quoted(name, 'ELSET', names)}", *_rows(numbers)]
    for name, faces in sides.items():
        labels, unlabelled = _labels(cells, faces, first, types)
        if labels:
            lines += [f"*SURFACE, NAME={_quoted(name, 'SURFACE', names)}, TYPE=ELEMENT", *labels]
        for kind, nodes in unlabelled.items():
            if kind == "point1":
                lines += [f"*NSET, NSET={_quoted(name, 'NSET', names)}"]
                lines += _rows((nodes.ravel() + 1).tolist())
            else:
                title = f"*ELEMENT, TYPE={types[kind]}, ELSET={_quoted(name, 'side', names)}"
                lines += [title, *_element_lines(kind, nodes, count + 1)]
                count += len(nodes)
    return "\n".join(lines) + "\n"


def _element_lines(kind: str, nodes: Integers, first: int) -> list[str]:
    order = np.argsort(CELLS[kind].abaqus_nodes or range(nodes.shape[1]))
    lines = []
    for label, row in enumerate((nodes[:, order] + 1).tolist(), start=first):
        lines += _rows([label, *row])
    return lines


def _rows(numbers: Sequence[int]) -> list[str]:
    """Numbers in lines of at most 16, all but the last of which end with a comma."""
    parts = [numbers[k : k + 16] for k in range(0, len(numbers), 16)]
    return [", ".join(map(str, part)) + "," * (part is not parts[-1]) for part in parts]


def _quoted(name: str, kind: str, existing: dict[tuple[str, str], str]) -> str:
    """A name as it is written; Abaqus does not tell capitals from small letters."""
    other = existing.setdefault((kind, name.upper()), name)
    if other != name:
        raise AbaqusError(f"{other!r} and {name!r} are one name in a file of Abaqus")
    if any(letter in name for letter in '"\n\r'):
        raise AbaqusError(f"{name!r} cannot be a name in a file of Abaqus")
    return name if re.fullmatch(r"[A-Za-z_][\w:-]*", name) else f'"{name}"'


def _labels(
    cells: Mapping[str, Integers],
    faces: Mapping[str, Integers],
    first: Mapping[str, int],
    types: Mapping[str, str],
) -> tuple[list[str], dict[str, Integers]]:
    """Lines of a surface, and the faces that are none of a cell."""
    lines, unlabelled = [], {}
    for kind, nodes in faces.items():
        left = np.arange(len(nodes)) if kind != "point1" else np.arange(0)
        for cell, rows in cells.items():
            family = next(f for f, pattern, _ in _FAMILIES if re.match(pattern, types[cell]))
            for number, (face, local) in enumerate(CELLS[cell].side_nodes, start=1):
                if face.name == kind:
                    row = match_faces(nodes[left], rows[:, list(local)], face.corners)
                    label = f"{'E' if family == 'shell' else 'S'}{number}"
                    lines += [f"{first[cell] + k}, {label}" for k in row[row >= 0].tolist()]
                    left = left[row < 0]
            if cell == kind and family == "shell":
                row = match_faces(nodes[left], rows, CELLS[cell].corners)
                for k, face_nodes in zip(row[row >= 0], nodes[left[row >= 0]], strict=True):
                    upper = _runs_along(face_nodes, rows[k], CELLS[kind].corners)
                    lines.append(f"{first[cell] + int(k)}, {'SPOS' if upper else 'SNEG'}")
                left = left[row < 0]
        if kind == "point1" or len(left):
            unlabelled[kind] = nodes if kind == "point1" else nodes[left]
    return lines, unlabelled


def _runs_along(face: Integers, cell: Integers, corners: int) -> bool:
    """True if the nodes of a face run the way round of the cell with the same corners."""
    start = int(np.flatnonzero(cell[:corners] == face[0])[0])
    return bool(cell[(start + 1) % corners] == face[1])
