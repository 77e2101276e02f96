"""Files for ParaView: one .vtu, or one for each process and a .pvtu that names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.argument_checks import writable
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.discretisation.dofmap import AXES
from softehl.runtime.equations.interpolation import at_every_node
from softehl.runtime.io import attribute, replacing, write_text
from softehl.runtime.mesh.cells import CELLS, linear_pieces
from softehl.runtime.mesh.readers.meshio import import_meshio

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System
    from softehl.runtime.results.result import Result


Fields = Callable[[str], dict[str, Array]]
"""Fields at the quadrature points of a block."""


@dataclass(frozen=True, eq=False)
class VtuFields:
    """Mesh and fields of a file.

    points: (n, dim). cells: kind -> nodes (m, k). nodal: name -> (n,). cellwise: name -> kind ->
    (m,).
    """

    points: Array
    cells: Mapping[str, Integers]
    nodal: Mapping[str, Array]
    cellwise: Mapping[str, Mapping[str, Array]]

    @classmethod
    def of(
        cls,
        points: Array,
        cells: Mapping[str, Integers],
        nodal: Mapping[str, Array],
        blocks: Mapping[str, Block],
        fields: Fields,
    ) -> VtuFields:
        """With the means of the fields, (cells, points), of blocks that stand on these cells."""
        rows = {kind: {tuple(r): k for k, r in enumerate(n.tolist())} for kind, n in cells.items()}
        cellwise: dict[str, dict[str, Array]] = {}
        for name, block in blocks.items():
            if block.kind not in cells or not block.kernel.fields:
                continue
            cell_numbers = [rows[block.kind][tuple(row)] for row in block.nodes.tolist()]
            for label, values in fields(name).items():
                data = {kind: np.full(len(nodes), np.nan) for kind, nodes in cells.items()}
                data[block.kind][cell_numbers] = values.mean(axis=1)
                cellwise[f"{name}.{label}"] = data
        return cls(points, cells, nodal, cellwise)

    def compact(self) -> VtuFields:
        """Without the points that no cell has."""
        used = np.unique(np.concatenate([np.empty(0, np.int64), *map(np.ravel, _lists(self))]))
        number = np.zeros(len(self.points), dtype=np.int64)
        number[used] = np.arange(len(used))
        cells = {kind: number[nodes] for kind, nodes in self.cells.items()}
        nodal = {name: values[used] for name, values in self.nodal.items()}
        return VtuFields(self.points[used], cells, nodal, self.cellwise)

    def write(self, path: Path) -> None:
        """Write .vtu, atomically."""
        meshio = import_meshio()
        small = {kind: linear_pieces(kind, nodes) for kind, nodes in self.cells.items()}
        vtu_mesh = meshio.Mesh(
            np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1]))),
            list(small.values()),
            point_data={**self.nodal, **_vectors(self.nodal)},
            cell_data={
                name: [
                    np.repeat(values, len(small[kind][1]) // max(len(values), 1))
                    for kind, values in data.items()
                ]
                for name, data in self.cellwise.items()
            },
        )
        with replacing(path) as temporary:
            meshio.write(temporary, vtu_mesh, file_format="vtu")

    def write_index(self, path: Path, pieces: list[str]) -> None:
        """Write the .pvtu of these pieces, of which this is one."""
        at_nodes = [_array(name, 1) for name in self.nodal]
        at_nodes += [_array(name, 3) for name in _vectors(self.nodal)]
        lines = [
            '<?xml version="1.0"?>',
            '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
            '<PUnstructuredGrid GhostLevel="0">',
            *("<PPoints>", _array("Points", 3), "</PPoints>"),
            *("<PPointData>", *at_nodes, "</PPointData>"),
            *("<PCellData>", *(_array(name, 1) for name in self.cellwise), "</PCellData>"),
            *(f"<Piece Source={attribute(piece)}/>" for piece in pieces),
            "</PUnstructuredGrid>",
            "</VTKFile>",
        ]
        write_text(path, "\n".join(lines) + "\n")


def write_result(result: Result, path: str | Path, local: Fields) -> None:
    """See `Result.write`; local: fields of the elements of this process."""
    system = result.system
    if (target := write_target(path, system)).suffix == ".vtu":
        write_file(target, system, _vtu_fields(result, system.everywhere, result.x, local))
    else:
        write_pieces(target, system, _vtu_fields(result, system, result.point.solution.x, local))


def _vtu_fields(result: Result, system: System, x: Array, local: Fields) -> VtuFields:
    """Of all unknowns x, or of those of this process with its own fields."""
    nodal = at_every_node(system, x)
    for name, block in system.everywhere.blocks.items():
        if block.kernel.fields and CELLS[block.kind].dimension:
            nodal |= {f"{name}.{label}": v for label, v in result.at_nodes(name).items()}
    whole = system is system.everywhere
    cells = system.mesh.cells if whole else local_cells(system)
    fields: Fields = result.fields if whole else local
    return VtuFields.of(system.mesh.points, cells, nodal, system.blocks, fields)


def write_target(path: str | Path, system: System) -> Path:
    """Path of a .vtu or .pvtu file in an existing folder.  Raises StudyError."""
    context, target = f"write({str(path)!r})", Path(path)
    if target.suffix not in (".vtu", ".pvtu"):
        raise StudyError(f"{context}: results are written as .vtu or .pvtu")
    if target.suffix == ".vtu" and system.mesh.piece is not None:
        raise StudyError(f"{context}: of a mesh in parts results are .pvtu")
    writable(context, target)
    return target


def write_file(target: Path, system: System, fields: VtuFields) -> None:
    """Write the fields of the whole mesh by one process."""
    if system.comm.is_root:
        fields.write(target)
    system.comm.barrier()


def write_pieces(target: Path, system: System, local_fields: VtuFields) -> None:
    """Write the fields of each process, and the index of all."""
    rank, size = system.comm.rank_and_size
    pieces, piece = piece_names(target, size), local_fields.compact()
    piece.write(target.with_name(pieces[rank]))
    system.comm.barrier()
    if system.comm.is_root:
        piece.write_index(target, pieces)
    system.comm.barrier()


def local_cells(system: System) -> dict[str, Integers]:
    """Cells of the elements of this process; on process 0 also those that have no elements."""
    mesh, blocks = system.mesh, system.everywhere.blocks.values()
    if mesh.piece is not None:
        return dict(mesh.cells)
    cells_of_process = {}
    for kind, cells in mesh.cells.items():
        block_nodes = [b.nodes for b in system.blocks.values() if b.kind == kind]
        if system.comm.is_root:
            with_elements = {
                tuple(row) for b in blocks if b.kind == kind for row in b.nodes.tolist()
            }
            block_nodes.append(cells[[tuple(row) not in with_elements for row in cells.tolist()]])
        cells_of_process[kind] = np.unique(np.concatenate([cells[:0], *block_nodes]), axis=0)
    return cells_of_process


def piece_names(path: Path, count: int) -> list[str]:
    """Names of the pieces of a .pvtu, beside it."""
    return [f"{path.stem}_{number:04d}.vtu" for number in range(count)]


def _lists(picture: VtuFields) -> list[Integers]:
    return list(picture.cells.values())


def _array(name: str, components: int) -> str:
    return f'<PDataArray type="Float64" Name={attribute(name)} NumberOfComponents="{components}"/>'


def _vectors(nodal: Mapping[str, Array]) -> dict[str, Array]:
    """u_x, u_y, ... as vectors u of three components, (points, 3)."""
    stems: dict[str, list[str]] = {}
    for name in nodal:
        stem, _, axis = name.rpartition("_")
        if stem and axis in AXES:
            stems.setdefault(stem, []).append(name)
    vectors = {}
    for stem, names in stems.items():
        if len(names) > 1 and stem not in nodal:
            columns = [np.nan_to_num(nodal[name]) for name in names[:3]]
            columns += [np.zeros_like(columns[0])] * (3 - len(columns))
            vectors[stem] = np.stack(columns, axis=1)
    return vectors
