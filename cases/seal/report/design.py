"""The report of a design: what to change, what it does, and how it was found."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from softehl.cases.harness.report.page import all_keys, asked, left_out
from softehl.cases.harness.report.part import FinishedRun, Part, Picture, Table
from softehl.cases.seal.report import style
from softehl.cases.seal.report.interactive import narrow
from softehl.cases.seal.report.parts import gland, png
from softehl.cases.seal.report.section import View, section_figure
from softehl.cases.seal.sensitivity.design import value_of
from softehl.cases.seal.sensitivity.quantities import CALLED
from softehl.cases.seal.states.state import FilmRow, FilmState

if TYPE_CHECKING:
    from softehl.cases.harness.case import AnyCase
    from softehl.cases.seal.sensitivity.design_command import Design

_NEAR = 1e-6  # relative step of a key, for the rate of a measure that follows from it
_STEPS = {"mm": 0.01, "%": 1.0}  # of a key, by its unit: what a workshop thinks in
_LABEL, _CURVE = 30, 40  # letters of a line along an axis; points of a curve
_WIDTH, _HEIGHT = 620, 340  # px


def design_title(design: Design, run: str) -> str:
    """The seal, the key and the target; run: the title of a run of the seal."""
    change = f"{design.target.percent:+g}\N{NO-BREAK SPACE}%"
    return f"{run.partition(': ')[0]}: {_key(design)} for {_quantity(design)} {change}"


def design_parts(design: Design, case: AnyCase) -> list[Part]:
    """Answer, curve of the design, results before and after, gland, section, keys, limits."""
    import matplotlib

    runs = [
        FinishedRun(Path(name), case, p, [], content={"status": "converged"})
        for name, p in (("before", design.parameters), ("after", design.met))
    ]
    with matplotlib.rc_context(style.STYLE):
        pictures = [gland(runs), _section(design)]
    tables = [asked(runs), *left_out(case), all_keys(runs)]
    return [_answer(design), _curve(design), _both(design), *pictures, *tables]


def _answer(design: Design) -> Part:
    p, first, last = design.parameters, design.steps[0], design.steps[-1]
    values = [design.measure(step.value) for step in (first, last)]
    unit, size = f" {design.unit}".rstrip(), CALLED[design.target.quantity][1]
    stroke = style.STROKES[p.stroke]
    return Part(
        "Answer",
        lines=[
            f"{_key(design)} {values[1]:.5g}{unit} instead of {values[0]:.5g}{unit}: "
            f"{_quantity(design)} {last.quantity:.4g} {size} instead of {first.quantity:.4g} "
            f"{size}, {design.change:+.2f} % (wanted {design.target.percent:+g} %)",
            *_rate(design),
            f"this is the {stroke} at {p.speeds[0]:g} mm/s and {p.sealed_pressure:g} MPa; softehl "
            f"run with {design.asked} = {values[1]:.5g} shows both strokes and other speeds",
        ],
    )


def _rate(design: Design) -> list[str]:
    """The change of the quantity with a step of the key, where the target is met."""
    value, slope = design.steps[-1].value, _slopes(design)[design.target.quantity]
    move = design.measure(value * (1.0 + _NEAR)) - design.measure(value)
    step = _STEPS.get(design.unit, 0.01 * abs(design.measure(value)))
    percent = 100.0 * slope * _NEAR * step / move
    unit = f" {design.unit}".rstrip()
    return [f"{step:.3g}{unit} more {_key(design)} there: {_quantity(design)} {percent:+.2g} %"]


def _curve(design: Design) -> Part:
    """The quantity over the key: what was solved, what was wanted, the first prediction."""
    unit, size = design.unit, CALLED[design.target.quantity][1]
    rows = [
        (
            number,
            f"{design.measure(step.value):.7g}",
            step.quantity,
            "made for this value" if step.state else "that of the film above",
        )
        for number, step in enumerate(design.steps, 1)
    ]
    key = f"{_key(design)} [{unit}]" if unit else _key(design)
    header = ("solve", key, f"{_quantity(design)} [{size}]", "mesh")
    text = (
        "Each mark is a nonlinear solve; the line is what the sensitivities of the first one "
        "predict; the full mark meets the target."
    )
    table = Table("The way to the target", header, rows)
    return Part("Design curve", text, plots=[_plot(design, key)], tables=[table])


def _plot(design: Design, key: str) -> Any:
    from bokeh.plotting import figure

    steps, quantity = design.steps, design.target.quantity
    panel = figure(
        **narrow(_WIDTH),
        height=_HEIGHT,
        x_axis_label=key,
        y_axis_label="\n".join(wrap(f"{_quantity(design)} [{CALLED[quantity][1]}]", _LABEL)),
        tools="pan,box_zoom,wheel_zoom,reset,save",
    )
    panel.toolbar.logo = None
    x, y = [design.measure(s.value) for s in steps], [s.quantity for s in steps]
    wanted = design.target.factor * steps[0].quantity
    panel.line(*_predicted(design), color=style.COLOURS["out"], legend_label="first prediction")
    ends = [min(x), max(x)]
    look: dict[str, Any] = {"color": style.COLOURS["in"], "line_dash": "dashed"}
    panel.line(ends, [wanted, wanted], **look, legend_label="target")
    marks: dict[str, Any] = {"size": 9, "line_color": style.COLOURS["out"]}
    panel.scatter(x[:-1], y[:-1], fill_color="white", **marks, legend_label="solved")
    panel.scatter(x[-1:], y[-1:], fill_color=style.COLOURS["out"], **marks, legend_label="design")
    panel.legend.ncols = 2
    panel.add_layout(panel.legend[0], "above")
    return panel


def _predicted(design: Design) -> tuple[list[float], list[float]]:
    """The quantity over the key by the sensitivity of the first film, between the steps."""
    first = design.steps[0]
    assert first.state is not None
    assert first.state.sensitivity is not None
    slope = first.state.sensitivity[design.target.quantity].get(design.key, 0.0)
    low, high = (choose(s.value for s in design.steps) for choose in (min, max))
    values = [low + (high - low) * k / _CURVE for k in range(_CURVE + 1)]
    found = [(v / first.value) ** slope * first.quantity for v in values]
    return [design.measure(v) for v in values], found


def _both(design: Design) -> Part:
    """All results with the first value of the key and with the last one."""
    (_, first), (at, last) = _films(design)
    slopes, value = _slopes(design), design.steps[-1].value
    rows = []
    for name, (words, unit) in CALLED.items():
        before, after = value_of(first, name), value_of(last, name)
        after *= (value / at) ** slopes[name]
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


def _slopes(design: Design) -> dict[str, float]:
    """Log derivatives of all results by the key, of the last film."""
    found = _films(design)[1][1].sensitivity or {}
    return {name: found.get(name, {}).get(design.key, 0.0) for name in CALLED}


def _key(design: Design) -> str:
    return design.asked.replace("_", " ")


def _quantity(design: Design) -> str:
    return CALLED[design.target.quantity][0]
