"""A rigid profile over a moving plane, under the film kernels, per mm of width (docs/slider.md)."""

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from softehl.cases.harness.observer import State
from softehl.cases.harness.parameters import Nonzeros, Parameters, key
from softehl.cases.harness.row import OK, Row, column
from softehl.cases.harness.row_by_row import RowByRow
from softehl.runtime.arrays import Array
from softehl.runtime.fem import dofs, rules
from softehl.runtime.fem.assembly import Assembler
from softehl.runtime.fem.chain import chain_block
from softehl.runtime.fem.postprocess import element_means, interval_below
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status


class Slider(Parameters):
    """Everything that defines one run of the slider."""

    profile: Literal["wedge", "parabola", "cosine", "exponential"] = key("parabola", "gap h(x)")
    h0: float = key(0.001, "gap at the end; parabola: least, cosine: mean", unit="mm", gt=0)
    radius: float = key(10.0, "parabola: radius R", unit="mm", gt=0)
    amplitude: float = key(0.5, "cosine: amplitude over h0", gt=-1, lt=1)
    ratio: float = key(2.2, "wedge, exponential: gap at the start over that at the end", gt=0)
    start: float = key(-1.5, "where the film starts", unit="mm", bounds="less than end")
    end: float = key(0.75, "where the film ends", unit="mm", bounds="more than start")
    start_pressure: float = key(0.0, "pressure at the start", unit="MPa", ge=0)
    end_pressure: float = key(0.0, "pressure at the end", unit="MPa", ge=0)
    segments: int = key(400, "segments of the film, equally long", ge=4, le=100_000)
    speeds: Nonzeros = key((400.0, 200.0, 100.0), "speeds U, + towards the end", unit="mm/s")
    viscosity: float = key(6.59e-8, "viscosity at zero pressure", unit="MPa s", gt=0)
    pressure_viscosity: float = key(0.0, "coefficient alpha of Barus' law", unit="1/MPa", ge=0)
    pressure_order: int = key(4, "order of the pressure on a segment", ge=1, le=16)
    reynolds: Literal["fe", "dg"] = key("fe", "continuous or discontinuous pressure")
    cavitation_penalty: float = key(1e5, "penalty of p < 0", unit="mm/(MPa s)", gt=0)

    @model_validator(mode="after")
    def _is_a_film(self) -> Self:
        if not self.start < self.end:
            raise ValueError(f"start = {self.start:g} must be less than end = {self.end:g}")
        return self

    def gap(self, x: Array) -> Array:
        """Film thickness h (n,) at x (n,), mm."""
        before_end = (self.end - x) / (self.end - self.start)
        relative = {
            "wedge": 1.0 + (self.ratio - 1.0) * before_end,
            "parabola": 1.0 + x**2 / (2.0 * self.radius * self.h0),
            "cosine": 1.0 + self.amplitude * np.cos(2.0 * np.pi * before_end),
            "exponential": self.ratio**before_end,
        }
        return np.asarray(self.h0 * relative[self.profile])


@dataclass(frozen=True, kw_only=True)
class SliderRow(Row):
    """A row of curve.csv: one speed."""

    files = ("profile_{}.csv",)
    rod_speed_mm_s: float = column("mm/s", "speed U of the plane", head="U", shown="+g")
    flux_mm2_s: float = column("mm2/s", "flux q where p is largest", head="flux", shown=".5g")
    load_N_per_mm: float = column("N/mm", "integral of p > 0", head="load", shown=".5g")
    p_max_MPa: float = column("MPa", "largest pressure", head="p max", shown=".5g")
    friction_N_per_mm: float = column("N/mm", "force on the plane", head="friction", shown=".5g")
    rupture_mm: float = column("mm", "where p falls to 0, or nan", head="rupture", shown=".4g")
    error_percent: float = column("%", "of flux, load", head="error", shown=".2g", default=np.nan)
    verdict: str = column("", "`ok`; `coarse` where the estimated error is above 2 %", default="")


