"""Messages of a case while it runs, and the outcome that it returns at the end.

A case computes; it neither prints nor writes.  Every result leaves it through a
:class:`Observer`, at the moment it exists, so that a run that is killed keeps what it reached.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypedDict, TypeVar, Unpack

from softehl.cases.harness.file_content import Content
from softehl.cases.harness.row import Row
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Status

S = TypeVar("S")


@dataclass(frozen=True, eq=False)
class State:
    """A state that was asked for: its row of curve.csv and the contents of the row's files.

    advice: what to do about a row that is no result.
    """

    row: Row
    contents: Sequence[Content] = ()
    advice: str = ""


@dataclass(frozen=True)
class StageRecord:
    """Cost of one stage of a run.

    residual_histories: for each converged step the norms Newton went through.  parameters: the path
    parameter of each of those steps.  factorisations: None where it is not known, because the run
    was cut short.  where: further values that identify the stage, as run.json has them.  method:
    the method that solved it, and why a faster one gave up if one did.
    """

    name: str
    seconds: float
    factorisations: int | None
    iterations: int
    residual_histories: tuple[tuple[float, ...], ...]
    parameters: tuple[float, ...] = ()
    where: Mapping[str, Any] = field(default_factory=dict)
    method: str = "newton"


@dataclass(frozen=True)
class Outcome(Generic[S]):
    """Result of a run: its states, and the cost of its stages.

    Attributes
    ----------
    states : tuple
        States in the order of the run, of the case's own class.
    status : Status
        Whether all states were reached.
    message : str
        Reason, if they were not.
    unknowns : mapping of str to int
        Number of unknowns, "total" and of parts.
    kernel_signatures : mapping of str to str
        Kernel -> signature of the compiled kernel.
    stages : tuple of StageRecord
        Cost of each stage; empty where the observer recorded all of it.
    solvers : mapping of str to str
        "linear" -> the linear solver in use, "solver" -> the method that was requested.
    numbers : mapping of str to float
        Further results, name with unit -> value.
    """

    states: tuple[S, ...]
    status: Status
    message: str
    unknowns: Mapping[str, int] = field(default_factory=dict)
    kernel_signatures: Mapping[str, str] = field(default_factory=dict)
    stages: tuple[StageRecord, ...] = ()
    solvers: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """True if every requested state was reached (whatever its verdict)."""
        return self.status is Status.CONVERGED


class StepReport(TypedDict):
    """A step of a path that has converged, as observers are told of it.

    label: name of the path parameter as it is shown. parameter: its value. residuals: norms of
    Newton's iterates. fraction: share of the stage done in [0, 1], if known.
    """

    label: str
    parameter: float
    iterations: int
    residuals: Sequence[float]
    fraction: float | None


class Observer(Protocol):
    """Listener of a run; calls come in order, from one thread."""

    def stage(self, name: str, **marks: Any) -> None:
        """Begin a stage.

        Parameters
        ----------
        name : str
            Name of the stage.
        **marks
            Further values that identify it; `Case.stage_label` shows them.
        """
        return None

    def step(self, **step: Unpack[StepReport]) -> None:
        """Report a converged step of the path.

        Parameters
        ----------
        **step
            `label`, `parameter`, `iterations`, `residuals` and `fraction` of the step; the label is
            for instance "U [mm/s]" or "load".
        """
        return None

    def state(self, state: State) -> None:
        """Report a requested state, to be saved now.

        Parameters
        ----------
        state : State
            Its row and the contents of its files.
        """
        return None

    def files(self, contents: Mapping[str, Content]) -> None:
        """Report files that belong to no row.

        Parameters
        ----------
        contents : mapping of str to Content
            File name -> columns, or a section.
        """
        return None

    def saved_row(self, key: float) -> tuple[Row, Sequence[Mapping[str, Array]]] | None:
        """Return a row of an earlier run in this folder; only for a run in this process.

        Parameters
        ----------
        key : float
            Key of the row.

        Returns
        -------
        tuple of Row and sequence of mappings, or None
            The row and its tables, column -> array (n,); None if there is none.
        """
        return None

    def draft(self, key: float, arrays: Mapping[str, Array]) -> None:
        """Keep the unfinished part of a long row for a resumed run; only in this process.

        Parameters
        ----------
        key : float
            Key of the row.
        arrays : mapping of str to array
            Its data.
        """
        return None

    def drafted(self, key: float) -> Mapping[str, Array] | None:
        """Return the last draft of a row that an earlier run left.

        Parameters
        ----------
        key : float
            Key of the row.

        Returns
        -------
        mapping of str to array, or None
            The draft; None if there is none.
        """
        return None
