"""The report of a design: what to change, what it does, and how it was found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.harness.case import AnyCase
from softehl.cases.harness.report.page import all_keys, asked, left_out
from softehl.cases.harness.report.part import FinishedRun, Part, Picture, Table
from softehl.cases.harness.report.plot import plot, put_legend_above
from softehl.cases.seal.report import style
from softehl.cases.seal.report.parts import gland, png
from softehl.cases.seal.report.section import View, section_figure
from softehl.cases.seal.sensitivity.design import value_of
from softehl.cases.seal.sensitivity.design_command import Design
from softehl.cases.seal.sensitivity.quantities import CALLED
from softehl.cases.seal.states.state import FilmRow, FilmState


def design_title(design: Design, run: str) -> str:
    """The seal, the key and the target; run: the title of a run of the seal."""
    change = f"{design.target.percent:+g}\N{NO-BREAK SPACE}%"
    return f"{run.partition(': ')[0]}: {_key(design)} for {_quantity(design)} {change}"


def design_parts(design: Design, case: AnyCase) -> list[Part]:
    """Answer, curve of the design, results before and after, gland, section, keys, limits."""
    runs = [
        FinishedRun(Path(name), case, p, [], content={"status": "converged"})
        for name, p in (("before", design.parameters), ("after", design.met))
    ]
    with style.drawing():
        pictures = [gland(runs), _section(design)]
    tables = [asked(runs), *left_out(case), all_keys(runs)]
    return [_answer(design), _curve(design), _both(design), *pictures, *tables]


def _answer(design: Design) -> Part:
    p, first, last = design.parameters, design.steps[0], design.steps[-1]
    before, after = (design.measure(step.value) for step in (first, last))
    unit, size = f" {design.by.unit}".rstrip(), CALLED[design.target.quantity][1]
    return Part(
        "Answer",
        lines=[
            f"{_key(design)} {after:.5g}{unit} instead of {before:.5g}{unit}: "
            f"{_quantity(design)} {last.quantity:.4g} {size} instead of {first.quantity:.4g} "
            f"{size}, {design.change:+.2f} % (wanted {design.target.percent:+g} %)",
            _rate(design),
            f"this is the {style.STROKES[p.stroke]} at {p.speeds[0]:g} mm/s and "
            f"{p.sealed_pressure:g} MPa; softehl run with {design.by.name} = {after:.5g} shows "
            "both strokes and other speeds",
        ],
    )


def _rate(design: Design) -> str:
    """The change of the quantity with a step of the key that a workshop thinks in."""
    value, slope, near = design.steps[-1].value, _slope(design, design.target.quantity), 1e-6
    measure = design.measure(value)
    step = {"mm": 0.01, "%": 1.0}.get(design.by.unit, 0.01 * abs(measure))
    percent = 100.0 * slope * near * step / (design.measure(value * (1.0 + near)) - measure)
    unit = f" {design.by.unit}".rstrip()
    return f"{step:.3g}{unit} more {_key(design)} there: {_quantity(design)} {percent:+.2g} %"


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
    key = f"{_key(design)} [{design.by.unit}]" if design.by.unit else _key(design)
    quantity = f"{_quantity(design)} [{CALLED[design.target.quantity][1]}]"
    text = (
        "Each mark is a nonlinear solve; the line is what the sensitivities of the first one "
        "predict; the full mark meets the target."
    )
    table = Table("The way to the target", ("solve", key, quantity, "mesh"), rows)
    panel = plot(key, quantity)
    _draw(panel, design)
    return Part("Design curve", text, plots=[panel], tables=[table])


def _draw(panel: Any, design: Design) -> None:
    first = design.steps[0]
    (_, film), _ = _films(design)
    assert film.sensitivity is not None
    slope = film.sensitivity[design.target.quantity].get(design.by.key, 0.0)
    values = [step.value for step in design.steps]
    between = np.linspace(min(values), max(values), 41)
    predicted = first.quantity * (between / first.value) ** slope
    colour, wanted = style.COLOURS["out"], design.target.factor * first.quantity
    along = [design.measure(value) for value in between.tolist()]
    panel.line(along, predicted, color=colour, legend_label="first prediction")
    dashes: dict[str, Any] = {"color": style.COLOURS["in"], "line_dash": "dashed"}
    panel.line([along[0], along[-1]], [wanted, wanted], **dashes, legend_label="target")
    x, y = [design.measure(value) for value in values], [step.quantity for step in design.steps]
    marks: dict[str, Any] = {"size": 9, "line_color": colour}
    panel.scatter(x[:-1], y[:-1], fill_color="white", **marks, legend_label="solved")
    panel.scatter(x[-1:], y[-1:], fill_color=colour, **marks, legend_label="design")
    put_legend_above(panel, columns=2)


def _both(design: Design) -> Part:
    """All results with the first value of the key and with the last one."""
    (_, first), (at, last) = _films(design)
    rows = []
    for name, (words, unit) in CALLED.items():
        before, after = value_of(first, name), value_of(last, name)
        after *= (design.steps[-1].value / at) ** _slope(design, name)
        rows.append((words, before, after, f"{100.0 * (after / before - 1.0):+.3g} %", unit))
    header = ("", "before", "after", "change", "unit")
    text = "Also what was not asked for changes; leakage of the stroke is not that of a cycle."
    return Part("Before and after", text, tables=[Table("Results of this film", header, rows)])


def _section(design: Design) -> Part:
    pictures = []
    for name, (value, state) in zip(("before", "after"), _films(design), strict=True):
        view = View(FilmRow.part_of(state), state.profile, state.section)
        pictures.append(Picture(name, png(section_figure(design.at(value), [view]))))
    text = "Stress in the ring, film pressure on the rod, contact pressure on housing and walls."
    return Part("Deformed section", text, pictures=pictures)


def _films(design: Design) -> tuple[tuple[float, FilmState], tuple[float, FilmState]]:
    """The first and the last film on a mesh of its own, each with its value of the key."""
    found = [(step.value, step.state) for step in design.steps if step.state is not None]
    return found[0], found[-1]


def _slope(design: Design, quantity: str) -> float:
    """Log derivative of a result by the key, of the last film."""
    _, (_, film) = _films(design)
    return (film.sensitivity or {}).get(quantity, {}).get(design.by.key, 0.0)


def _key(design: Design) -> str:
    return design.by.name.replace("_", " ")


def _quantity(design: Design) -> str:
    return CALLED[design.target.quantity][0]
