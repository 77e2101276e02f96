"""Arrays of device kernels, by NumPy alone; target `cuda` prints these functions as they are."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbered(nodes: list[Any], counts: list[int], components: list[int]) -> tuple[Any, Any]:
    """Nodes of elements of all fields, numbered through, and the first unknown of each.

    nodes: for the fields of each order (n, k) numbers from 0. counts: of these nodes. components:
    unknowns of one. Returns (n, sum of k) and (nodes + 1,).
    """
    before = np.cumsum([0, *counts])
    every = np.concatenate([a + b for a, b in zip(nodes, before, strict=False)], axis=1)
    return every, np.cumsum([0, *np.repeat(components, counts)])


def sparse_pattern(nodes: Any, first: Any) -> tuple[Any, Any, Any]:
    """Row starts, columns and slots of a CSR matrix of elements.

    nodes: (n, k). first: (nodes + 1,) first unknown of each. slots: (n, k, k) place in the row of
    a node of the first unknown of another.
    """
    count, k = len(first) - 1, nodes.shape[1]
    i, j = np.repeat(nodes, k, axis=1).ravel(), np.tile(nodes, k).ravel()
    pairs, inverse = np.unique(i.astype(np.int64) * count + j, return_inverse=True)
    start = np.searchsorted(pairs, np.arange(count + 1) * count)
    near = pairs % count
    widths = first[near + 1] - first[near]
    places = np.cumsum(np.append(0, widths))
    unknowns = np.arange(places[-1]) + np.repeat(first[near] - places[:-1], widths)
    begin = places[start]
    of_row = np.repeat(np.arange(count), np.diff(first))
    lengths = np.diff(begin)[of_row]
    rows = np.cumsum(np.append(0, lengths))
    columns = unknowns[np.arange(rows[-1]) + np.repeat(begin[of_row] - rows[:-1], lengths)]
    slots = (places[inverse] - begin[i]).reshape(len(nodes), k, k)
    return rows.astype(np.int32), columns.astype(np.int32), slots.astype(np.uint16)


def by_blocks(history: Any, elements: int) -> Any:
    """Numbers of points (n, points, k) as (blocks, k, points of a block); elements: of a block."""
    n, points, k = history.shape
    blocks = -(-n // elements)
    padded = np.zeros((blocks * elements, points, k))
    padded[:n] = history
    grouped = padded.reshape(blocks, elements * points, k)
    return np.ascontiguousarray(grouped.transpose(0, 2, 1))
