"""A case of one's own: the tip of a beam over the force."""

from dataclasses import dataclass
from pathlib import Path

from softehl import Mesh, Parameters, Status, Study
from softehl.cases.harness.case import Case
from softehl.cases.harness.observer import Observer, Outcome, State
from softehl.cases.harness.parameters import Nonzeros, key
from softehl.cases.harness.row import OK, Row, column


class Beam(Parameters):
    E: float = key(1000.0, "Young's modulus", unit="MPa", gt=0)
    forces: Nonzeros = key((0.01, 0.02), "forces at the tip", unit="N")


@dataclass(frozen=True, kw_only=True)
class TipRow(Row):
    force_N: float = column("N", "force at the tip", head="F", number_format="g")
    tip_mm: float = column("mm", "displacement of the tip", head="tip", number_format=".4g")
    verdict: str = column("", "`ok`", default=OK)


class Bending(Case[Beam, TipRow]):
    name, title = "bending", "tip of a beam over the force"
    parameters, row = Beam, TipRow
    list_key, selection = "forces", ("forces",)

    def solve(self, parameters: Beam, observer: Observer, shared: Path | None) -> Outcome[State]:
        states = []
        for force in parameters.forces:
            study = Study(Mesh.rectangle(10, 1, cells=(20, 2), order=2))
            study.add("beam", material="hooke", E=parameters.E, nu=0.0)
            study.fix("left", u_x=0, u_y=0)
            study.load("right", u_y=force)
            tip = float(study.solve().at((10, 0.5))["u_y"])
            states.append(State(TipRow(force_N=force, tip_mm=tip)))
            observer.state(states[-1])
        return Outcome(tuple(states), Status.CONVERGED, "all forces")
