"""Why a path ends before its goal, and what may help: control flow of the O-ring's stages."""

from __future__ import annotations

from softehl.cases.seal.stage import Stage
from softehl.cases.seal.verdict import FilmNumbers
from softehl.runtime.solve.solution import Branch, Status

FOLD = (
    "the path ends or turns back there, as it does when the film collapses on a mesh that is too "
    "coarse: use a finer mesh (larger density)"
)

CLOSED = 0.05
"""Least film thickness, in h*, below which a path ends because the film closes."""

CLOSING = (
    "the film closes: at a node it is only {:.2g} um thick there, and would be negative beyond; "
    "use a finer mesh (larger density) or a higher pressure_order"
)

ROLLING = (
    'with rotation = "free" hardly anything but the film turns or holds the section: use "fixed"'
)


class Stopped(Exception):  # noqa: N818 (control flow, not an error)
    """A stage did not reach its end; carries its branch."""

    def __init__(self, stage: Stage, branch: Branch) -> None:
        super().__init__(stage.name)
        self.stage, self.branch = stage, branch
        self.last: FilmNumbers | None = None

    @property
    def message(self) -> str:
        """How far the stage came, in its own units, why no further, and what may help."""
        stage, branch = self.stage, self.branch
        goal = f"{stage.name} {stage.shown(stage.stop):.5g}"
        if not branch.points:
            return f"{goal} was not reached, not even the start: {branch.message}"
        reached = stage.shown(branch.points[-1].parameter)
        return f"{goal} was not reached, only {reached:.5g}"

    @property
    def advice(self) -> str:
        """Why a path ends on the way, and what may help."""
        if self.last is not None and self.last.h_min < CLOSED * self.last.h_star:
            return CLOSING.format(1e3 * self.last.h_min)
        return FOLD if self.branch.points else self.branch.status.advice

    def explain(self, where: str, rotation: str) -> tuple[Status, str]:
        """Status and message of a run that ends here."""
        advice = ROLLING if rotation == "free" else self.advice
        return self.branch.status, f"{where}: {self.message}; {advice}"
