"""Elements along a chain of nodes, one after another: a film, its facets, a beam."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.dofs import displacement_dofs, gather_rows
from softehl.runtime.kernels import Rule, load_kernel


def chain_block(name: str, nodes: Array, after: Integers, rule: Rule) -> ElementBlock:
    """A block of the kernel `name`, and called so: element i has the nodes i, i + 1, ...

    nodes: (m, 2); each carries two displacements, numbered from zero on. after: (n, k) unknowns of
    the elements that follow those of their m - n + 1 nodes.
    """
    chain = np.arange(len(after))[:, None] + np.arange(len(nodes) - len(after) + 1)
    places = nodes[chain].reshape(len(chain), -1)
    numbers = gather_rows(displacement_dofs(chain), after)
    return ElementBlock(name, load_kernel(name), places, numbers, rule=rule)
