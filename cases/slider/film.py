"""The films of a given gap: with a penalty of cavitation, or with void fractions."""

from dataclasses import replace
from math import exp, log
from typing import Any

import numpy as np

from softehl.cases.seal.equations.system import DISPLACEMENT, FILM, MOVED, PRESSURE
from softehl.cases.seal.gland.surfaces import SurfacePair
from softehl.cases.slider.parameters import Slider
from softehl.cases.slider.strip import Oil, Strip
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation import dofmap, quadrature
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status
from softehl.runtime.study import Study


def strip_of(p: Slider, alpha: float) -> Strip:
    """The film of a slider that conserves mass; alpha: coefficient of Barus' law."""
    surfaces = SurfacePair.of(p.roughness, p.asperity_stiffness, p.boundary_friction)
    thinning = p.film_suffix, p.thinning_values(p.viscosity)
    oil = Oil(p.viscosity, alpha, p.cavitation_pressure, *thinning)
    return Strip(*p.ends, p.pressure_order, oil, surfaces)


def conserving_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film with void fractions between its end pressures."""
    strip = strip_of(p, alpha)
    problem = strip.posed(strip.study(speed), speed)
    return strip.between(problem, _ends(p, alpha), strip.starved(speed, p.supply))


def _ends(p: Slider, alpha: float) -> Array:
    """Pressures (2,) at both ends; reduced ones for a film without Barus' law (alpha = 0)."""
    ends = np.array([p.start_pressure, p.end_pressure])
    if p.pressure_viscosity and not alpha:
        return np.asarray(-np.expm1(-p.pressure_viscosity * ends) / p.pressure_viscosity)
    return ends


def film_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film between its end pressures (alpha = 0: the reduced ones), on a rod of radius zero."""
    x, order, dg = p.nodes, p.pressure_order, p.reynolds == "dg"
    chain = np.arange(p.segments)[:, None] + np.arange(3)
    places = (dofmap.separate_dofs if dg else dofmap.chain_dofs)(p.segments, order, 0)
    film, thinning = load_kernel(f"film{p.film_suffix}"), p.thinning_values(p.viscosity)
    oil: dict[str, Any] = {"rod_radius": 0.0, "rod_speed": speed, "viscosity": p.viscosity}
    oil["pressure_viscosity"] = alpha
    weights = {"cavitation_penalty": p.cavitation_penalty, "force_weight": 1.0, "shear_weight": 1.0}
    values = {**oil, **weights, **thinning}
    given = {name: values[name] for name in film.parameters}
    study = Study(Mesh(np.stack([x, p.gap(x)], axis=1), {"line2": chain[:, :2]}))
    study.add(FILM, film, along={PRESSURE: places}, rule=quadrature.film_rule(order), **given)
    if dg:
        sides, rule = np.hstack([places[:-1], places[1:]]), quadrature.facet_rule(order)
        facet, inner = load_kernel("film_facet"), chain[:-1]
        study.add("film_facet", facet, on=inner, along={PRESSURE: sides}, rule=rule, **oil)
    study.fix(np.arange(len(x)), u_z=0.0, u_r=0.0)
    problem = study.system({DISPLACEMENT: MOVED}).resting()
    return problem.also_fixed(problem.layout.dofs(PRESSURE)[[0, -1]], _ends(p, alpha))


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
        words = "no pressure carries this film; use a smaller pressure_viscosity or speed"
        return problem, replace(reduced, status=Status.DIVERGED, message=words)
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
