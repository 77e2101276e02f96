"""Faces and cells by their nodes: which stand alone, which twice, which way they look."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Flags, Integers


def unrepeated_faces(faces: Integers, corners: int, origin: Integers | None = None) -> Integers:
    """The rows whose corners, the first of their nodes, occur only once.

    origin: number of each node, the same for copies of one.
    """
    originals = faces if origin is None else origin[faces]
    _, first, count = np.unique(
        np.sort(originals[:, :corners], axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.ascontiguousarray(faces[np.sort(first[count == 1])])


def first_occurrences(rows: Integers) -> tuple[Integers, Integers]:
    """Of rows (n, k) with the same nodes in any order the first, in the order of the rows; and for
    each row (n,) which of these it is.
    """
    keys = np.sort(rows, axis=1)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.ravel()]


def match_faces(faces: Integers, reference: Integers, corners: int) -> Integers:
    """For each face (n,) the row of the known ones with the same corners, else -1."""
    both = np.sort(np.concatenate([reference, faces])[:, :corners], axis=1)
    _, inverse = np.unique(both, axis=0, return_inverse=True)
    inverse = inverse.ravel()
    row = np.full(int(inverse.max(initial=-1)) + 1, -1)
    row[inverse[: len(reference)]] = np.arange(len(reference))
    return np.asarray(row[inverse[len(reference) :]])


def orient_as(faces: Integers, reference: Integers, corners: int) -> Integers:
    """Faces with the nodes in the order of the known ones, where they are among them."""
    row = match_faces(faces, reference, corners)
    return np.where((row >= 0)[:, None], reference[row], faces) if len(reference) else faces


def is_repeated(rows: Integers) -> Flags:
    """Which rows (n, k) have the nodes of a row before them."""
    first, rank = first_occurrences(rows)
    return np.asarray(first[rank] != np.arange(len(rows)))
