"""Combinations that are refused: (relations, condition on the problem, message); no relations: all.

The first line that fits a combination counts.
"""

from __future__ import annotations

from collections.abc import Callable

from tests.crossings.features import ANALYSES, DEVICE, LAWS, WITHOUT_MATRIX, March, Problem


def _moves(at: Problem) -> bool:
    """Whether the analysis has inertia."""
    analysis = ANALYSES[at.analysis]
    return isinstance(analysis, March) and analysis.rho is not None


def _mixed(at: Problem) -> bool:
    """Whether the law has unknowns without mass."""
    return at.law in ("mixed", "condensed", "taylor-hood", "enhanced")


def _again(at: Problem) -> bool:
    """Whether corners of the body would have two prescribed values."""
    return at.load == "prescribed" and at.constraint == "sliding side"


def _rigid(at: Problem) -> bool:
    """Whether a side is rigid."""
    return at.constraint == "rigid side"


def _products(at: Problem) -> bool:
    """Whether the solver needs products."""
    return at.solver in WITHOUT_MATRIX


def _has_no_product(at: Problem) -> bool:
    """Whether law or cell have no product by sum factorisation."""
    if not at.cell.startswith(("quad", "hex")) or at.cell in ("quad8", "hex20"):
        return True
    named = at.properties is LAWS[at.law] and at.law != "product"
    return named or at.law in ("softened", "mixed", "condensed")


Row = tuple[tuple[str, ...], Callable[[Problem], bool], str]
"""Relations, condition, message."""

REFUSED: tuple[Row, ...] = (
    ((), lambda at: at.law == "unit cells" and at.geometry == "axisymmetric", "in plane strain"),
    (("large ring",), lambda at: at.law == "unit cells", "in plane strain"),
    (
        (),
        lambda at: at.law == "unit cells" and _products(at) and at.analysis != "follow",
        "MatrixFree does not solve",
    ),
    (
        ("sensitivity", "hessian"),
        lambda at: at.law == "unit cells" and not _moves(at),
        "through which nothing is differentiated",
    ),
    ((), lambda at: at.solver in DEVICE and at.analysis == "follow", "follow takes no engine"),
    ((), lambda at: at.solver == "matrix-free" and at.analysis == "follow", "it factorises"),
    ((), lambda at: at.solver == "amg" and at.analysis == "follow", "it factorises"),
    ((), lambda at: _products(at) and _has_no_product(at), "no product by sum"),
    ((), lambda at: at.solver in DEVICE and at.law == "learned", "a device knows"),
    (("contact",), _products, "no product by sum"),
    (("rigid surface",), _products, "rule of its own"),
    ((), lambda at: _products(at) and _moves(at), "inertia has no such products"),
    (("sensitivity", "hessian"), _moves, "has no derivatives"),
    (
        ("sensitivity", "hessian"),
        lambda at: at.analysis == "follow" and at.properties.history,
        "depends on the steps before it",
    ),
    ((), _again, "prescribed twice"),
    ((), lambda at: _rigid(at) and at.load == "prescribed", "moves with the rigid body"),
    ((), lambda at: _rigid(at) and at.solver == "amg", "multigrid needs"),
    ((), lambda at: _rigid(at) and _products(at), "no product by sum"),
    ((), lambda at: _rigid(at) and at.analysis == "explicit", "grip:.* has no mass everywhere"),
    ((), lambda at: _rigid(at) and at.analysis == "newmark", "is a multiplier, whose error"),
    (("hessian",), lambda at: at.load == "weight", "comes as C without second derivatives"),
    (("hessian",), lambda at: at.law == "learned", "no third derivatives"),
    (("hessian",), lambda at: at.law == "softened", "history of each term"),
    (("hessian",), lambda at: at.law == "split", "a third derivative of m.isotropic"),
    (("hessian",), _rigid, "comes as C without second derivatives"),
    (
        ("static state", "equilibrium", "contact", "rigid surface"),
        lambda at: at.analysis == "explicit" and _mixed(at),
        "explicit.*(no mass everywhere|belongs to elements)",
    ),
    (
        ("static state",),  # the stable step before an extension is that of a shortening
        lambda at: at.analysis == "explicit" and at.law == "split",
        "come from the scheme|forces are not finite: element",
    ),
    (("tied halves",), lambda at: at.solver == "amg", "multigrid needs"),
    (("tied halves",), lambda at: at.constraint == "tied sides", "tied in a circle"),
    (("law of contact",), _moves, "a contact by law=... has no march with inertia"),
    (("contact", "rigid surface"), lambda at: at.solver == "amg", "multigrid needs"),
)
"""What a user reads."""
