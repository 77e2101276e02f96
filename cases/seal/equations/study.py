"""A seal as a study: each declared block on its elements of the section, in the state at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import (
    FIELDS,
    Block,
    Values,
    film_values,
    obstacles_of,
    values_at_rest,
)
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.discretisation import Discretisation
from softehl.cases.seal.section.section import SealSection
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import ElementKernel
from softehl.runtime.fem.contact import contact_data
from softehl.runtime.fem.dofs import chain_dofs, separate_dofs
from softehl.runtime.kernels import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.study import Study

NUMBERED = {field.name: field.unknowns for field in FIELDS}
"""Fields with the names of their unknowns, in the order of the vector."""

_ON = {field.name: field.on for field in FIELDS}
_STILL = FilmLoads(0.0, "out", 0.0, np.empty(0))


def seal_study(p: Seal, section: SealSection, blocks: Sequence[Block]) -> Study:
    """The study of a section: nothing moves, nothing presses, no unknown is prescribed.

    Raises KeyError for a kernel that asks for a value that nobody gives.
    """
    places, still = _film_places(p, section), film_values(p, _STILL)
    elements = {
        **section.elements,
        "film_nodes": np.empty((len(places["film_nodes"]), 0), np.int64),
    }
    study = Study(Mesh(section.mesh.points, {"quad4": section.mesh.quads}), "axisymmetric")
    for block in blocks:
        kernel = load_kernel(block.kernel_of(p))
        own = [name for name, node in kernel.places if node is None]
        values = chosen(block, kernel, values_at_rest(block, p, section) or still)
        by_steps = {"rate"} if any("_rate" in name for name in kernel.data) else set()
        given: dict[str, Any] = {n: v for n, v in values.items() if n not in by_steps}
        study.add(
            block.name,
            kernel,
            on=elements[block.elements],
            shared=[u for u, f in zip(own, block.fields, strict=False) if _ON[f] == "section"],
            called=dict(zip(own, block.fields, strict=False)),
            along={f: places[block.elements] for f in block.fields if _ON[f] == "film"},
            rule=block.rule(p) if block.rule else None,
            constant=block.constant,
            **given | _contact_constants(p, section, block, kernel.data),
        )
    return study


def _film_places(p: Discretisation, section: SealSection) -> Mapping[str, Integers]:
    """Places (n, k) of film pressures on the sets of elements that know them.

    m_p a segment and one more where pressures are continuous, m_p + 1 a segment in (22).
    """
    number = chain_dofs if p.reynolds == "fe" else separate_dofs
    arc = number(section.mesh.arc, p.pressure_order, 0)
    facets = np.concatenate([arc[:-1], arc[1:]], axis=1)
    return {"arc": arc, "facets": facets, "film_nodes": np.arange(arc.max() + 1)[:, None]}


def _contact_constants(
    p: Seal, section: SealSection, block: Block, names: Sequence[str]
) -> dict[str, Array]:
    """Constants (n,) of contact elements by these names; none of other blocks."""
    if block.group != "contact":
        return {}
    chain = section.chains[block.elements]
    stiffness, obstacle = section.node_moduli(p)[chain[0]], obstacles_of(p)[block.name]
    values = contact_data(obstacle, section.mesh.points, *chain, stiffness)
    known = dict(zip(("n_z", "n_r", "c", "area", "rho"), values.T, strict=True))
    return {name: value for name, value in known.items() if name in names}


def chosen(block: Block, kernel: ElementKernel, values: Values) -> Values:
    """Values that the kernel of a block asks for.  Raises KeyError for one that is not there."""
    missing = [name for name in kernel.parameters if name not in values]
    if missing:
        raise KeyError(
            f"block {block.name!r} asks for {', '.join(missing)}; "
            f"cases/seal/equations/system.py gives {block.group} blocks {', '.join(values)}"
        )
    return {name: values[name] for name in kernel.parameters}
