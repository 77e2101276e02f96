"""Specification of a legal graph, executable: the tests run it between passes."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from softehl.codegen.graph.graph import (
    BOOLEAN,
    ELEMENTARY,
    InputEntry,
    Node,
    Op,
    ResultIndex,
    Routine,
)
from softehl.codegen.graph.traversal import reachable
from softehl.errors import SoftehlError

ARITY: dict[Op, int] = {
    **dict.fromkeys((Op.CONST, Op.PI, Op.INPUT), 0),
    **dict.fromkeys(
        (Op.NAME, Op.NEG, Op.RECIP, Op.POW, Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP), 1
    ),
    **dict.fromkeys((Op.SIN, Op.COS, Op.NOT, Op.SUM), 1),
    **dict.fromkeys(ELEMENTARY, 1),
    **dict.fromkeys((Op.ATAN2, Op.POWER, Op.ADD, Op.SUB, Op.MUL), 2),
    **dict.fromkeys((Op.LT, Op.LE, Op.EQ, Op.AND, Op.OR), 2),
    Op.BRANCH: 3,
    Op.ITEM: 1,
    Op.CALL: -1,
}
"""Operands of each operation; -1: as many as the routine says."""
PAYLOAD: dict[Op, type] = {
    Op.CONST: Fraction,
    Op.POW: Fraction,
    Op.INPUT: InputEntry,
    Op.NAME: str,
    Op.CALL: Routine,
    Op.ITEM: ResultIndex,
}


class IllegalGraphError(SoftehlError, ValueError):
    """A node breaks the specification; the message shows it."""


def check(roots: Sequence[Node], *, names: bool = True) -> None:
    """Raise `IllegalGraphError` unless every node below `roots` is legal.

    `names=False` also forbids NAME nodes: they live only until the passes begin.
    """
    for n in reachable(roots):
        arity = n.payload.inputs if isinstance(n.payload, Routine) else ARITY[n.op]
        if len(n.args) != arity:
            raise IllegalGraphError(f"{n}: {n.op} takes {arity} operands")
        if not isinstance(n.payload, PAYLOAD.get(n.op, type(None))):
            raise IllegalGraphError(f"{n}: payload of a wrong kind")
        if any(a.id >= n.id for a in n.args):
            raise IllegalGraphError(f"{n}: an operand is younger than its user")
        if n.op is Op.NAME and not names:
            raise IllegalGraphError(f"{n}: a name survived the passes")
        if n.op is Op.SUM and n.varying:
            raise IllegalGraphError(f"{n}: a sum over points cannot vary with the point")
        _check_kinds(n)


def _check_kinds(n: Node) -> None:
    """Conditions where conditions belong, numbers everywhere else."""
    logical = {Op.AND: (0, 1), Op.OR: (0, 1), Op.NOT: (0,), Op.BRANCH: (0,)}.get(n.op, ())
    for k, a in enumerate(n.args):
        if (a.op in BOOLEAN) != (k in logical):
            raise IllegalGraphError(
                f"{n}: operand {k} is {'no' if k in logical else 'a'} condition"
            )
        if (a.op is Op.CALL) != (n.op is Op.ITEM):
            raise IllegalGraphError(f"{n}: results of a routine are taken by item, and only they")
