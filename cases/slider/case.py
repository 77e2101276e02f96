"""A rigid profile over a moving plane, under the film kernels, per mm of width (docs/slider.md)."""

from dataclasses import dataclass, replace

import numpy as np

from softehl.cases.harness.independent_rows import RowByRow
from softehl.cases.harness.observer import State
from softehl.cases.harness.row import OK, Row, column
from softehl.cases.seal.equations.definition import PRESSURE
from softehl.cases.slider.film import (
    beyond_front,
    conserving_solution,
    fronts,
    penalty_solution,
    strip_of,
)
from softehl.cases.slider.parameters import Slider
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import element_means, interval_below
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.io import Cell
from softehl.runtime.solve.solution import Solution

__all__ = ["CASE", "Slider", "SliderRow"]


@dataclass(frozen=True, kw_only=True)
class SliderRow(Row):
    """A row of curve.csv: one speed."""

    files = ("profile_{}.csv",)
    rod_speed_mm_s: float = column("mm/s", "speed U of the plane", head="U", number_format="+g")
    flux_mm2_s: float = column(
        "mm2/s", "flux q where p is largest", head="flux", number_format=".5g"
    )
    load_N_per_mm: float = column("N/mm", "integral of p > 0", head="load", number_format=".5g")
    p_max_MPa: float = column("MPa", "largest pressure", head="p max", number_format=".5g")
    friction_N_per_mm: float = column(
        "N/mm", "force on the plane", head="friction", number_format=".5g"
    )
    rupture_mm: float = column(
        "mm",
        "where the film ruptures; empty where it does not",
        head="rupture",
        number_format=".4g",
    )
    reformation_mm: float = column(
        "mm", "where it forms again (mass-conserving); empty where it does not", default=np.nan
    )
    error_percent: float = column(
        "%", "of flux, load", head="error", number_format=".2g", default=np.nan
    )
    verdict: str = column("", "`ok`; `coarse` where the estimated error is above 2 %", default="")

    def cells(self) -> tuple[Cell, ...]:
        """See :class:`Record`; a front that is not there leaves its cell empty."""
        fronts = "rupture_mm", "reformation_mm"
        named = zip(self.header(), super().cells(), strict=True)
        return tuple("" if n in fronts and np.isnan(float(c)) else c for n, c in named)


def results(problem: Problem, solution: Solution) -> tuple[SliderRow, dict[str, Array]]:
    """The row of a solution on one mesh, with an error that is not known, and its profile."""
    at = problem.fields("film", solution.x)
    top, flux = int(at["p"].max(axis=1).argmax()), element_means(at["flux"], at["dx"])
    if "film_facet" in problem.parameters:  # (22) conserves the mean flux at the facets
        flux = problem.fields("film_facet", solution.x)["flux"][:, 0]
    x, h, p, dx, tau = (at[name].ravel() for name in ("x", "h", "p", "dx", "tau_rod"))
    direction = -1 if problem.parameters["film"][1] < 0.0 else 1
    along, carried = direction * x[::direction], p[::direction]
    first = int(carried.argmax()) if p.max() > 0.0 else 0
    rupture, _ = interval_below(along[first:], carried[first:], 0.0)
    row = SliderRow(
        rod_speed_mm_s=float(problem.parameters["film"][1]),
        flux_mm2_s=float(flux[min(top, len(flux) - 1)]),
        load_N_per_mm=float(np.maximum(p, 0.0) @ dx),
        p_max_MPa=float(p.max()),
        friction_N_per_mm=float(tau @ dx),
        rupture_mm=direction * rupture,
    )
    return row, {"x_mm": x, "h_um": 1e3 * h, "p_MPa": p}


def without_noise(p: Slider, problem: Problem, solution: Solution) -> Solution:
    """The solution; its pressures are zero if the largest is rounding: 2e-15 of `unit` at most."""
    part, speed = problem.layout.part(PRESSURE), abs(problem.parameters["film"][1])
    unit = 12.0 * p.viscosity * speed * (p.end - p.start) / p.segment_ends[1].min() ** 2
    pressures, noise = solution.x[part], 1e-12 * unit
    if pressures.max() > noise:
        return solution
    x = solution.x.copy()
    x[part] = np.where(np.abs(pressures) > noise, pressures, 0.0)
    return replace(solution, x=x)


def conserving_results(
    p: Slider, problem: Problem, solution: Solution
) -> tuple[SliderRow, dict[str, Array]]:
    """`results` with void fractions: fronts within subcells, and the load up to where they are."""
    strip, layout = strip_of(p, 0.0), problem.layout
    direction = -1 if problem.parameters["film"][1] < 0.0 else 1
    pressures, voids = (solution.x[layout.part(name)] for name in ("pressure", "void"))
    x, p_c = strip.positions, p.cavitation_pressure
    rupture, formed = fronts(
        direction * x[::direction], pressures[::direction], voids[::direction], p_c
    )
    row, profile = results(problem, solution)
    at = problem.fields("film", solution.x)
    load = float(((at["p"] + at["p_a"]) * at["dx"]).sum())
    load -= beyond_front(direction * x[::direction], pressures[::direction] - p_c, formed)
    profile["h_T_um"] = 1e3 * at["h_T"].ravel()
    profile["void_fraction"] = at["v_out" if direction > 0 else "v_in"].ravel()
    row = replace(row, rupture_mm=direction * rupture, reformation_mm=direction * formed)
    return replace(row, load_N_per_mm=load), profile


class SliderCase(RowByRow[Slider, SliderRow]):
    """Reynolds' equation for a gap that is given."""

    name, title = "slider", "rigid slider: flux, load and friction of a profile over its speeds"
    parameters, row = Slider, SliderRow
    list_key, selection, pictured = "speeds", ("speeds",), ("x_mm", "p_MPa", "h_um")

    def solution(self, parameters: Slider, key: float) -> tuple[Problem, Solution]:
        """By the model of cavitation that the parameters choose."""
        if parameters.conserving:
            return conserving_solution(parameters, key)
        return penalty_solution(parameters, key)

    def state(self, parameters: Slider, key: float, problem: Problem, solution: Solution) -> State:
        """h is linear between the nodes: an error of second order, seen from half the segments."""

        def results_of(
            p: Slider, problem: Problem, solution: Solution
        ) -> tuple[SliderRow, dict[str, Array]]:
            solution = without_noise(p, problem, solution)
            if p.conserving:
                return conserving_results(p, problem, solution)
            return results(problem, solution)

        half = parameters.model_copy(update={"segments": parameters.segments // 2})
        coarse_problem, coarse_solution = self.solution(half, key)
        row, profile = results_of(parameters, problem, solution)
        other, _ = results_of(half, coarse_problem, coarse_solution)
        fine, coarse = (np.array([r.flux_mm2_s, r.load_N_per_mm]) for r in (row, other))
        error = 100.0 / 3.0 * float((np.abs(coarse - fine) / np.maximum(np.abs(fine), 1e-99)).max())
        verdict = OK if error <= 2.0 else "coarse"
        return State(replace(row, error_percent=error, verdict=verdict), [profile])


CASE = SliderCase()
