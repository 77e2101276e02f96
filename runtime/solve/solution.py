"""Solutions and paths, which solvers hand back: failure is a value with advice, not an exception.

Newton returns a `Solution`, continuation a `Branch` of them. Inner layers read `status` and react
(continuation cuts its step); only the outermost caller turns a failure into an exception, with
`raise_for_status`.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array


class Status(enum.Enum):
    """End of a solver or of a path; `advice` has the likely causes and their remedies."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "too many iterations"
    DIVERGED = "diverged"
    SINGULAR = "singular tangent"
    NOT_HELD = "not held"
    NOT_FINITE = "residual not finite"
    REFUSED = "refused by a guard"
    STEP_TOO_SMALL = "continuation step too small"
    TURNING_POINT = "the path turns back"
    ROUNDING = "continuation step lost in rounding"
    KILLED = "ended from outside"

    @property
    def advice(self) -> str:
        """Likely causes and their remedies; empty when converged."""
        return _ADVICE[self]


_ADVICE = {
    Status.CONVERGED: "",
    Status.MAX_ITERATIONS: (
        "Take a smaller step. If the last norms alternate between two values, an active set "
        "(contact, cavitation) is cycling: change its scaling or allow the line search. If they "
        "fall slowly and steadily, the tangent is not the derivative of the residual."
    ),
    Status.DIVERGED: "Take a smaller step, or start from a solution of a nearby easier problem.",
    Status.SINGULAR: (
        "Look for a rigid motion or an unknown that no equation holds; at a limit point of the "
        "load follow the path by arc length instead."
    ),
    Status.NOT_HELD: "Prescribe what is missing (fix), or hold it by springs or ties.",
    Status.NOT_FINITE: (
        "Take a smaller step; check that the start is admissible (positive Jacobian, positive "
        "film thickness) and that step_limit keeps it so."
    ),
    Status.REFUSED: (
        "Equations hold there, but what they mean does not: take a smaller step, or a finer mesh."
    ),
    Status.KILLED: "Give it more memory or fewer processes at a time.",
    Status.STEP_TOO_SMALL: (
        "The path may end or turn back here (limit point: follow it by arc length), or the mesh "
        "is too coarse for this parameter; otherwise allow smaller steps."
    ),
    Status.TURNING_POINT: (
        "There is no solution beyond a limit point: follow the path by arc length (`follow` of a "
        "study), or on a finer mesh if the turn is not expected."
    ),
    Status.ROUNDING: "Measure the parameter from a place nearby, so that its digits suffice.",
}


class NotConverged(SoftehlError, RuntimeError):  # noqa: N818 (named after what it is)
    """A path or a solution did not reach its end; the message has the reason and a remedy.

    Parameters
    ----------
    result : Solution or Branch
        The one that failed.
    reached : Result, optional
        The last converged state of a study.
    """

    def __init__(self, result: Solution | Branch, reached: Any = None) -> None:
        super().__init__(f"{result.status.value}: {result.message}. {result.status.advice}")
        self.result = result
        self.reached = reached


@dataclass(frozen=True, eq=False)
class Solution:
    """End of one Newton solution, converged or not.

    Attributes
    ----------
    x : array (n,)
        Last accepted iterate; empty after `forget`.
    status : Status
        CONVERGED, or the reason of the failure.
    message : str
        The end in words.
    residual_norms : tuple of float
        Dimensionless norm at the start and after each iteration.
    factorisations : int
        Number of matrices that were factorised.
    iterations : int
        Number of iterations.
    best : array (n,), optional
        Of a failed solution, the iterate of the least norm, if that is not x.
    rung : int
        Number of the solver of a `Ladder` that ended; those before it failed.
    """

    x: Array = field(repr=False)
    status: Status
    message: str
    residual_norms: tuple[float, ...] = field(repr=False)
    factorisations: int
    iterations: int
    best: Array | None = field(default=None, repr=False)
    rung: int = 0

    @property
    def converged(self) -> bool:
        """True if the status is CONVERGED."""
        return self.status is Status.CONVERGED

    @property
    def nearest(self) -> Array:
        """Iterate (n,) of the least norm."""
        return self.x if self.best is None else self.best

    def forget(self) -> Solution:
        """Return the solution without its vectors.

        Returns
        -------
        Solution
            A copy with an empty x.
        """
        return replace(self, x=np.empty(0), best=None)

    def raise_for_status(self) -> Solution:
        """Return the solution if it converged.

        Returns
        -------
        Solution
            The solution itself.

        Raises
        ------
        NotConverged
            It did not converge.
        """
        if not self.converged:
            raise NotConverged(self)
        return self


@dataclass(frozen=True, eq=False)
class Point:
    """Converged point of a path.

    Attributes
    ----------
    parameter : float
        Load factor, time or another parameter.
    solution : Solution
        Unknowns, and the record of Newton's method.
    """

    parameter: float
    solution: Solution


@dataclass(frozen=True, eq=False)
class LimitPoint:
    """Limit point of a path: the parameter has a maximum or minimum.

    Attributes
    ----------
    parameter : float
        Parameter, such as the load factor; `t` is the same.
    x : array (n,)
        Unknowns.
    kind : str
        "maximum" or "minimum".
    index : int
        Number of points of the path before it.
    located : bool
        False if the corrector failed during the search: parameter and x are then those of the
        nearer end of the step.
    """

    parameter: float
    x: Array = field(repr=False)
    kind: str
    index: int
    located: bool

    @property
    def t(self) -> float:
        """The parameter."""
        return self.parameter


@dataclass(frozen=True, eq=False)
class Branch:
    """A path: every converged point in order, and its end.

    Attributes
    ----------
    points : tuple of Point
        Converged points; only the last two have their x unless all were requested.
    status : Status
        CONVERGED if the end was reached, else the reason.
    message : str
        The end in words.
    factorisations : int
        Total number, including failed attempts.
    iterations : int
        Total number, including failed attempts.
    failures : tuple of Point
        Failed attempts, without x; each made the step smaller.
    limit_points : tuple of LimitPoint
        Limit points (arc length only).
    """

    points: tuple[Point, ...]
    status: Status
    message: str
    factorisations: int = 0
    iterations: int = 0
    failures: tuple[Point, ...] = ()
    limit_points: tuple[LimitPoint, ...] = ()

    def __repr__(self) -> str:
        """Summary in one line."""
        bounds = " to ".join(f"{t:.6g}" for t in (*self.parameters[:1], *self.parameters[-1:]))
        return (
            f"<Branch: {len(self.points)} points, {bounds or 'none'}; {self.status.value}; "
            f"{len(self.failures)} failures, {len(self.limit_points)} limit points>"
        )

    @property
    def converged(self) -> bool:
        """True if the requested end was reached."""
        return self.status is Status.CONVERGED

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters of the converged points, in order."""
        return tuple(point.parameter for point in self.points)

    @property
    def last(self) -> Solution:
        """Solution of the last converged point; IndexError if there is none."""
        return self.points[-1].solution

    @property
    def end(self) -> Solution:
        """Solution at the end of the path; of a failed path the last attempt, without x."""
        if self.converged:
            return self.last
        attempts = self.failures or self.points
        return replace(attempts[-1].solution, status=self.status, message=self.message)

    def raise_for_status(self) -> Branch:
        """Return the branch if its end was reached.

        Returns
        -------
        Branch
            The branch itself.

        Raises
        ------
        NotConverged
            The end was not reached.
        """
        if not self.converged:
            raise NotConverged(self)
        return self
