"""Structure of a potential: linear forms of its unknowns, and quadratic values of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from softehl.codegen.derive.interfaces import Interface, linear_interface
from softehl.codegen.derive.invariants import (
    ABOVE,
    degrees,
    quadratic_interface,
    through_invariants,
)
from softehl.codegen.graph.domain import WHOLE
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traverse import always, reachable, strip, substitute
from softehl.codegen.language.definition import Definition


@dataclass(frozen=True)
class Structure:
    """A potential `root` rewritten through what was found in it, with its `constant` values.

    `interface` holds the modal coordinates and the point values, `forms` the linear forms of
    these (displacement gradients), `squares` quadratic values of the forms (strain measures);
    `invariants` is True where the squares are fewer than those of the page.
    """

    root: Node
    constant: tuple[Node, ...]
    interface: Interface
    forms: tuple[Node, ...]
    squares: tuple[Node, ...] = ()
    invariants: bool = False


def linear_forms(d: Definition) -> Structure | None:
    """The potential through linear forms of the unknowns; None where there is nothing to gain."""
    if d.interpolated or d.given:
        return None
    g = d.graph
    (root,), kept = strip(g, [d.potential], d.constant)
    if _guarded_coefficients(root, d.directions):
        return None
    interface = linear_interface(g, [root], d.directions)
    if interface is None:
        return None
    named: dict[Node, Node] = {}
    replacement = {z: _named(g, value, named) for z, value in interface.rewritten.items()}
    (root,), new = substitute(g, [root], replacement)
    constant = _left(new, (kept[c] for c in d.constant if c in kept))
    return Structure(root, constant, interface, tuple(named.values()))


def quadratic_values(d: Definition, s: Structure) -> Structure:
    """The structure through named quadratic values of the forms: invariants where some suffice.

    In three dimensions no invariants are looked for in pages of fields, where this takes ten times
    as long as all the rest and saves one operation in fourteen, and in pages with history, whose
    local equations hold so many polynomials that the search takes minutes.
    """
    g = d.graph
    quick = len(d.coordinates) not in (1, 2) and (d.point is not None or bool(d.point_data))
    reduced = None if quick else through_invariants(g, [s.root], s.forms, s.constant)
    if reduced is not None:
        constant = _left(reduced.images, s.constant)
        (root,), squares = reduced.roots, reduced.squares
        return replace(s, root=root, constant=constant, squares=squares, invariants=True)
    found = quadratic_interface([s.root], s.forms, s.constant)
    named = {q: g.name(f"q{k}", q) for k, q in enumerate(found)}
    (root,), new = substitute(g, [s.root], named)
    constant = _left(new, s.constant)
    return replace(s, root=root, constant=constant, squares=tuple(named.values()))


def _left(new: Mapping[Node, Node], constant: Iterable[Node]) -> tuple[Node, ...]:
    """New nodes of the constant values; one that is now inside a named form needs no freezing.

    Forms have coefficients that do not depend on the unknowns.
    """
    return tuple(new[c] for c in constant if c in new)


def found_in(d: Definition) -> Structure | None:
    """Both, one after the other."""
    forms = linear_forms(d)
    return None if forms is None else quadratic_values(d, forms)


def _named(g: Graph, form: Node, named: dict[Node, Node]) -> Node:
    """The name of a linear form; a form and its negative share one."""
    negative = g.neg(form)
    if negative in named:
        return g.neg(named[negative])
    return named.setdefault(form, g.name(f"z{len(named)}", form))


_PARTIAL = frozenset({Op.RECIP, Op.POW, Op.POWER, Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP})


def _guarded_coefficients(root: Node, sources: Sequence[Node]) -> bool:
    """True where a polynomial of the unknowns holds what has a value on one side of a branch only.

    An interface would take such a coefficient out of its branch.  Other values, such as the
    logarithm of a volume ratio, stand above all interfaces and stay there.
    """
    unguarded = set(always([root]))
    degree = degrees([root], sources, ())
    polynomials = [n for n in degree if 0 < degree[n] < ABOVE]
    below = (n for n in reachable(polynomials) if n.op in _PARTIAL and n not in unguarded)
    return any(n.op is not Op.POW or n.payload not in WHOLE for n in below)
