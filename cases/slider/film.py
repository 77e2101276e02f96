"""Films between given surfaces, per mm of width: no section deforms them.

With a penalty of cavitation, or with void fractions, where mass is conserved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import exp, log
from typing import Any

import numpy as np

from softehl.cases.seal.cycle.motion import missing
from softehl.cases.seal.equations import scales
from softehl.cases.seal.equations.definition import DISPLACEMENT, FILM, MOVED, PRESSURE, VOID
from softehl.cases.seal.gland.surfaces import PRESSURE_SCALE, VOID_SCALE, SurfacePair, void_values
from softehl.cases.slider.parameters import Slider
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation import dofmap, quadrature
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status
from softehl.runtime.study import Study


@dataclass(frozen=True)
class FilmOil:
    """Viscosity (MPa s) at zero pressure, Barus' coefficient (1/MPa), pressure of cavitation.

    suffix, thinning: how it thins under shear, see `ThinningKeys`.
    """

    viscosity: float
    alpha: float = 0.0
    cavitation_pressure: float = 0.0
    suffix: str = ""
    thinning: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GapFilm:
    """Segments of a film with pressures and void fractions at the nodes of their subcells.

    x, h: (n, 2) places and thicknesses of the ends of the segments, mm; h may jump between them.
    order: subcells of a segment.
    """

    x: Array
    h: Array
    order: int
    oil: FilmOil
    surfaces: SurfacePair = field(default_factory=SurfacePair)

    @property
    def unknowns(self) -> int:
        """Pressures, and as many void fractions."""
        return self.order * len(self.x) + 1

    @property
    def positions(self) -> Array:
        """Places of pressures and void fractions, (unknowns,), mm."""
        share = 0.5 * (1.0 + quadrature.pressure_nodes(self.order)[:-1])
        inner = self.x[:, :1] + share * np.diff(self.x, axis=1)
        return np.append(inner.ravel(), self.x[-1, 1])

    @property
    def rows(self) -> Integers:
        """Unknowns (segments, order + 1) of a field in the segments, from 0."""
        return dofmap.chain_dofs(len(self.x), self.order, 0)

    def study(self, speed: float) -> Study:
        """The film between surfaces at rest, one of which slides at a speed (mm/s)."""
        n, along = len(self.x), {PRESSURE: self.rows, VOID: self.rows}
        smooth = f"film_conserving{self.oil.suffix}"
        flow = load_kernel("film_rough" if self.surfaces.sigma else smooth)
        values: dict[str, Any] = {
            **{"rod_radius": 0.0, "rod_speed": speed, "viscosity": self.oil.viscosity},
            **{"pressure_viscosity": self.oil.alpha, "force_weight": 0.0, "shear_weight": 0.0},
            **self.oil.thinning,
            **self.surfaces.values(),
        }
        points = np.stack([self.x, self.h], axis=2).reshape(2 * n, 2)
        study = Study(Mesh(points, {"line2": np.arange(2 * n).reshape(n, 2)}))
        rule, each = quadrature.rupture_rule(self.order, polynomial=False), np.arange(self.unknowns)
        arguments = {name: value for name, value in values.items() if name in flow.parameters}
        study.add(FILM, flow, along=along, rule=rule, **arguments)
        study.add(
            "cavitation",
            load_kernel("film_void"),
            on=np.empty((len(each), 0), np.int64),
            called={"p": PRESSURE, "v": VOID},
            along={PRESSURE: each[:, None], VOID: each[:, None]},
            **dict[str, Any](void_values(self.oil.cavitation_pressure)),
        )
        return study

    def build_problem(self, study: Study, speed: float) -> Problem:
        """The problem of a study of it, with the sizes of its fluxes (mm^2/s) at a speed.

        Everything is free but the place of the surfaces; `between` prescribes the ends.
        """
        h, dx = self.h.max(axis=1), np.diff(self.x, axis=1)[:, 0]
        driven = scales.pressure_flux(h, dx, self.order, self.oil.viscosity)
        fluxes = np.zeros(self.unknowns)
        np.maximum.at(fluxes, self.rows, driven[:, None])
        fluxes += 0.5 * abs(speed) * float(self.h.min())
        problem = study.system({DISPLACEMENT: MOVED}).resting()
        sizes: dict[str, float | Array] = {DISPLACEMENT: 1.0, VOID: 1.0, PRESSURE: fluxes}
        return replace(problem, scales=sizes, absolute=True)

    def between(self, problem: Problem, end_pressures: Array, inflow: Array) -> Problem:
        """The problem with pressures (MPa) and void fractions (2,) prescribed at both ends."""
        layout = problem.layout
        outer = (layout.dofs(name)[[0, -1]] for name in (PRESSURE, VOID))
        return problem.with_fixed([layout.dofs(DISPLACEMENT), *outer], [0.0, end_pressures, inflow])

    def starved(self, speed: float, supply: float | None) -> Array:
        """Void fractions (2,) of the ends where the plane brings in a film of this thickness, mm.

        The film fills what the first subcell lets through as far as it goes; None: all of it.
        """
        void = np.zeros(2)
        if supply is None:
            return void
        h, end = (self.h[0], 0) if speed > 0.0 else (self.h[-1, ::-1], 1)
        void[end] = missing(supply, h[0], h[1], self.order)
        return void


def fronts(x: Array, p: Array, v: Array, p_c: float) -> tuple[float, float]:
    """Places where a film first ruptures and first forms again, along its flow; nan if none.

    x, p, v: (n,) at the nodes of subcells, downstream. Behind its rupture v grows from zero, before
    its end p grows from p_c: both are drawn on to zero, linearly, within a subcell or two. Where a
    film has neither pressure nor void, v has a rounding error of 1e-12: less than 1e-9 is none.
    """
    v = np.append(v[:-1], v[-2])  # nothing flows out of the last node
    torn = v / VOID_SCALE > np.maximum((p - p_c) / PRESSURE_SCALE, 1e-9 / VOID_SCALE)
    starts = np.flatnonzero(~torn[:-1] & torn[1:]) + 1
    stops = np.flatnonzero(torn[:-1] & ~torn[1:]) + 1
    return (
        _rupture(x, v, int(starts[0])) if len(starts) else np.nan,
        _reformation(x, p - p_c, int(stops[0])) if len(stops) else np.nan,
    )


def _rupture(x: Array, v: Array, i: int) -> float:
    """Void fractions belong to the middle of the subcell behind their node."""
    if i + 2 >= len(x) or not v[i + 1] > v[i]:
        return float(x[i])
    middle, next_middle = 0.5 * (x[i] + x[i + 1]), 0.5 * (x[i + 1] + x[i + 2])
    position = middle - v[i] * (next_middle - middle) / (v[i + 1] - v[i])
    return float(position) if position > x[max(i - 2, 0)] else float(x[i])


def _reformation(x: Array, p: Array, j: int) -> float:
    if j + 1 >= len(x) or not p[j + 1] > p[j]:
        return float(x[j])
    return float(max(x[j] - p[j] * (x[j + 1] - x[j]) / (p[j + 1] - p[j]), x[j - 1]))


def beyond_front(x: Array, p: Array, front: float) -> float:
    """Excess of linear pressures p (n,) at x (n,), over p_c, before a reformation."""
    if not np.isfinite(front):
        return 0.0
    j = int(np.searchsorted(x, front, side="left"))
    return float(0.5 * p[j] * (front - x[j - 1])) if j < len(x) else 0.0


def strip_of(p: Slider, alpha: float) -> GapFilm:
    """The film of a slider that conserves mass; alpha: coefficient of Barus' law."""
    surfaces = SurfacePair.of(p.roughness, p.asperity_stiffness, p.boundary_friction)
    oil = FilmOil(
        viscosity=p.viscosity,
        alpha=alpha,
        cavitation_pressure=p.cavitation_pressure,
        suffix=p.film_suffix,
        thinning=p.thinning_values(p.viscosity),
    )
    x, h = p.segment_ends
    return GapFilm(x, h, order=p.pressure_order, oil=oil, surfaces=surfaces)


