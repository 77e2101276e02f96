"""The reciprocating O-ring of section 5.1: Table 1 as one seal."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from math import isnan, nan
from pathlib import Path
from types import MappingProxyType
from typing import Any

from softehl.cases.harness.case import Case
from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.harness.pictures import KINDS
from softehl.cases.harness.report.part import FinishedRun, Part
from softehl.cases.harness.row import OK, Record
from softehl.cases.seal.gland.messages import assumed, foreword, warnings
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report import paraview, tables
from softehl.cases.seal.report.model_limits import BREAKAWAY, LEFT_OUT, cautions, titled
from softehl.cases.seal.states import run_plan
from softehl.cases.seal.states.leakage import net_leakage
from softehl.cases.seal.states.sensitivity_table import differentiable, resolved
from softehl.cases.seal.states.state import FilmRow, FilmState, stage_label
from softehl.cases.seal.states.summary import run_summary

PICTURES = ("curve", "profiles", "section")
"""Names of the files, each .png or .svg or both, of every run."""
SOME = ("fit", "stribeck", "tornado")
"""Pictures of rubbers that were fitted to tests, of rough surfaces, of sensitivities."""

_THINNEST = "thinnest film [um]"


class ORingCase(Case[Seal, FilmRow]):
    """One curve: h* over the rod speed, of both strokes, at one sealed pressure."""

    name = "oring"
    title = "reciprocating O-ring, a rod seal: film thickness, friction, leakage over the rod speed"
    parameters = Seal
    row = FilmRow
    selection = ("speeds", "stroke", "travel", "service", "solver", "linear", "tolerance")
    method_keys = ("solver", "linear")
    files = (
        *("sensitivity.csv", "sensitivity_*.csv", "tolerances.csv"),
        *("leakage.csv", "fit.csv", "contact_*.csv", "contact_*.vtu", *paraview.FILES),
        *(f"{name}.{kind}" for name in (*PICTURES, *SOME) for kind in KINDS),
    )
    shared = "contacts"
    left_out = LEFT_OUT

    def solve(
        self, parameters: Seal, observer: Observer, shared: Path | None
    ) -> Outcome[FilmState]:
        """See :class:`Case`; runs of one section share their contact states."""
        return run_oring(parameters, observer, shared)

    def stage_label(self, name: str, marks: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
        """See :class:`Case`."""
        return stage_label(name, marks)

    def requested(self, parameters: Seal) -> list[float]:
        """See :class:`Case`."""
        return run_plan.rod_speeds(parameters)

    def rounds(self, parameters: Seal) -> Sequence[Seal]:
        """See :class:`Case`."""
        return run_plan.refinements(parameters)

    def pieces(self, parameters: Seal, rows: Sequence[FilmRow], jobs: int) -> list[Seal]:
        """See :class:`Case`."""
        return run_plan.pieces(parameters, rows, jobs)

    def piece_name(self, piece: Seal) -> str:
        """See :class:`Case`."""
        return piece.stroke

    def tables(self, rows: Sequence[FilmRow]) -> Mapping[str, Sequence[Record]]:
        """See :class:`Case`."""
        return {"leakage": net_leakage(rows)}

    def caption(self, rows: Sequence[FilmRow]) -> str:
        """See :class:`Case`."""
        return f"Film thickness, p_s = {rows[0].sealed_pressure_MPa:g} MPa"

    def complaints(
        self, parameters: Seal, rows: Sequence[FilmRow], rejected: Sequence[FilmRow], advice: str
    ) -> list[str]:
        """See :class:`Case`."""
        collapsed = super().complaints(parameters, rows, rejected, advice)
        outside = run_plan.outside_tolerance(parameters, rows)
        messages = [f"collapsed film, {complaint}" for complaint in collapsed]
        if outside:
            messages.append(f"h* not known to {parameters.tolerance:g} %: {self.named(outside)}")
        if parameters.sensitivity:
            messages += _not_differentiated(rows)
        return messages

    def assumed(self, parameters: Seal, set_keys: Collection[str]) -> list[str]:
        """See :class:`Case`."""
        return assumed(parameters, set_keys)

    def warnings(self, parameters: Seal) -> list[str]:
        """See :class:`Case`."""
        return warnings(parameters, parameters.sealed_pressure)

    def summary(self, parameters: Seal, rows: Sequence[FilmRow]) -> list[str]:
        """See :class:`Case`."""
        return run_summary(rows, parameters.travel, parameters.stroke, parameters.service)

    def details(self, parameters: Seal, folder: Path) -> list[str]:
        """See :class:`Case`: tolerances and sensitivities."""
        return tables.sensitivity_lines(parameters, folder)

    def merits(self, parameters: Seal, rows: Sequence[FilmRow]) -> Mapping[str, float]:
        """See :class:`Case`; of all speeds the worst."""
        merits = {
            "largest friction [N]": _worst(abs(row.rod_friction_N) for row in rows),
            _THINNEST: min(row.thickness_um for row in rows),
        }
        if nets := net_leakage(rows):
            volume = parameters.travel * max(net.net_mm3_per_mm for net in nets)
            cycle = f"leakage in a cycle of {parameters.travel:g} mm out and back [mm3]"
            return {cycle: volume, **merits}
        return merits

    def sense(self, merit: str) -> float:
        """See :class:`Case`."""
        return -1.0 if merit == _THINNEST else 1.0

    def titled(self, parameters: Seal) -> str:
        """See :class:`Case`."""
        return titled(self.title, parameters)

    def foreword(self, parameters: Seal) -> list[str]:
        """See :class:`Case`."""
        return foreword(parameters, parameters.sealed_pressure)

    def notes(
        self, rows: Sequence[FilmRow], advice: Mapping[float, str] = MappingProxyType({})
    ) -> list[str]:
        """See :class:`Case`."""
        reservations = run_plan.reservations(rows, advice)
        warnings = [f"{text}: {self.named(some)}" for text, some in reservations.items()]
        thin = [row for row in rows if not row.regime and row.thickness_um < run_plan.THIN]
        if not thin:
            return warnings
        text = (
            f"films below {run_plan.THIN:g} um, where surfaces of {run_plan.USUAL:g} um rms touch"
        )
        return [*warnings, f"smooth surfaces: {text}: {self.named(thin)}; give their roughness"]

    def cautions(self, parameters: Seal) -> list[str]:
        """See :class:`Case`."""
        return [*cautions(parameters), BREAKAWAY]

    def draw(
        self,
        parameters: Seal,
        folder: Path,
        rows: Sequence[FilmRow],
        rejected: Sequence[FilmRow],
        kinds: Sequence[str],
    ) -> None:
        """See :class:`Case`."""
        paraview.write_paraview(parameters, folder, rows)
        tables.write_fit(parameters, folder)
        if parameters.sensitivity:
            tables.write_sensitivities(parameters, folder, rows)
        if kinds:
            from softehl.cases.seal.report.pictures import write_plots

            write_plots(FinishedRun(folder, self, parameters, rows, rejected), kinds)

    def report(self, runs: Sequence[FinishedRun]) -> Sequence[Part]:
        """See :class:`Case`."""
        from softehl.cases.seal.report.parts import parts

        return parts(runs)

    def share(self, parameters: Seal) -> tuple[float, str]:
        """See :class:`Case`."""
        from softehl.cases.seal.solve.contact_meshes import contact_key

        return parameters.density, contact_key(parameters)


def run_oring(
    parameters: Seal, observer: Observer, contacts: Path | None = None
) -> Outcome[FilmState]:
    """Solve a seal and report to the observer, with sensitivities if the parameters say so.

    Parameters
    ----------
    parameters : Seal
        The seal.
    observer : Observer
        Listener of stages, steps and states; `softehl.Silent()` does nothing, and is told of
        contacts and films by methods of its own.
    contacts : Path, optional
        Folder of contact states to start from and to add to.

    Returns
    -------
    Outcome
        States, their cost, and the reason of the end.
    """
    from softehl.cases.seal.sensitivity.sensitivity import differentiation
    from softehl.cases.seal.solve.driver import run

    return run(parameters, observer, contacts, differentiation(parameters))


def _worst(values: Iterable[float]) -> float:
    """The largest of some values, nan if one is not known."""
    numbers = list(values)
    return nan if any(map(isnan, numbers)) else max(numbers)


def _not_differentiated(rows: Sequence[FilmRow]) -> list[str]:
    """Why states have no sensitivities, in words; empty where all have them."""
    left_out = [row for row in rows if not differentiable(row)]
    doubted = [row for row in left_out if row.verdict != OK]
    unseen = [row for row in left_out if row.verdict == OK and not resolved(row)]
    cut = [row for row in left_out if resolved(row)]
    reasons = (
        "only states that are ok are differentiated",
        "the mesh does not show the film well enough to differentiate it (inlet_ratio in "
        "curve.csv); use a graded mesh or a larger density",
        "the film begins before its arc, with the pressure built up there (entrance_pressure_MPa "
        "in curve.csv); lower speeds or a thinner oil have a shorter inlet",
    )
    groups = zip((doubted, unseen, cut), reasons, strict=True)
    return [f"no sensitivities of {CASE.named(of)}: {why}" for of, why in groups if of]


CASE = ORingCase()
