"""Fields and blocks as they are declared; `cases.seal.equations.system` lists them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from softehl.cases.seal.gland.parameters import Seal
from softehl.runtime.kernels import Rule

Place = Literal["nodes", "film", "arc_nodes", "outer_nodes", "wall_nodes", "section"]
Group = Literal["solid", "load", "contact", "film", "squeeze", "support"]


@dataclass(frozen=True)
class Field:
    """A field of unknowns; a case has those that its blocks know.

    on: what has one of them: each node (two displacements), each segment of the film (the
    coefficients of a polynomial), each node of the arc, of the other boundary or of what may touch
    a wall, or the section.
    scale: reference size of its residuals. of: names of its unknowns, left out: one, its own.
    """

    name: str
    on: Place
    scale: Callable[[Seal], float]
    of: tuple[str, ...] = ()

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of its unknowns."""
        return self.of or (self.name,)


@dataclass(frozen=True)
class Block:
    """Elements of one kernel.

    kernel: its name, with words of the case (see `kernel_of`); the solid is that of its region, ""
    where it is the case's.
    elements: a set of `SealSection.elements`. fields: of its unknowns that are not displacements,
    in the order in which the kernel has them. group: which values its parameters are taken from.
    layer: whether it belongs to the film in the modified Newton iteration, which then treats it
    exactly. needed: whether a case has it. rule: its quadrature, None for the kernel's own.
    constant: the tangent depends on parameters alone.
    """

    name: str
    kernel: str
    elements: str
    fields: tuple[str, ...]
    group: Group
    layer: bool = False
    needed: Callable[[Seal], bool] = lambda _: True
    rule: Callable[[Seal], Rule] | None = None
    constant: bool = False
    region: str = ""

    def kernel_of(self, p: Seal) -> str:
        """Name of the kernel in a case."""
        return self.kernel.format(
            solid=p.rubber(self.region).solid_kernel(p.solid),
            edge="_corner" if p.opens else "",
            oil=p.film_suffix,
            rough="_rough" if p.rough else "",
            conserving="rough" if p.rough else f"conserving{p.film_suffix}",
        )
