"""The report of a design: what to change, what it does, and how it was found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from softehl.cases.harness.case import AnyCase
from softehl.cases.harness.report.page import all_keys, input_part, left_out
from softehl.cases.harness.report.part import FinishedRun, Part, ReportTable
from softehl.cases.harness.report.plot import plot, put_legend_above
from softehl.cases.harness.responses import titled
from softehl.cases.seal.report import style
from softehl.cases.seal.report.parts import PRESSURES, gland
from softehl.cases.seal.report.pictures import pictures_of
from softehl.cases.seal.report.section import View, section_figure
from softehl.cases.seal.sensitivity.design import CYCLE, Design, slope_of, value_of
from softehl.cases.seal.sensitivity.quantities import CALLED
from softehl.cases.seal.states.state import FilmRow


def design_title(design: Design, run: str) -> str:
    """The seal, the key and the target; run: the title of a run of the seal."""
    goal = design.target.goal_text.replace(" %", "\N{NO-BREAK SPACE}%")
    keys = " and ".join(lever.title for lever, _, _ in design.moved)
    return f"{run.partition(': ')[0]}: {keys} for {design.target.title} {goal}"


def design_parts(design: Design, case: AnyCase) -> list[Part]:
    """Answer, curve of the design, results before and after, gland, section, keys, limits."""
    previous, after = (
        FinishedRun(Path(name), case, p, [], content={"status": "converged"})
        for name, p in (("before", design.parameters), ("after", design.met))
    )
    films = dict(zip((previous.name, after.name), (design.films[0], design.films[-1]), strict=True))

    def section(run: FinishedRun) -> Figure:
        value, film = films[run.name]
        view = View(FilmRow.part_of(film), film.profile, film.section)
        return section_figure(design.at(value), [view])

    runs = [previous, after]
    sections = Part("Deformed section", PRESSURES, pictures_of(runs, section))
    parts = [_summary(design), _curve(design), _both(design), gland(runs), sections]
    return [*parts, input_part(runs), *left_out(case), all_keys(runs)]


def _summary(design: Design) -> Part:
    p, first, last = design.parameters, design.steps[0], design.steps[-1]
    previous, after = (design.measure(step.value) for step in (first, last))
    by, target, unit = design.by, design.target, f" {design.by.unit}".rstrip()
    return Part(
        "Answer",
        lines=[
            f"{by.title} {after:.5g}{unit} instead of {previous:.5g}{unit}: "
            f"{target.title} {last.quantity:.4g} {target.unit} instead of {first.quantity:.4g} "
            f"{target.unit}, {design.change:+.2f} % (wanted {target.goal_text})",
            *(
                f"and {lever.title} {later:.5g} {lever.unit} instead of {earlier:.5g} {lever.unit}"
                for lever, earlier, later in design.moved[1:]
            ),
            *(
                f"{each.title} {value:.4g} {each.unit} (wanted {each.goal_text})"
                for each, value in zip(design.targets, last.values, strict=False)
                if each != target
            ),
            _rate(design),
            f"this is {_what(design)} at {p.speeds[0]:g} mm/s and "
            f"{p.sealed_pressure:g} MPa; softehl run with {by.name} = {after:.5g} shows "
            "both strokes and other speeds",
        ],
    )


def _what(design: Design) -> str:
    """The stroke of a design, or its cycle."""
    if design.target.quantity == CYCLE:
        return f"a cycle of {design.parameters.travel:g} mm out and back"
    return f"the {style.STROKES[design.target.stroke or design.parameters.stroke]}"


def _rate(design: Design) -> str:
    """The change of the quantity with a step of the key that a workshop thinks in."""
    by, target, value, step_size = design.by, design.target, design.steps[-1].value, 1e-6
    measure = design.measure(value)
    slope = next(step.slope for step in reversed(design.steps) if step.state)
    step = {"mm": 0.01, "%": 1.0}.get(by.unit, 0.01 * abs(measure))
    percent = (
        100.0 * slope * step_size * step / (design.measure(value * (1.0 + step_size)) - measure)
    )
    unit = f" {by.unit}".rstrip()
    return f"{step:.3g}{unit} more {by.title} there: {target.title} {percent:+.2g} %"


def _curve(design: Design) -> Part:
    """The quantity over the key: what was solved, what was wanted, the first prediction."""
    rows = [
        (
            number,
            f"{design.measure(step.value):.7g}",
            step.quantity,
            "made for this value" if step.state else "that of the film above",
        )
        for number, step in enumerate(design.steps, 1)
    ]
    key = titled(design.by.title, design.by.unit)
    quantity = titled(design.target.title, design.target.unit)
    text = (
        "Each mark is a nonlinear solve; the line is what the sensitivities of the first one "
        "predict; the full mark meets the target."
    )
    table = ReportTable("The way to the target", ("solve", key, quantity, "mesh"), rows)
    panel = plot(key, quantity)
    _draw(panel, design)
    return Part("Design curve", text, plots=[panel], tables=[table])


def _draw(panel: Any, design: Design) -> None:
    first, values = design.steps[0], [step.value for step in design.steps]
    slope = first.slope
    between = np.linspace(min(values), max(values), 41)
    predicted = first.quantity * (between / first.value) ** slope
    colour, target = style.COLOURS["out"], design.target.goal(first.quantity)
    along = [design.measure(value) for value in between.tolist()]
    panel.line(along, predicted, color=colour, legend_label="first prediction")
    dashes: dict[str, Any] = {"color": style.COLOURS["in"], "line_dash": "dashed"}
    panel.line([along[0], along[-1]], [target, target], **dashes, legend_label="target")
    x, y = [design.measure(value) for value in values], [step.quantity for step in design.steps]
    marks: dict[str, Any] = {"size": 9, "line_color": colour}
    panel.scatter(x[:-1], y[:-1], fill_color="white", **marks, legend_label="solved")
    panel.scatter(x[-1:], y[-1:], fill_color=colour, **marks, legend_label="design")
    put_legend_above(panel, columns=2)


def _both(design: Design) -> Part:
    """All results with the first value of the key and with the last one."""
    (_, first), (at, last) = design.films[0], design.films[-1]
    ratio, rows = design.steps[-1].value / at, []
    for name, (title, unit) in CALLED.items():
        previous = value_of(first, name)
        after = value_of(last, name) * ratio ** slope_of(last, name, design.by)
        rows.append((title, previous, after, f"{100.0 * (after / previous - 1.0):+.3g} %", unit))
    if (target := design.target).quantity == CYCLE:
        initial, later = design.steps[0].quantity, design.steps[-1].quantity
        rows.append((target.title, initial, later, f"{design.change:+.3g} %", target.unit))
    header = ("", "before", "after", "change", "unit")
    text = "Also what was not asked for changes; leakage of the stroke is not that of a cycle."
    return Part(
        "Before and after", text, tables=[ReportTable("Results of this film", header, rows)]
    )
