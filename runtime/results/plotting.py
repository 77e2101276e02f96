"""Pictures of results: values on the deformed body, curves of a path, animations of a march."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.plotting import (
    Picture,
    import_pyvista,
    new_plotter,
    picture_file,
    show_or_save,
)
from softehl.runtime.results.explanation import block_called
from softehl.runtime.results.tensors import von_mises
from softehl.runtime.suggestions import did_you_mean, join_names

if TYPE_CHECKING:
    from softehl.runtime.results.result import Result
    from softehl.runtime.solve.solution import LimitPoint

VON_MISES = "von_mises"
MOVIES = (".gif", ".mp4")
_AXES = ("x", "y", "z")


def picture_of(
    result: Result,
    name: str | None,
    *,
    block: str | None = None,
    deformed: bool | float = False,
    recovery: str = "projection",
    limits: tuple[float, float] | None = None,
    edges: bool = True,
) -> Picture:
    """Picture of a result; see `Result.plot`."""
    system = result.system
    if system.mesh.piece is not None:
        raise StudyError("plot: the mesh is distributed: write a .pvtu and plot that")
    cells: dict[str, Integers] = {}
    for b in system.everywhere.blocks.values():
        if CELLS[b.kind].dimension == system.mesh.dimension and (block in (None, b.name)):
            nodes = b.nodes[:, : len(CELLS[b.kind].nodes)]
            cells[b.kind] = np.concatenate([cells[b.kind], nodes]) if b.kind in cells else nodes
    values, label = (None, "") if name is None else _values(result, name, block, recovery)
    if limits is None and values is not None:  # bent cells are interpolated beyond their nodes
        limits = float(np.nanmin(values)), float(np.nanmax(values))
    if all(CELLS[kind].dimension == 1 for kind in cells):
        edges = False  # they would hide the colours of lines
    return Picture(
        _moved(result, deformed),
        cells or dict(system.mesh.cells),
        values,
        label=label,
        limits=limits,
        edges=edges,
        title=f"t = {result.t:.6g}",
    )


def _moved(result: Result, deformed: bool | float) -> Array:
    """Nodes, displaced by u times a factor."""
    points = result.system.mesh.points
    if deformed is False or deformed == 0:
        return points
    nodal = result.system.everywhere.numbering.nodal
    names = [f"u_{axis}" for axis in _AXES[: points.shape[1]] if f"u_{axis}" in nodal]
    if not names:
        raise StudyError(
            f"plot: deformed = {deformed}, and no page has displacements u_x, u_y; unknowns at "
            f"nodes: {join_names(nodal)}"
        )
    moved = np.array(points)
    for name in names:
        moved[:, _AXES.index(name[-1])] += float(deformed) * np.nan_to_num(result.values(name))
    return moved


def _values(result: Result, name: str, block: str | None, recovery: str) -> tuple[Array, str]:
    """Nodal values of an unknown, the length of a vector, a field of a block, or von Mises."""
    everywhere = result.system.everywhere
    nodal, blocks = everywhere.numbering.nodal, everywhere.blocks
    if block is None and name in nodal:
        return result.values(name), name
    components = [f"{name}_{axis}" for axis in _AXES if f"{name}_{axis}" in nodal]
    if block is None and components:
        parts = [np.nan_to_num(result.values(c)) for c in components]
        return np.linalg.norm(parts, axis=0), f"|{name}|"
    if block is not None:
        block_called(blocks, block)
    total, count = np.zeros((2, len(result.system.mesh.points)))
    available: dict[str, None] = dict.fromkeys(nodal)
    for b in [block] if block is not None else list(blocks):
        if not blocks[b].kernel.fields or not CELLS[blocks[b].kind].dimension:
            continue
        fields = result.at_nodes(b, recovery=recovery)
        available |= dict.fromkeys(fields)
        if name == VON_MISES and "sigma_xx" in fields:
            fields = {VON_MISES: von_mises(fields)}
        if name in fields:
            defined = np.isfinite(fields[name])
            total[defined] += fields[name][defined]
            count[defined] += 1
    if not count.any():
        if name == VON_MISES:
            raise StudyError(
                f"plot: {VON_MISES} needs fields sigma_xx, sigma_yy, ... of the page; there are "
                f"{join_names(available)}"
            )
        names = [*available, *([VON_MISES] if "sigma_xx" in available else [])]
        raise StudyError(
            f"plot: no unknown or field {name!r}{did_you_mean(name, names)}; there are "
            f"{join_names(names)}"
        )
    with np.errstate(invalid="ignore"):
        return total / np.where(count, count, np.nan), name


def animate(
    results: Iterable[Result],
    name: str | None = None,
    *,
    file: str | Path,
    block: str | None = None,
    deformed: bool | float = True,
    recovery: str = "projection",
    limits: tuple[float, float] | None = None,
    edges: bool = True,
    rate: float = 10.0,
) -> None:
    """Write an animation of results, such as those of `Study.march`.

    Parameters
    ----------
    results : iterable of Result
        The results, in order.
    name : str, optional
        Unknown or field, as of `Result.plot`.
    file : str or Path
        "NAME.gif" or "NAME.mp4".
    block : str, optional
        As of `Result.plot`.
    deformed : bool or float
        As of `Result.plot`.
    recovery : str
        As of `Result.plot`.
    limits : tuple of float, optional
        Least and largest value of the colours; those of all results if left out.
    edges : bool
        As of `Result.plot`.
    rate : float
        Pictures a second.

    Raises
    ------
    StudyError
        There is no result or no such field, or the file has another ending.
    MissingPyvista
        PyVista is not installed.
    """
    path = Path(file)
    if path.suffix not in MOVIES:
        raise StudyError(f"file = {str(file)!r}: animations end in {' or '.join(MOVIES)}")
    options: dict[str, Any] = {"block": block, "deformed": deformed, "recovery": recovery}
    pictures = [picture_of(r, name, edges=edges, **options) for r in results]
    if not pictures:
        raise StudyError("animate: there is no result")
    if limits is None and name is not None:
        every = np.concatenate([np.ravel(np.asarray(p.values, dtype=float)) for p in pictures])
        limits = (float(np.nanmin(every)), float(np.nanmax(every)))
    bounds = np.array([[p.points.min(axis=0), p.points.max(axis=0)] for p in pictures])
    low, high = (
        np.pad(b, (0, 3 - len(b))) for b in (bounds.min(axis=(0, 1)), bounds.max(axis=(0, 1)))
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    plotter = new_plotter(off_screen=True)
    if path.suffix == ".gif":
        plotter.open_gif(str(path), fps=rate, loop=0)
    else:
        plotter.open_movie(str(path), framerate=rate)
    for picture in pictures:
        plotter.clear()
        replace(picture, limits=limits).draw(plotter)
        plotter.reset_camera(bounds=tuple(np.column_stack([low, high]).ravel()))
        plotter.write_frame()
    plotter.close()


def plot_path(
    results: Sequence[Result],
    limits: Sequence[LimitPoint],
    name: str,
    at: Sequence[float],
    file: str | Path | None,
) -> None:
    """Show or write the load factor over an unknown at a node; see `LoadPath.plot`."""
    if file is not None:
        picture_file(file)
    if not results:
        raise StudyError("plot: the path has no results")
    system = results[0].system.everywhere
    node = system.mesh.node_at(np.asarray(at, dtype=np.float64))
    values = np.array([r.values(name)[node] for r in results])
    pyvista = import_pyvista()
    chart = pyvista.Chart2D(x_label=f"{name} at {tuple(at)}", y_label="load factor")
    chart.line(values, np.array([r.t for r in results]), width=2.0)
    if limits:
        dof = system.numbering.nodal[name][node]
        x, y = [limit.x[dof] for limit in limits], [limit.t for limit in limits]
        chart.scatter(x, y, color="r", size=8, label="limit points")
    plotter = new_plotter(off_screen=file is not None)
    plotter.add_chart(chart)
    show_or_save(plotter, file)
