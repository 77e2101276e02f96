"""Integrals of expressions over the cells or a side of a result.

Names are values of the page at its quadrature points: fields, unknowns, history and other data,
parameters, values that the page names, reference coordinates and the load factor or time. An
expression without a name of the page is integrated by a rule of the cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.element_blocks import facet_nodes
from softehl.runtime.definition.point_data import IntegrationPoints
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS, Cell, measures
from softehl.runtime.mesh.face_matching import match_faces
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.expressions import Expression
from softehl.runtime.suggestions import did_you_mean, join_names

if TYPE_CHECKING:
    from softehl.runtime.results.result import Result

_AXES = ("x", "y", "z")
_NORMAL = ("n_x", "n_y", "n_z")
ENERGY = "energy"
"""Name of the energy that a page minimises; alone in an expression."""


def integral(result: Result, text: str, where: str | None, block: str | None) -> float:
    """Integral of an expression; see `Result.integral`.  Raises StudyError, MeshError."""
    return _integrate(result, Expression.of(text), where, block)[0]


def mean(result: Result, text: str, where: str | None, block: str | None) -> float:
    """Integral by the volume that it is taken over; see `Result.mean`.

    Raises StudyError, MeshError.
    """
    expression = Expression.of(text, "mean")
    total, volume = _integrate(result, expression, where, block)
    if np.isnan(volume):
        raise StudyError(
            f"{expression.called}: {ENERGY!r} alone has no values at points: divide the integral "
            "by that of '1', or name the energy in the page by m.define"
        )
    if volume == 0.0:
        raise StudyError(f"{expression.called}: there is no volume or area to take a mean over")
    return total / volume


def _integrate(
    result: Result, expression: Expression, where: str | None, block: str | None
) -> tuple[float, float]:
    """Integral and volume; the volume of an energy that has no points is NaN."""
    mesh = result.system.mesh
    if mesh.piece is not None:
        raise StudyError(
            f"{expression.called}: the mesh is distributed: integrate with one process"
        )
    domain = _Domain.of(mesh, where, expression.used_by)
    if block is None:
        _require_one_meaning(result, expression)
    nodal_names = {*result.system.everywhere.numbering.nodal, *_AXES[: mesh.dimension], "t"}
    nodal_names |= set(_NORMAL[: mesh.dimension]) if domain.is_side else set()
    if block is None and set(expression.names) <= nodal_names and not _on_page(result, expression):
        return _over_mesh(result, expression, domain)
    total = volume = 0.0
    for page in _blocks(result, expression, domain, block):
        part, size = _over_block(result, expression, domain, page)
        total, volume = total + part, volume + size
    return total, volume


@dataclass(frozen=True, eq=False)
class _Domain:
    """Cells, of the mesh or of a group, or faces of a side; nodes by kind."""

    where: str | None
    elements: Mapping[str, Integers]
    is_side: bool

    @classmethod
    def of(cls, mesh: Mesh, where: str | None, used_by: str) -> _Domain:
        """Raises StudyError, MeshError."""
        if where is None or (isinstance(where, str) and where in mesh.groups):
            return cls(where, mesh.cells_of(where), is_side=False)
        if not isinstance(where, str):
            raise StudyError(
                f"{used_by}: where = {where!r}: a group of cells or a side is named; groups: "
                f"{join_names(mesh.groups)}; sides: {join_names(mesh.sides)}"
            )
        return cls(where, mesh.outer_faces(where), is_side=True)

    def contains(self, kind: str, nodes: Integers) -> Flags:
        """Which of the elements (n, k) of a kind lie in it."""
        faces = self.elements.get(kind)
        if faces is None or not len(faces):
            return np.zeros(len(nodes), dtype=bool)
        if faces is nodes:
            return np.ones(len(nodes), dtype=bool)
        return np.asarray(match_faces(nodes, faces, nodes.shape[1]) >= 0)


def _require_one_meaning(result: Result, expression: Expression) -> None:
    """Raise StudyError where t, x, y or z is also an argument or field of a page."""
    mesh = result.system.mesh
    for b in result.system.everywhere.blocks.values():
        faces = {*b.parameters, *b.data, *b.kernel.fields}
        for name in sorted({"t", *_AXES[: mesh.dimension]} & faces & set(expression.names)):
            meaning = "the time or load factor" if name == "t" else "a coordinate"
            raise StudyError(
                f"{expression.called}: {name!r} is {meaning}, and of block {b.name!r}: "
                f"block={b.name!r} takes that of the block"
            )


def _on_page(result: Result, expression: Expression) -> bool:
    """True if a name is a field of a page as well as an unknown."""
    fields = {n for b in result.system.everywhere.blocks.values() for n in b.kernel.fields}
    return bool(fields & set(expression.names) - set(result.system.everywhere.numbering.nodal))


def _over_mesh(result: Result, expression: Expression, domain: _Domain) -> tuple[float, float]:
    """Integral of unknowns and coordinates, and volume."""
    system, total, volume = result.system.everywhere, 0.0, 0.0
    ring = _is_ring(system)
    for kind, nodes in domain.elements.items():
        cell = CELLS[kind]
        points, weights = cell.measured_rule(2 * cell.order, ring=ring)
        values: dict[str, Array | float] = {"t": result.t}
        at = np.einsum("qk,nkd->nqd", cell.shape(points), system.mesh.points[nodes])
        values |= {axis: at[:, :, k] for k, axis in enumerate(_AXES[: at.shape[2]])}
        if domain.is_side and set(_NORMAL) & set(expression.names):
            normal = _normals(cell, system.mesh.points[nodes], points)
            values |= {n: normal[:, :, k] for k, n in enumerate(_NORMAL[: at.shape[2]])}
        for name in system.numbering.nodal.keys() & set(expression.names):
            nodal = result.values(name)[nodes]
            if np.isnan(nodal[:, : cell.corners]).any():
                raise StudyError(
                    f"{expression.called}: {name!r} is not an unknown everywhere: name a "
                    "group of cells, or a block"
                )
            full = not np.isnan(nodal).any()
            shape = (cell if full else cell.linear).shape(points)
            values[name] = nodal[:, : shape.shape[1]] @ shape.T
        volumes = _volumes(cell, system.mesh.points[nodes], points, ring=ring) * weights
        total += _sum(expression, values, volumes)
        volume += float(volumes.sum())
    return total, volume


def _over_block(
    result: Result, expression: Expression, domain: _Domain, block: Block
) -> tuple[float, float]:
    """Integral and volume of the elements of a block in a domain, by the rule of its page."""
    system = result.system.everywhere
    facet = facet_nodes(block.kernel)
    nodes = block.nodes if facet is None else block.nodes[:, facet]
    rows = domain.contains(block.kind, nodes)
    if not rows.any():
        return 0.0, 0.0
    if expression.names == (ENERGY,) and ENERGY not in block.kernel.fields:
        return float(_energies(result, block)[rows].sum()), float("nan")
    rule = block.options.rule or block.kernel.default_rule
    points = IntegrationPoints.of(system.mesh, block.kernel, block.kind, nodes, rule)
    if points.shape is None:
        raise StudyError(
            f"{expression.called}: the quadrature of {block.name!r} "
            f"({block.kernel.name}) is not that of its cells; let its page have a field times "
            "weight and volume, and sum result.fields"
        )
    values = {
        n: np.broadcast_to(v, (len(nodes), points.count))[rows]
        for n, v in _values(result, block, points, expression.names).items()
    }
    volume = _volumes(
        CELLS[block.kind],
        system.mesh.points[nodes[rows]],
        rule.table[:, :-1],
        ring=_is_ring(system),
    )
    volumes = volume * rule.weights
    return _sum(expression, values, volumes), float(volumes.sum())


def _sum(expression: Expression, values: Mapping[str, Array | float], volume: Array) -> float:
    return float((np.broadcast_to(expression(values), volume.shape) * volume).sum())


def _is_ring(system: System) -> bool:
    return system.definition is not None and system.definition.axisymmetric


def _volumes(cell: Cell, node_points: Array, at: Array, *, ring: bool) -> Array:
    """Volumes (n, q) per parent volume of cells or faces; of rings in axisymmetry."""
    volume = measures(cell, node_points, at)
    if ring:
        volume = volume * 2.0 * np.pi * (node_points[:, :, 1] @ cell.shape(at).T)
    return volume


def _normals(cell: Cell, node_points: Array, at: Array) -> Array:
    """Unit normals (n, q, dim) of faces, outwards."""
    gradients = np.einsum("qkd,nkc->nqcd", cell.gradient(at), node_points)
    if gradients.shape[2] == 2:
        normal = np.stack([gradients[:, :, 1, 0], -gradients[:, :, 0, 0]], axis=2)
    else:
        normal = np.cross(gradients[..., 0], gradients[..., 1])
    return np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True))


# blocks -----------------------------------------------------------------------------------------


def _base(block: Block) -> str:
    """Name of a page in the study, without the kind of cells."""
    return block.name.removesuffix(f":{block.kernel.cell}") if block.kernel.cell else block.name


def _blocks(
    result: Result, expression: Expression, domain: _Domain, block: str | None
) -> list[Block]:
    """Blocks of an integral.  Raises StudyError where they are none, or cover a cell twice."""
    every = list(result.system.everywhere.blocks.values())
    context = expression.called
    if block is not None:
        blocks_of_name = [b for b in every if block in (b.name, _base(b))]
        if not blocks_of_name:
            names = list(dict.fromkeys(map(_base, every)))
            raise StudyError(
                f"{context}: no block {block!r}{did_you_mean(block, names)}; there are "
                f"{join_names(names)}"
            )
        if not any(_inside(b, domain).any() for b in blocks_of_name):
            raise StudyError(f"{context}: no element of {block!r} lies in {domain.where!r}")
        return blocks_of_name
    inside = [b for b in every if _inside(b, domain).any()]
    having = [b for b in inside if not _missing(result, b, expression.names)]
    if not having and len({_base(b) for b in inside}) == 1:
        having = inside  # the page says what is missing
    if not having:
        raise StudyError(
            f"{context}: no page has all of {join_names(expression.names)}"
            + (f" on {domain.where!r}" if domain.where else "")
            + "; name its block, block=...; "
            + "; ".join(f"{b.name} has {join_names(_cheap(b))}" for b in inside)
        )
    for kind, nodes in domain.elements.items():
        count = np.zeros(len(nodes), dtype=np.int64)
        for b in having:
            if b.kind == kind:
                count += _covered(nodes, b)
        if (count > 1).any() or not (count.all() or not _any_elements(every, kind, nodes, count)):
            twice = "several pages have" if (count > 1).any() else "not all cells have"
            raise StudyError(
                f"{context}: {twice} {join_names(expression.names)}: say block=..., one of "
                f"{join_names(dict.fromkeys(map(_base, having)))}, or where=..., a group"
            )
    return having


def _inside(block: Block, domain: _Domain) -> Flags:
    facet = facet_nodes(block.kernel)
    nodes = block.nodes if facet is None else block.nodes[:, facet]
    return domain.contains(block.kind, nodes)


def _covered(nodes: Integers, block: Block) -> Flags:
    """Which elements (n, k) are those of a block."""
    facet = facet_nodes(block.kernel)
    faces = block.nodes if facet is None else block.nodes[:, facet]
    if faces is nodes or np.array_equal(faces, nodes):
        return np.ones(len(nodes), dtype=bool)
    return np.asarray(match_faces(nodes, faces, nodes.shape[1]) >= 0)


def _any_elements(blocks: Sequence[Block], kind: str, nodes: Integers, count: Integers) -> bool:
    """True if a cell without the values has elements of another page."""
    uncovered = nodes[count == 0]
    return any(_covered(uncovered, b).any() for b in blocks if b.kind == kind and len(uncovered))


# values -----------------------------------------------------------------------------------------


def _cheap(block: Block) -> list[str]:
    """Names of values of a block without another kernel."""
    kernel = block.kernel
    named = (*kernel.fields, *kernel.internal, *(s.name for s in block.slots if s.node is not None))
    named = (*named, *kernel.point_data, *block.data, *block.parameters)
    energy = [ENERGY] if ENERGY in kernel.tasks else []
    return [n for n in dict.fromkeys([*named, *energy]) if not n.startswith("new_")]


def _missing(result: Result, block: Block, names: Sequence[str]) -> list[str]:
    """Names that are values neither of a block nor of the mesh."""
    axes = _AXES[: result.system.mesh.dimension]
    return [n for n in names if n not in (*_cheap(block), *axes, "t")]


def _values(
    result: Result, block: Block, points: IntegrationPoints, names: Sequence[str]
) -> dict[str, Array]:
    """Values (n, q) or broadcast to it, by name.  Raises StudyError."""
    fields = result.fields(block.name)
    values: dict[str, Array] = {}
    coordinates = points.coordinates
    for name in names:
        if name in fields:
            values[name] = fields[name]
        elif name in (slot.name for slot in block.slots if slot.node is not None):
            values[name] = _unknown(result, block, points, name)
        elif name in block.kernel.point_data:
            values[name] = result.state[block.name][:, :, block.kernel.point_data.index(name)]
        elif name in block.data:
            values[name] = block.data[name][:, None]
        elif name in block.parameters:
            value = block.parameters[name]
            values[name] = np.asarray(value(result.t) if callable(value) else value)
        elif name in _AXES[: coordinates.shape[2]]:
            values[name] = coordinates[:, :, _AXES.index(name)]
        elif name == "t":
            values[name] = np.asarray(result.t)
    uncovered = tuple(n for n in names if n not in values)
    return {**values, **dict(zip(uncovered, _named(result, block, uncovered), strict=True))}


def _unknown(result: Result, block: Block, points: IntegrationPoints, name: str) -> Array:
    """An unknown at the points, (n, q)."""
    cell = CELLS[block.kind]
    local = [slot.node for slot in block.slots if slot.name == name and slot.node is not None]
    facet = facet_nodes(block.kernel)
    rule = block.options.rule or block.kernel.default_rule
    if facet is not None:
        local = [node for node in facet.tolist() if node in local]
    if len(local) not in (len(cell.nodes), cell.corners):
        raise StudyError(f"{name!r} of {block.name!r} has no shape functions on {block.kind}")
    shape = (cell if len(local) == len(cell.nodes) else cell.linear).shape(rule.table[:, :-1])
    return np.asarray(result.values(name)[block.nodes[:, local]] @ shape.T)


def _named(result: Result, block: Block, names: tuple[str, ...]) -> Iterator[Array]:
    """Values (n, q) that the page names, by a kernel of their own.  Raises StudyError."""
    if not names:
        return
    if block.valued is None:
        raise StudyError(
            f"{block.name!r}: {block.kernel.name} comes as C and has no {join_names(names)}; it "
            f"has {join_names(_cheap(block))}"
        )
    try:
        kernel = block.valued(names).with_lengths(block.kernel.lengths)
    except StudyError:
        raise
    except ValueError as error:
        raise StudyError(
            f"{block.name!r}: {error}; its fields, unknowns and arguments: "
            f"{join_names(_cheap(block))}"
        ) from None
    local = result.problem.assembler.block(block.name)
    values = replace(local, kernel=kernel).fields(
        result.point.solution.x, result.problem.parameters[block.name]
    )
    for name in names:
        yield result.system.comm.gather_cells(block.name, values[name])


def _energies(result: Result, block: Block) -> Array:
    """Energies (n,) of the elements of a block.  Raises StudyError where it has none."""
    if ENERGY not in block.kernel.tasks:
        raise StudyError(
            f"{block.name!r}: {block.kernel.name} minimises no energy; it has "
            f"{join_names(_cheap(block))}"
        )
    local = result.problem.assembler.block(block.name)
    dofs = np.ascontiguousarray(result.point.solution.x[local.dofs])
    arguments = local.given(result.problem.parameters[block.name])
    energies = block.kernel.energy(local.coordinates, dofs, **arguments)
    return result.system.comm.gather_cells(block.name, energies)
