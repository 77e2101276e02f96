"""Blocks of elements of a page: their nodes, unknowns, data and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from softehl.function_address import FunctionAddressError, address_of
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.argument_checks import datum, parameter, require_names
from softehl.runtime.definition.kernel_loading import KernelOrigin
from softehl.runtime.definition.line_fields import interpolated, placed, require_apart
from softehl.runtime.definition.point_data import (
    IntegrationPoints,
    by_element,
    varying_parameters,
)
from softehl.runtime.definition.problem_definition import (
    Block,
    Number,
    PageOptions,
    ProblemDefinition,
    StudyError,
)
from softehl.runtime.discretisation.dofmap import Slot, slots
from softehl.runtime.kernels.array_data import data_of
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.kernel_call import Rule
from softehl.runtime.kernels.run_time_arrays import (
    ArrayData,
    ArrayDataError,
    RunTimeArray,
    require_equal_lengths,
)
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.interior_facets import cells_at_side, interior
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate
from softehl.runtime.suggestions import join_names

GEOMETRIES = {1: ("solid",), 2: ("plane strain", "axisymmetric"), 3: ("solid",)}
"""Geometries of meshes by their dimension, the default first."""
Elements = tuple[str, Integers]
"""Kind of cells or faces and their nodes (n, k)."""
On: TypeAlias = "str | Predicate | Integers | None"
"""A side, or the nodes (n, k) of the elements themselves; None: cells."""


def _faces(mesh: Mesh, on: str | Predicate, kernel: Kernel) -> Mapping[str, Integers]:
    """Faces of a side; those of a page of fields have an outside, where its normals go."""
    return mesh.outer_faces(on) if kernel.cell else mesh.faces(on)


def kinds_of(mesh: Mesh, on: On, cells: str | None) -> tuple[str, ...]:
    """Kinds of the selected cells or faces; none for elements that are given by their nodes."""
    if isinstance(on, np.ndarray):
        return ()
    if on is None:
        return tuple(mesh.cells_of(cells))
    if on == "interior" and on not in mesh.sides:
        return tuple(f"{kind}_interior" for kind in mesh.cells)
    try:
        return tuple(mesh.faces(on))
    except MeshError:
        return ()  # nodes without faces: for a page of one node


def _caused_by(error: BaseException | None, kind: str) -> bool:
    """True for an error of a page of a kind: "traces", it needs the cells beside a side;
    "pointwise", a quantity of the whole element varies with the point.
    """
    while error is not None:
        if getattr(error, kind, False):
            return True
        error = error.__cause__
    return False


def beside_of(mesh: Mesh, on: str | Predicate) -> tuple[str, ...]:
    """Kinds of facets of a side with the cells beside it, of those cells that have faces there."""
    side_faces = mesh.outer_faces(on)
    return tuple(f"{k}_side" for k in mesh.cells if side_faces.keys() & set(CELLS[k].faces))


def elements_of(mesh: Mesh, name: str, kernel: Kernel, on: On, cells: str | None) -> Elements:
    """The elements of a kernel.  Raises StudyError, MeshError."""
    if on is not None and cells is not None:
        raise StudyError(f"{name!r}: give cells=... or on=..., not both")
    if isinstance(on, np.ndarray):
        return "point1", _elements_by_nodes(mesh, name, kernel, on)
    if on is not None and kernel.nodes == 1:
        return "point1", mesh.own(mesh.nodes(on))[:, None]
    stem, _, facet = kernel.cell.partition("_")
    if facet and (on is None or stem not in mesh.cells):
        raise StudyError(
            f'{name!r}: {kernel.name} stands on facets of {stem}: on="interior" or on=a side'
        )
    if facet:
        assert on is not None
        nodes = interior(mesh, stem) if facet == "interior" else cells_at_side(mesh, on, stem)
        return CELLS[stem].side_nodes[0][0].name, nodes
    candidates = _faces(mesh, on, kernel) if on is not None else mesh.cells_of(cells)
    if kernel.cell in candidates:
        return kernel.cell, candidates[kernel.cell]
    fit = {kind: nodes for kind, nodes in candidates.items() if nodes.shape[1] == kernel.nodes}
    if len(fit) != 1 or (cells is None and len(candidates) > 1):
        kinds = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in candidates.items())
        location = "the mesh" if on is None and cells is None else repr(cells or on)
        raise StudyError(
            f"{name!r}: {kernel.name} has {kernel.nodes} nodes, {location} has {kinds}"
            + ("; name groups of cells of one kind" if len(candidates) > 1 else "")
        )
    return next(iter(fit.items()))


def _elements_by_nodes(mesh: Mesh, name: str, kernel: Kernel, nodes: Integers) -> Integers:
    """Elements that are given by their nodes (n, k); (n, 0) for a page that knows of none.

    Raises StudyError.
    """
    nowhere = not kernel.coordinates and all(slot.node is None for slot in slots(kernel))
    widths = (kernel.nodes, 0) if nowhere else (kernel.nodes,)
    if nodes.dtype.kind not in "iu" or nodes.ndim != 2 or nodes.shape[1] not in widths:
        raise StudyError(
            f"{name!r}: elements of {kernel.name} are given as node numbers (n, {kernel.nodes}); "
            f"given {nodes.dtype} of shape {nodes.shape}"
        )
    if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(mesh.points):
        raise StudyError(f"{name!r}: node numbers go from 0 to {len(mesh.points) - 1}")
    return nodes.astype(np.int64)


def page_on(
    mesh: Mesh,
    name: str,
    kernel: Kernel,
    elements: Elements,
    form: PageOptions,
    arguments: Mapping[str, Any],
) -> Block:
    """A block of elements with everything its page needs.  Raises StudyError."""
    kind, nodes = elements
    _require_fit(mesh, kernel)
    page_slots = slots(kernel)
    require_names(
        "unknown", form.shared, [s.name for s in page_slots if s.node is None], kernel.name
    )
    require_names(
        "unknown", form.called, [s.name for s in page_slots] + interpolated(kernel), kernel.name
    )
    study_slots = tuple(Slot(form.called.get(s.name, s.name), s.node) for s in page_slots)
    form = replace(form, shared=frozenset(form.called.get(s, s) for s in form.shared))
    previous, rates, accelerations = _automatic(kernel, page_slots, study_slots)
    study_slots, form = placed(name, kernel, len(nodes), study_slots, form)
    at_nodes = _nodal_data(kernel)
    require_names("argument", arguments, [*at_nodes, *_arguments(kernel)], kernel.name)
    arguments = _by_node(mesh, name, nodes, at_nodes, arguments)
    timed = {"rate": rates, "acceleration": accelerations}
    automatic = ("dt", *(p for p, slots_of in timed.items() if slots_of))
    for parameter_of_time in automatic[1:]:
        if parameter_of_time in arguments:
            raise StudyError(
                f"{name!r}: {parameter_of_time} comes from the steps in time, it cannot be given"
            )
    arguments = {**kernel.addresses, **arguments}
    filled = {**previous, **rates, **accelerations}
    needed = [p for p in kernel.parameters if p not in automatic]
    needed += [d for d in kernel.data if d not in filled]
    needed += [a.name for a in kernel.arrays]
    missing = [a for a in needed if a not in arguments]
    for common_name, labels in at_nodes.items():
        if set(labels) <= set(missing):
            missing = [common_name if a == labels[0] else a for a in missing if a not in labels[1:]]
    if missing:
        hint = "; where t is the time or load factor, give t=lambda t: t" if "t" in missing else ""
        raise StudyError(f"{name!r}: {kernel.name} needs {', '.join(missing)}{hint}")
    facet = facet_nodes(kernel)
    nowhere = np.full((len(nodes), mesh.dimension), np.nan)
    around = nodes if facet is None else nodes[:, facet]
    centres = mesh.points[around].mean(axis=1) if around.size else nowhere
    data = {
        d: datum(name, d, by_element(arguments[d], len(nodes)), centres)
        for d in kernel.data
        if d in arguments
    }
    arrays = _arrays(name, kernel, arguments)
    kernel = kernel.with_lengths([len(a.numbers) for a in arrays.values()])
    return Block(
        name=name,
        kernel=kernel,
        nodes=nodes,
        kind=kind,
        slots=study_slots,
        options=form,
        data=data,
        previous={d: s for d, s in previous.items() if d not in data},
        rates={d: s for d, s in rates.items() if d not in data},
        accelerations={d: s for d, s in accelerations.items() if d not in data},
        initial=_initial(
            name, kernel, arguments, IntegrationPoints.of(mesh, kernel, kind, around, form.rule)
        ),
        parameters={
            p: parameter_of(kernel, name, p, arguments[p])
            for p in kernel.parameters
            if p in arguments
        },
        arrays=arrays,
    )


def _arrays(block: str, kernel: Kernel, arguments: Mapping[str, Any]) -> dict[str, ArrayData]:
    """Data of all run-time arrays of a kernel.  Raises StudyError."""
    arrays = {a.name: _array_data(block, a, arguments[a.name]) for a in kernel.arrays}
    try:
        require_equal_lengths(kernel.term_groups, arrays)
    except ArrayDataError as error:
        raise StudyError(f"{block!r}: {error}") from None
    return arrays


def _array_data(block: str, array: RunTimeArray, value: object) -> ArrayData:
    """Points of a curve or weights of a network.  Raises StudyError."""
    try:
        return data_of(array, value)
    except ArrayDataError as error:
        raise StudyError(f"{block!r}: {array.name}: {error}") from None


def parameter_of(kernel: Kernel, block: str, name: str, value: Any) -> Number:
    """Value of a parameter of a kernel, or the address of a C function.  Raises StudyError."""
    if name not in kernel.functions:
        return parameter(block, name, value)
    try:
        return address_of(f"{block!r}: {name}", value)
    except FunctionAddressError as error:
        raise StudyError(str(error)) from None


def facet_nodes(kernel: Kernel) -> Integers | None:
    """Nodes on the facet, of the elements of a page on facets; None on cells and sides."""
    stem, _, facet = kernel.cell.partition("_")
    return np.array(CELLS[stem].side_nodes[0][1]) if facet else None


def _require_fit(mesh: Mesh, kernel: Kernel) -> None:
    if kernel.coordinates and len(kernel.coordinates) != mesh.dimension:
        text = (
            f"{kernel.name} has {len(kernel.coordinates)} coordinates a node "
            f"({', '.join(kernel.coordinates)}), the mesh has {mesh.dimension}"
        )
        if mesh.dimension == 1:
            text += "; Mesh.frame(points, cells=...) makes lines in the plane and in space"
        elif mesh.dimension < len(kernel.coordinates):
            text += "; mesh.map(lambda x: ...) may return points with more coordinates"
        raise StudyError(text)


def _arguments(kernel: Kernel) -> list[str]:
    arrays = [a.name for a in kernel.arrays]
    terms = [name for name, _ in kernel.term_history]
    return [*kernel.parameters, *kernel.data, *kernel.point_data, *arrays, *terms]


def _nodal_data(kernel: Kernel) -> dict[str, list[str]]:
    """Data that there are for each node of an element, D1, D2, ..., by their common name D."""
    labels_of = {}
    for label in kernel.data:
        if label.endswith("1") and label[:-1].isidentifier():
            labels = [f"{label[:-1]}{node + 1}" for node in range(kernel.nodes)]
            if kernel.nodes > 1 and set(labels) <= set(kernel.data):
                labels_of[label[:-1]] = labels
    return labels_of


def _by_node(
    mesh: Mesh,
    block: str,
    nodes: Integers,
    at_nodes: Mapping[str, Sequence[str]],
    arguments: Mapping[str, Any],
) -> dict[str, Any]:
    """Data as the kernel calls them, where nodal ones are given by their common name: a number, one
    for each node of the mesh, or a function of the places of nodes.  Raises StudyError.
    """
    kernel_data = dict(arguments)
    for name in at_nodes.keys() & arguments.keys():
        twice = [label for label in at_nodes[name] if label in arguments]
        if twice:
            raise StudyError(f"{block!r}: {name!r} and {twice[0]!r}: the same data twice")
        values = datum(block, name, kernel_data.pop(name), mesh.points)
        kernel_data |= {label: values[nodes[:, k]] for k, label in enumerate(at_nodes[name])}
    return kernel_data


def _automatic(
    kernel: Kernel, page_slots: Sequence[Slot], study_slots: Sequence[Slot]
) -> list[dict[str, Slot]]:
    """Data u_old1, u_rate1, u_acceleration1, ... of nodal unknowns u: what a study fills itself.

    page_slots: unknowns as the page calls them; study_slots: as the study does.
    """
    pairs = zip(page_slots, study_slots, strict=True)
    nodal = {f"{s.name}{{}}{s.node + 1}": name for s, name in pairs if s.node is not None}
    tables = [
        {label.format(suffix): slot for label, slot in nodal.items()}
        for suffix in ("_old", "_rate", "_acceleration")
    ]
    return [{d: table[d] for d in kernel.data if d in table} for table in tables]


def _initial(
    block: str, kernel: Kernel, arguments: Mapping[str, Any], points: IntegrationPoints
) -> Array | None:
    """Point data at the start, (n, points, k); zero where they are not given."""
    if not kernel.point_data:
        return None
    columns = [
        points.values(block, name, arguments.get(name.partition("[")[0], 0.0))
        for name in kernel.point_data
    ]
    return np.stack(columns, axis=2)


def geometry_of(mesh: Mesh, geometry: str | None) -> str:
    """The geometry of a mesh (None: the usual one).  Raises StudyError for one it cannot have."""
    allowed = GEOMETRIES[mesh.dimension]
    if geometry is not None and geometry not in allowed:
        allowed_names = " or ".join(f'"{g}"' for g in allowed)
        stress = "stress" in str(geometry) and mesh.dimension == 2
        advice = "; plane stress is said on a page: docs/fields.md#plane-stress" if stress else ""
        raise StudyError(
            f"geometry = {geometry!r} of a mesh in {mesh.dimension}-D: allowed is "
            f"{allowed_names}{advice}"
        )
    return geometry or allowed[0]


def form_of(
    name: str,
    shared: Sequence[str],
    called: Mapping[str, str] | None,
    along: Mapping[str, int | Integers] | None,
    rule: object,
    constant: bool,
) -> PageOptions:
    """The form of a page on the elements of block `name`.  Raises StudyError."""
    names = _mapping(name, "called", called, '{"u": "u_x"}')
    if not all(isinstance(name_in_study, str) for name_in_study in names.values()):
        raise StudyError(f'{name!r}: called = {names}: names are text, as in called={{"u": "u_x"}}')
    fields = _mapping(name, "along", along, '{"p": 2}')
    orders = {n: int(g) if isinstance(g, np.integer) else g for n, g in fields.items()}
    one = (shared,) if isinstance(shared, str) else shared
    return PageOptions(frozenset(one), names, orders, _rule(name, rule), constant)


def elements_on(name: str, on: Any) -> On:
    """Return a side, or node numbers as an array.  Raises StudyError."""
    side_or_nodes: On = on
    if isinstance(on, np.ma.MaskedArray):
        raise StudyError(f"{name!r}: on is a masked array, whose mask says nothing here")
    if not isinstance(on, list | tuple):
        return side_or_nodes
    try:
        return np.array(on)
    except ValueError:
        raise StudyError(f"{name!r}: on = {on}: elements have the same number of nodes") from None


def _mapping(name: str, word: str, value: Any, example: str) -> Mapping[str, Any]:
    if value is None or isinstance(value, Mapping):
        return dict(value or {})
    raise StudyError(f"{name!r}: {word} = {value!r}: a dict is needed, as in {word}={example}")


def _rule(name: str, rule: Any) -> Rule | None:
    """A rule of quadrature as numbers, also one of a page."""
    if rule is None or isinstance(rule, Rule):
        return rule
    if not callable(getattr(rule, "rows", None)):
        raise StudyError(
            f"{name!r}: rule = {rule!r}: a rule is needed, as in "
            "rule=softehl.quadrature.gauss(4, 1)"
        )
    rows = np.array(rule.rows(), dtype=np.float64)
    return Rule(rows[:, :-1].copy(), rows[:, -1].copy())


def add_block(
    definition: ProblemDefinition,
    name: str,
    origin: KernelOrigin,
    form: PageOptions,
    *,
    on: On,
    cells: str | None,
    arguments: Mapping[str, Any],
) -> None:
    """Add elements of a page, a block for each kind of cell; see `Study.add`."""
    blocks = definition.blocks
    if name in blocks:
        raise StudyError(f"block {name!r} is there already; blocks: {join_names(blocks)}")
    mesh = definition.mesh
    varying = varying_parameters(mesh, arguments, _counts(mesh, on, cells))
    origin = replace(origin, varying=(*varying.items(),))
    try:
        kernels = _kernels(mesh, origin, on, cells)
    except ValueError as error:
        pointwise = [n for n, array in varying.items() if array == "point data"]
        if not pointwise or not _caused_by(error, "pointwise"):
            raise
        raise StudyError(
            f"{name!r}: {join_names(pointwise)} by node, by integration point or as a function of "
            "coordinates: the page uses it outside of an integral; give an array by element, (n,)"
        ) from error
    for kernel in kernels:
        label = name if len(kernels) == 1 else f"{name}:{kernel.cell}"
        elements = elements_of(definition.mesh, label, kernel, on, cells)
        block = page_on(definition.mesh, label, kernel, elements, form, arguments)
        require_apart(block, blocks.values())
        blocks[label] = replace(
            block,
            differentiated=origin.differentiated(kernel),
            twice_differentiated=origin.differentiated(kernel, 2),
            valued=origin.valued(kernel),
        )


def _counts(mesh: Mesh, on: On, cells: str | None) -> set[int]:
    """Numbers of elements on the selected kinds of cells or faces."""
    if isinstance(on, np.ndarray):
        return {len(on)}
    if on is None:
        return {len(nodes) for nodes in mesh.cells_of(cells).values()}
    if on == "interior" and on not in mesh.sides:
        return {len(interior(mesh, kind)) for kind in mesh.cells}
    try:
        return {len(nodes) for nodes in mesh.faces(on).values()}
    except MeshError:
        return {mesh.nodes(on).size}


def _kernels(mesh: Mesh, origin: KernelOrigin, on: On, cells: str | None) -> list[Kernel]:
    """Kernels of a page on the selected kinds of cells or faces."""
    kinds = kinds_of(mesh, on, cells)
    try:
        kernels = [origin.loaded(kinds[0] if kinds else None)]
    except ValueError as error:
        if on is None or isinstance(on, np.ndarray) or not _caused_by(error, "traces"):
            raise
        kinds = beside_of(mesh, on)
        kernels = [origin.loaded(kinds[0])]
    if kernels[0].cell and not isinstance(origin.source, Kernel):
        kernels += [origin.loaded(kind) for kind in kinds[1:]]
    return kernels
