"""Every statement of the paper as (place, words, measure), in its order."""

from collections.abc import Callable

from softehl.cases.paper.findings_film import FILM
from softehl.cases.paper.findings_mesh import MESH
from softehl.cases.paper.query import Finding, Query

__all__ = ["FINDINGS", "Finding", "Query"]

FINDINGS: tuple[tuple[str, str, Callable[[Query], Finding]], ...] = (*FILM, *MESH)