def conserving_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film with void fractions between its end pressures."""
    strip = strip_of(p, alpha)
    problem = strip.build_problem(strip.study(speed), speed)
    return strip.between(problem, _end_pressures(p, alpha), strip.starved(speed, p.supply))


def _end_pressures(p: Slider, alpha: float) -> Array:
    """Pressures (2,) at both ends; reduced ones for a film without Barus' law (alpha = 0)."""
    pressures = np.array([p.start_pressure, p.end_pressure])
    if p.pressure_viscosity and not alpha:
        return np.asarray(-np.expm1(-p.pressure_viscosity * pressures) / p.pressure_viscosity)
    return pressures


def film_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film between its end pressures (alpha = 0: the reduced ones), on a rod of radius zero."""
    x, order, dg = p.nodes, p.pressure_order, p.reynolds == "dg"
    chain = np.arange(p.segments)[:, None] + np.arange(3)
    positions = (dofmap.separate_dofs if dg else dofmap.chain_dofs)(p.segments, order, 0)
    film, thinning = load_kernel(f"film{p.film_suffix}"), p.thinning_values(p.viscosity)
    oil: dict[str, Any] = {"rod_radius": 0.0, "rod_speed": speed, "viscosity": p.viscosity}
    oil["pressure_viscosity"] = alpha
    weights = {"cavitation_penalty": p.cavitation_penalty, "force_weight": 1.0, "shear_weight": 1.0}
    values = {**oil, **weights, **thinning}
    arguments = {name: values[name] for name in film.parameters}
    study = Study(Mesh(np.stack([x, p.gap(x)], axis=1), {"line2": chain[:, :2]}))
    study.add(
        FILM, film, along={PRESSURE: positions}, rule=quadrature.film_rule(order), **arguments
    )
    if dg:
        sides, rule = np.hstack([positions[:-1], positions[1:]]), quadrature.facet_rule(order)
        facet, inner = load_kernel("film_facet"), chain[:-1]
        study.add("film_facet", facet, on=inner, along={PRESSURE: sides}, rule=rule, **oil)
    study.fix(np.arange(len(x)), u_z=0.0, u_r=0.0)
    problem = study.system({DISPLACEMENT: MOVED}).resting()
    return problem.also_fixed(problem.layout.dofs(PRESSURE)[[0, -1]], _end_pressures(p, alpha))


def conserving_solution(p: Slider, speed: float) -> tuple[Problem, Solution]:
    """Newton's method from a full film without pressure; Barus' law as in `transformed`."""
    problem, alpha = conserving_problem(p, speed, 0.0), p.pressure_viscosity
    newton = Newton(tolerance=1e-12, stagnation=1e4, max_iterations=200)
    solution = newton.solve(problem, np.zeros(problem.layout.total))
    if not alpha or not solution.converged:
        return problem, solution
    return transformed(conserving_problem(p, speed, alpha), alpha, newton, solution)


def transformed(
    problem: Problem, alpha: float, newton: Newton, reduced: Solution
) -> tuple[Problem, Solution]:
    """The film by Barus' law, from the one without, whose pressures are reduced ones."""
    x, part = reduced.x.copy(), problem.layout.part(PRESSURE)
    if alpha * x[part].max() >= 1.0:
        message = "no pressure carries this film; use a smaller pressure_viscosity or speed"
        return problem, replace(reduced, status=Status.DIVERGED, message=message)
    x[part] = -np.log1p(-alpha * x[part]) / alpha
    return problem, newton.solve(problem, x)


def penalty_solution(p: Slider, speed: float) -> tuple[Problem, Solution]:
    """The penalty rises from a soft one; Barus' law then transforms the pressure."""
    problem, alpha = film_problem(p, speed, 0.0), p.pressure_viscosity
    newton = Newton(max_iterations=60, line_search=True)

    def softened(t: float) -> Problem:
        return problem.with_parameters(film={"cavitation_penalty": exp(t) * p.cavitation_penalty})

    steps = StepRule(first=log(100.0), smallest=log(2.0))
    path = Continuation(newton, steps, "previous", name="log of the penalty")
    solution = path.follow(softened, log(1e-8), 0.0, np.zeros(problem.layout.total)).end
    if not alpha or not solution.converged:
        return problem, solution
    return transformed(film_problem(p, speed, alpha), alpha, newton, solution)
