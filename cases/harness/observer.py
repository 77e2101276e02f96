"""Messages of a case while it runs, and the outcome that it returns at the end.

A case computes; it neither prints nor writes.  Every result leaves it through a
:class:`RunObserver`, at the moment it exists, so that a run that is killed keeps what it reached.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypedDict, Unpack

from softehl.cases.harness.file_content import Content
from softehl.cases.harness.row import Row
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Status


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
class RunOutcome:
    """States that a run reached; `status` and `message` say why it is not more, if it is not.

    states: as the observer was told them.  unknowns: their numbers, "total"
    and those of parts.  kernel_signatures: kernel name -> signature of the compiled kernel.
    solvers: "linear" -> the linear solver in use, "solver" -> the way that was asked for.
    numbers: further results of the run as a whole, name with unit -> value.
    stages: their cost; empty where the observer was told all that is to be recorded.
    """

    states: tuple[Any, ...]
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


class RunObserver(Protocol):
    """The listener a case reports to.  Calls come in order, from one thread."""

    def stage(self, name: str, *, title: str, where: Mapping[str, Any]) -> None:
        """A stage begins.  title: what the user sees.  where: see :class:`StageRecord`."""
        return None

    def step(self, **step: Unpack[StepReport]) -> None:
        """A step of the path converged."""
        return None

    def state(self, state: State) -> None:
        """A requested state is there: keep it now."""
        return None

    def files(self, contents: Mapping[str, Content]) -> None:
        """Files that belong to no row, by name."""
        return None

    def saved_row(self, key: float) -> tuple[Row, Sequence[Mapping[str, Array]]] | None:
        """A row that an earlier run left here, and its tables; None where there is none.

        Of a run in this process only.
        """
        return None

    def draft(self, key: float, arrays: Mapping[str, Array]) -> None:
        """Keep the unfinished part of a row that takes long, for a run that goes on from here.

        Of a run in this process only, like `drafted`.
        """
        return None

    def drafted(self, key: float) -> Mapping[str, Array] | None:
        """The last draft that an earlier run left of a row; None where there is none."""
        return None
