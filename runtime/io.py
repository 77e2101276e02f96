"""Files of a run: every write is atomic, so a run that is killed leaves whole files only.

A file is written beside its place and moved over it (os.replace); a reader sees the old file or the
new one, never half of one.  CSV numbers are the shortest text that reads back to the same number.
"""

import contextlib
import csv
import hashlib
import io
import json
import math
import os
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from errno import EISDIR, ENOTDIR
from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers

Cell = float | int | str

_DIGEST = "sha256"
"""Name of the array that holds the digest of the others."""


@contextlib.contextmanager
def replacing(path: Path, *, shared: bool = False) -> Iterator[Path]:
    """Give a path to write to; move it over `path` if the block succeeds, remove it if not.

    Its name is fixed, so what a killed run leaves behind is overwritten by the next one; where
    several processes may write the file (shared), each has a name of its own.
    """
    suffix = f".{uuid.uuid4().hex}" if shared else ""
    temporary = path.with_name(f".{path.name}{suffix}.part")
    try:
        yield temporary
        _flush(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: Path) -> None:
    """Make the folder of a file.  Raises OSError where the file could not be written there."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:  # a file in the place of the folder
        raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR), error.filename) from None
    if path.is_dir():
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(path))
    with tempfile.TemporaryFile(dir=path.parent):
        pass


def _flush(path: Path) -> None:
    """Have a file on the disk before its name is: a crash of the machine leaves whole files too."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically.  Raises OSError."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_arrays(path: Path, arrays: Mapping[str, Array], *, shared: bool = True) -> None:
    """Write named arrays (.npz) and their digest, atomically; shared: also by several processes.

    Raises OSError.
    """
    named: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
    named[_DIGEST] = _digest_of(named)
    with replacing(path, shared=shared) as temporary, temporary.open("wb") as file:
        np.savez(file, **named)


def read_arrays(path: Path) -> dict[str, Array] | None:
    """Arrays that :func:`write_arrays` wrote; None if the file is missing, damaged or edited."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as content:
            named = {name: content[name] for name in content.files}
        if not np.array_equal(named.pop(_DIGEST), _digest_of(named)):
            return None
        return {name: np.asarray(array, dtype=np.float64) for name, array in named.items()}
    except Exception:  # damage may show as almost anything: in the archive, a header, the data
        return None


def _digest_of(arrays: Mapping[str, Any]) -> Integers:
    """SHA-256 (32,) of names, types, shapes and values, in the order of the names."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}|{array.dtype.str}|{np.shape(arrays[name])}|".encode())
        digest.update(array.data)
    return np.frombuffer(digest.digest(), dtype=np.uint8)


def number_text(value: float) -> str:
    """The shortest decimal text of a number, without a trailing ".0" or a negative zero."""
    text = repr(float(value) + 0.0)
    return text.removesuffix(".0")


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> None:
    """Write a table atomically: one header line, then one line a row."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow([cell if isinstance(cell, str) else number_text(cell) for cell in row])
    write_text(path, buffer.getvalue())


def read_csv(path: Path, header: Sequence[str]) -> list[list[str]]:
    """Read the rows of a table written by :func:`write_csv`.

    Raises OSError, and ValueError if the header or the length of a row is another one.
    """
    with path.open(encoding="utf-8", newline="") as file:
        table = list(csv.reader(file))
    if not table or table[0] != list(header):
        raise ValueError(f"{path}: the first line is not {','.join(header)}")
    for row in table[1:]:
        if len(row) != len(header):
            raise ValueError(f"{path}: a row has {len(row)} cells instead of {len(header)}")
    return table[1:]


def write_columns(path: Path, columns: Mapping[str, Array]) -> None:
    """Write arrays of one length (n,) as the columns of a table.  ValueError if they differ."""
    write_csv(path, list(columns), zip(*(c.tolist() for c in columns.values()), strict=True))


def read_columns(path: Path, header: Sequence[str]) -> dict[str, Array]:
    """Read what :func:`write_columns` wrote: name -> (n,).  Raises OSError, ValueError."""
    rows = [[float(cell) for cell in row] for row in read_csv(path, header)]
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    return {name: table[:, i].copy() for i, name in enumerate(header)}


def read_table(path: Path) -> dict[str, Array]:
    """As :func:`read_columns`, with the columns that the file has.  Raises OSError, ValueError."""
    with path.open(encoding="utf-8", newline="") as file:
        header = next(csv.reader(file), [])
    return read_columns(path, header)


def write_json(path: Path, value: object) -> None:
    """Write JSON atomically; a number that is not finite becomes null (JSON has no NaN)."""
    write_text(path, json.dumps(_plain(value), indent=1, allow_nan=False) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.  Raises OSError, and ValueError if the file holds anything else."""
    value = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(value, dict):
        raise ValueError(f"{path}: not a JSON object")
    return value


def _plain(value: object) -> object:
    """The value in types that JSON has."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


_KINDS = {2: "line", 4: "quad"}
"""Names in meshio of cells of so many nodes."""


def write_vtu(
    path: Path,
    points: Array,
    cells: Integers,
    point_data: Mapping[str, Array],
    cell_data: Mapping[str, Array],
) -> None:
    """Write four-node cells, or lines, in the plane as VTK XML, atomically.

    points: (n, 2), written as (z, r, 0).  cells: (m, 4) or (m, 2).  point_data: name -> (n,) or
    (n, k); cell_data: name -> (m,) or (m, k).
    """
    import meshio  # only here: it is slow to import

    flat = np.zeros((len(points), 3))
    flat[:, :2] = points
    mesh = meshio.Mesh(
        flat,
        [(_KINDS[cells.shape[1]], np.asarray(cells, dtype=np.int64))],
        point_data={name: np.asarray(data) for name, data in point_data.items()},
        cell_data={name: [np.asarray(data)] for name, data in cell_data.items()},
    )
    with replacing(path) as temporary:
        meshio.write(temporary, mesh, file_format="vtu")


def read_vtu(
    path: Path,
) -> tuple[Array, Integers, dict[str, Array]]:
    """Points (n, 2), cells (m, 4) and point data that :func:`write_vtu` wrote.

    Raises OSError, and ValueError where the file is damaged.
    """
    from meshio import vtu  # meshio.read prints and ends the process where this raises

    with path.open("rb"):  # a missing file is no damaged one
        pass
    try:
        mesh = vtu.read(path)
        points = np.asarray(mesh.points[:, :2], dtype=np.float64)
        cells = np.asarray(mesh.cells_dict["quad"], dtype=np.int64)
    except Exception as error:  # damage may show as almost anything: in XML, base64, zlib, shapes
        raise ValueError(f"{path}: not a section that can be read: {error}") from error
    return points, cells, {name: np.asarray(data) for name, data in mesh.point_data.items()}


def attribute(value: str) -> str:
    """Value of an attribute in XML, with its quotes."""
    from xml.sax.saxutils import quoteattr  # late: it imports the web client of Python

    return quoteattr(value)


def write_pvd(path: Path, entries: Iterable[tuple[float, str]]) -> None:
    """Write a series for ParaView, atomically: times, and the files beside it that show them."""
    rows = [
        f'    <DataSet timestep="{t!r}" part="0" file={attribute(file)}/>\n' for t, file in entries
    ]
    text = (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        f"{''.join(rows)}  </Collection>\n</VTKFile>\n"
    )
    write_text(path, text)
