"""Pictures of meshes and of values on them, by PyVista (the extra `plot`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS, linear_pieces
from softehl.runtime.mesh.readers.meshio import import_meshio

if TYPE_CHECKING:
    from softehl.runtime.mesh.mesh import Mesh

SUBDIVISIONS = 3
"""Of quadratic faces into linear ones in a picture, so that bent edges look bent."""
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".svg", ".pdf", ".eps", ".ps")
"""Endings of files of pictures; the last four are vector graphics."""
_VECTOR = (".svg", ".pdf", ".eps", ".ps")


class MissingPyvista(SoftehlError, ModuleNotFoundError):  # noqa: N818 (named after what it is)
    """PyVista is not installed; the message says what to do."""


class PictureError(SoftehlError, ValueError):
    """A picture cannot be made; the message says what is allowed."""


def import_pyvista() -> Any:
    """The package; raises MissingPyvista."""
    try:
        import pyvista
    except ImportError as error:
        raise MissingPyvista(
            f"a picture needs PyVista ({error}): pip install 'softehl[plot]'"
        ) from None
    return pyvista


def new_plotter(*, off_screen: bool) -> Any:
    """A plotter of PyVista; VTK would warn where there is no display."""
    pyvista = import_pyvista()
    with pyvista.vtk_verbosity("error"):
        return pyvista.Plotter(off_screen=off_screen)


@dataclass(frozen=True, eq=False)
class Picture:
    """Nodes (n, dim), cells by kind, values at nodes or in cells, and how they are drawn.

    values: (n,) at nodes or kind -> (m,) in cells, or None. label: of the values. limits: of the
    colours. edges: whether edges of cells are drawn. names: of values that are numbers of groups.
    """

    points: Array
    cells: Mapping[str, Integers]
    values: Array | Mapping[str, Array] | None = None
    label: str = ""
    limits: tuple[float, float] | None = None
    edges: bool = True
    names: tuple[str, ...] = ()
    title: str = ""

    def draw(self, plotter: Any = None, *, off_screen: bool = False) -> Any:
        """Draw into a plotter of PyVista, a new one if none is given; returns it."""
        pyvista = import_pyvista()
        if plotter is None:
            plotter = new_plotter(off_screen=off_screen)
        grid = self._grid(pyvista)
        bent = any(CELLS[kind].order > 1 and CELLS[kind].exponents for kind in self.cells)
        surface = grid.extract_surface(
            nonlinear_subdivision=SUBDIVISIONS if bent else 0, algorithm="dataset_surface"
        )
        plotter.add_mesh(surface if surface.n_points else grid, **self._colours())
        if self.edges:
            plotter.add_mesh(_edges(grid, bent), color="black", line_width=1)
        if self.points.shape[1] < 3:
            plotter.view_xy()
        if self.title:
            plotter.add_text(self.title, font_size=10)
        return plotter

    def _colours(self) -> dict[str, Any]:
        if self.values is None:
            return {"color": "lightgrey"}
        colours: dict[str, Any] = {
            "scalars": self.label,
            "clim": self.limits,
            "nan_color": "lightgrey",
            "scalar_bar_args": {"title": self.label},
        }
        if self.names:
            colours |= {
                "annotations": {float(k): name for k, name in enumerate(self.names)},
                "n_colors": len(self.names),
                "cmap": "tab10",
                "scalar_bar_args": {"title": self.label, "n_labels": 0},
            }
        return colours

    def _grid(self, pyvista: Any) -> Any:
        meshio = import_meshio()
        points = np.pad(self.points, ((0, 0), (0, 3 - self.points.shape[1])))
        drawn = {
            kind: linear_pieces(kind, nodes) for kind, nodes in self.cells.items() if len(nodes)
        }
        grid = pyvista.from_meshio(meshio.Mesh(points, list(drawn.values())))
        if isinstance(self.values, Mapping):
            pieces = [
                np.repeat(self.values[kind], len(nodes) // len(self.cells[kind]))
                for kind, (_, nodes) in drawn.items()
            ]
            grid.cell_data[self.label] = np.concatenate(pieces)
        elif self.values is not None:
            grid.point_data[self.label] = self.values
        return grid


def plot_mesh(mesh: Mesh, *, groups: bool, edges: bool, file: str | Path | None) -> None:
    """Show or write a mesh; see `Mesh.plot`."""
    if file is not None:
        picture_file(file)
    picture = Picture(mesh.points, mesh.cells, edges=edges)
    if groups:
        if not mesh.groups:
            raise PictureError("groups = True: the mesh has no groups of cells")
        values = {kind: np.full(len(nodes), np.nan) for kind, nodes in mesh.cells.items()}
        for number, group in reversed(list(enumerate(mesh.groups.values()))):
            for kind, rows in group.items():
                values[kind][rows] = number
        picture = replace(picture, values=values, label="group", names=tuple(mesh.groups))
    show_or_save(picture.draw(off_screen=file is not None), file)


def _edges(grid: Any, bent: bool) -> Any:
    """Edges of all cells, of bent ones as polylines."""
    if not bent:
        return grid.extract_all_edges()
    pieces = grid.separate_cells().extract_surface(
        nonlinear_subdivision=SUBDIVISIONS, algorithm="dataset_surface"
    )
    return pieces.extract_feature_edges(
        boundary_edges=True, feature_edges=True, manifold_edges=False, non_manifold_edges=False
    )


def show_or_save(plotter: Any, file: str | Path | None) -> Any:
    """Write a picture, or show it: in a window, or in a notebook interactively."""
    if file is None:
        return plotter.show()
    path = picture_file(file)
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        if path.suffix.lower() in _VECTOR:
            plotter.save_graphic(path)
        else:
            plotter.screenshot(path)
    finally:
        plotter.close()
    return None


def picture_file(file: str | Path) -> Path:
    """The path of a picture; raises PictureError for another ending."""
    path = Path(file)
    if path.suffix.lower() not in PICTURES:
        raise PictureError(f"file = {str(file)!r}: pictures end in {', '.join(PICTURES)}")
    return path
