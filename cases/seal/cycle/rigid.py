"""The films of a given gap: with a penalty of cavitation, or with void fractions."""

from dataclasses import replace
from math import exp, log

import numpy as np

from softehl.cases.seal.cycle.strip import Oil, Strip
from softehl.cases.seal.equations.system import DISPLACEMENT, FILM, PRESSURE
from softehl.cases.seal.gland.profiles import Slider
from softehl.cases.seal.gland.surfaces import Surfaces
from softehl.runtime.fem import dofs, rules
from softehl.runtime.fem.assembly import Assembler
from softehl.runtime.fem.chain import chain_block
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.homotopy import Continuation
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status
from softehl.runtime.solve.steps import StepRule

_SOFT = 1e-8  # of the penalty, where the path begins
_STIFFER = StepRule(log(100.0), log(2.0))  # longer first steps cost twice the iterations


def strip_of(p: Slider, alpha: float) -> Strip:
    """The film of a slider that conserves mass; alpha: coefficient of Barus' law."""
    surfaces = Surfaces.of(p.roughness, p.asperity_stiffness, p.boundary_friction)
    thinning = p.film_suffix, p.thinning_values(p.viscosity)
    oil = Oil(p.viscosity, alpha, p.cavitation_pressure, *thinning)
    return Strip(*p.ends, p.pressure_order, oil, surfaces)


def conserving_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film with void fractions between its end pressures."""
    strip = strip_of(p, alpha)
    problem = strip.problem(speed)
    ends = np.array([p.start_pressure, p.end_pressure])
    if p.pressure_viscosity and not alpha:
        ends = -np.expm1(-p.pressure_viscosity * ends) / p.pressure_viscosity
    return strip.between(problem, ends, strip.starved(speed, p.supply))


def film_problem(p: Slider, speed: float, alpha: float) -> Problem:
    """The film between its end pressures (alpha = 0: the reduced ones), on a rod of radius zero."""
    x, m_p, dg = p.nodes, p.pressure_order, p.reynolds == "dg"
    nodes, oil = np.stack([x, p.gap(x)], axis=1), np.array([0.0, speed, p.viscosity, alpha])
    numbers = (dofs.separate_dofs if dg else dofs.chain_dofs)(p.segments, m_p, nodes.size)
    layout = dofs.DofLayout.of(displacement=nodes.size, pressure=numbers.max() + 1 - nodes.size)
    film = chain_block(f"film{p.film_suffix}", nodes, numbers, rules.film_rule(m_p))
    blocks = [replace(film, name=FILM)]
    thinning = p.thinning_values(p.viscosity)
    own = [thinning[name] for name in film.kernel.parameters if name in thinning]
    parameters = {FILM: np.concatenate([oil, [p.cavitation_penalty, 1.0, 1.0], own])}
    if dg:
        parameters["film_facet"] = oil
        sides = np.hstack([numbers[:-1], numbers[1:]])
        blocks.append(chain_block("film_facet", nodes, sides, rules.facet_rule(m_p)))
    ends = np.array([p.start_pressure, p.end_pressure])
    if p.pressure_viscosity and not alpha:
        ends = -np.expm1(-p.pressure_viscosity * ends) / p.pressure_viscosity
    problem = Problem(Assembler.build(layout.total, blocks), layout, parameters, {})
    return problem.with_fixed([layout.dofs(DISPLACEMENT), numbers[[0, -1], [0, -1]]], [0.0, ends])


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

    path = Continuation(newton, _STIFFER, "previous", name="log of the penalty")
    branch = path.follow(softened, log(_SOFT), 0.0, np.zeros(problem.layout.total))
    solution = branch.end
    if not alpha or not solution.converged:
        return problem, solution
    return transformed(film_problem(p, speed, alpha), alpha, newton, solution)