def film_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film between its end pressures (alpha = 0: the reduced ones), on a rod of radius zero."""
    x, m_p, dg = np.linspace(p.start, p.end, p.segments + 1), p.pressure_order, p.reynolds == "dg"
    nodes, oil = np.stack([x, p.gap(x)], axis=1), np.array([0.0, speed, p.viscosity, alpha])
    numbers = (dofs.separate_dofs if dg else dofs.chain_dofs)(p.segments, m_p, nodes.size)
    layout = dofs.DofLayout.of(displacement=nodes.size, pressure=numbers.max() + 1 - nodes.size)
    blocks = [chain_block("film", nodes, numbers, rules.film_rule(m_p))]
    parameters = {"film": np.append(oil, [p.cavitation_penalty, 1.0, 1.0])}
    if dg:
        parameters["film_facet"] = oil
        sides = np.hstack([numbers[:-1], numbers[1:]])
        blocks.append(chain_block("film_facet", nodes, sides, rules.facet_rule(m_p)))
    ends = np.array([p.start_pressure, p.end_pressure])
    if p.pressure_viscosity and not alpha:
        ends = -np.expm1(-p.pressure_viscosity * ends) / p.pressure_viscosity
    problem = Problem(Assembler.build(layout.total, blocks), layout, parameters, {})
    return problem.with_fixed([layout.dofs("displacement"), numbers[[0, -1], [0, -1]]], [0.0, ends])


def results(problem: Problem, solution: Solution) -> tuple[SliderRow, dict[str, Array]]:
    """The row of a solution on one mesh, with an error that is not known, and its profile."""
    at = problem.fields("film", solution.x)
    top, flux = int(at["p"].max(axis=1).argmax()), element_means(at["flux"], at["dx"])
    if len(problem.assembler.blocks) > 1:  # (22) conserves the mean flux at the facets
        flux = problem.fields("film_facet", solution.x)["flux"][:, 0]
    x, h, p, dx, tau = (at[name].ravel() for name in ("x", "h", "p", "dx", "tau_rod"))
    way = -1 if problem.parameters["film"][1] < 0.0 else 1
    along, carried = way * x[::way], p[::way]
    rupture, _ = interval_below(along[carried.argmax() :], carried[carried.argmax() :], 0.0)
    row = SliderRow(
        rod_speed_mm_s=float(problem.parameters["film"][1]),
        flux_mm2_s=float(flux[min(top, len(flux) - 1)]),
        load_N_per_mm=float(np.maximum(p, 0.0) @ dx),
        p_max_MPa=float(p.max()),
        friction_N_per_mm=float(tau @ dx),
        rupture_mm=way * rupture,
    )
    return row, {"x_mm": x, "h_um": 1e3 * h, "p_MPa": p}


class SliderCase(RowByRow[Slider, SliderRow]):
    """Reynolds' equation for a gap that is given."""

    name, title = "slider", "rigid slider: flux, load and friction of a profile over its speeds"
    parameters, row = Slider, SliderRow
    list_key, selection, pictured = "speeds", ("speeds",), ("x_mm", "p_MPa", "h_um")

    def solution(self, parameters: Slider, key: float) -> tuple[Problem, Solution]:
        """The penalty is raised from a soft one; Barus' law then transforms the pressure."""
        problem, alpha = film_problem(parameters, key, 0.0), parameters.pressure_viscosity
        x, newton = np.zeros(problem.layout.total), Newton(max_iterations=60, line_search=True)
        for penalty in np.geomspace(1e-8, 1.0, 5) * parameters.cavitation_penalty:
            stage = problem.with_parameters(film={"cavitation_penalty": penalty})
            x = (solution := newton.solve(stage, x)).x
        if not alpha or not solution.converged:
            return problem, solution
        if alpha * solution.x.max() >= 1.0:
            words = "no pressure carries this film; use a smaller pressure_viscosity or speed"
            return problem, replace(solution, status=Status.DIVERGED, message=words)
        problem = film_problem(parameters, key, alpha)
        return problem, newton.solve(problem, -np.log1p(-alpha * solution.x) / alpha)

    def state(self, parameters: Slider, key: float, problem: Problem, solution: Solution) -> State:
        """h is linear between the nodes: an error of second order, seen from half the segments."""
        half = parameters.model_copy(update={"segments": parameters.segments // 2})
        (row, profile), (other, _) = results(problem, solution), results(*self.solution(half, key))
        fine, coarse = (np.array([r.flux_mm2_s, r.load_N_per_mm]) for r in (row, other))
        error = 100.0 / 3.0 * float((np.abs(coarse - fine) / np.maximum(np.abs(fine), 1e-99)).max())
        verdict = OK if error <= 2.0 else "coarse"
        return State(replace(row, error_percent=error, verdict=verdict), [profile])


CASE = SliderCase()
