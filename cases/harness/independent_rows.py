"""Cases whose rows are independent nonlinear problems."""

from collections.abc import Sequence
from pathlib import Path

from softehl.cases.harness.case import Case, P, R
from softehl.cases.harness.observer import Observer, Outcome, State
from softehl.cases.harness.pictures import KINDS, draw_columns
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.io import read_table
from softehl.runtime.solve.solution import Solution, Status

PICTURE = "profiles"


class RowByRow(Case[P, R]):
    """Base of such a case: it says how one row is solved and what the row then is.

    pictured: columns of the first file of each row that are drawn, over the first of them.
    """

    files = tuple(f"{PICTURE}.{kind}" for kind in KINDS)
    pictured: tuple[str, ...] = ()

    def solution(self, parameters: P, key: float) -> tuple[Problem, Solution]:
        """The problem of a row, and how its solution ended."""
        raise NotImplementedError

    def state(self, parameters: P, key: float, problem: Problem, solution: Solution) -> State:
        """The row and its files from a converged solution."""
        raise NotImplementedError

    def solve(self, parameters: P, observer: Observer, shared: Path | None) -> Outcome[State]:
        """See :class:`Case`; a row that does not converge does not end the others."""
        states: list[State] = []
        ended: list[tuple[float, Problem, Solution]] = []
        for key in self.requested(parameters):
            label = self.row.label(key)
            observer.stage(label)
            problem, solution = self.solution(parameters, key)
            ended.append((key, problem, solution))
            if not solution.converged:
                continue
            observer.step(
                label="Newton",
                parameter=key,
                iterations=solution.iterations,
                residuals=solution.residual_norms,
                fraction=1.0,
            )
            states.append(self.state(parameters, key, problem, solution))
            observer.state(states[-1])
        return self._outcome(states, ended)

    def draw(
        self,
        parameters: P,
        folder: Path,
        rows: Sequence[R],
        rejected: Sequence[R],
        kinds: Sequence[str],
    ) -> None:
        """See :class:`Case`."""
        if self.pictured and kinds:
            first = {row.label(row.key): row.file_names()[0] for row in rows}
            tables = {label: read_table(folder / name) for label, name in first.items()}
            draw_columns(folder / PICTURE, tables, self.pictured, kinds)

    def _outcome(
        self, states: Sequence[State], ended: Sequence[tuple[float, Problem, Solution]]
    ) -> Outcome[State]:
        failures = [(key, end) for key, _, end in ended if not end.converged]
        problem = ended[-1][1]
        layout = problem.layout
        return Outcome(
            tuple(states),
            failures[0][1].status if failures else Status.CONVERGED,
            "; ".join(f"{self.row.label(key)}: {end.message}" for key, end in failures)
            or "all rows",
            {"total": layout.total, **dict(zip(layout.names, layout.counts, strict=True))},
            {block.kernel.name: block.kernel.signature for block in problem.assembler.blocks},
        )
