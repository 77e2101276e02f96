"""Page of the desk: a form, the gland that follows, runs with their curves.

The form has a list for each key, in terms of the trade; other texts may be typed.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from math import ceil
from typing import Any
from urllib.parse import urlencode

import pandas as pd
import panel as pn
import panel_material_ui as pmui
from panel.util import edit_readonly

from softehl.cases.app.runs import CASE, Desk, RunState
from softehl.cases.harness.case import Alarm, Run, load_case
from softehl.cases.harness.case_file import read_assignment, validated
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.harness.resume import advice_of
from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError, number_text
from softehl.cases.seal.gland.trade.oil_names import FAMILIES
from softehl.cases.seal.gland.trade.ring_names import read_ring
from softehl.cases.seal.gland.trade.rubber_names import RANGES
from softehl.cases.seal.report import style
from softehl.cases.seal.report.bokeh_plots import curve_plot, friction_plot
from softehl.cases.seal.report.gland_drawing import fit_numbers, gland_figure
from softehl.cases.shipped import SHIPPED


@dataclass(frozen=True)
class KeyChoice:
    """A key of a case: what it is called on the desk, what it begins with, what is offered."""

    key: str
    label: str
    value: str
    options: Sequence[str]


SPEEDS = (10, 20, 50, 100, 200, 400, 800, 1600)
"""Rod speeds that are offered, mm/s."""

USUAL_SPEEDS = (100, 400)
"""Choices that a new desk begins with."""

DENSITIES = {"coarse, seconds": 1, "usual": 2, "fine": 4, "very fine, minutes": 8}
"""Meshes in words -> the key `density`."""

_SIZES = (
    *("6x2", "8x2", "10x2", "12x2", "16x2", "20x2.65", "25x2.65", "28x3.55", "32x3.55"),
    *("36x3.55", "36x4", "40x4", "45x4", "50x5.3", "56x5.3", "63x5.3", "80x5.3", "100x7"),
)
_SMALL, _LARGE = 2.5, 500.0  # mm: those that have a gland and a fit
_RINGS = (
    *(f"ISO 3601 {size}" for size in _SIZES),
    *("X-ring 36x4", "X-ring AS568-210", "X-ring AS568-226"),
    *("U-cup 20x30x8", "U-cup 25x35x8", "U-cup 36x46x8", "U-cup 50x65x12"),
    *(ring.name for ring in catalogue.as568().values() if _SMALL < ring.inner_diameter < _LARGE),
    *(ring.name for code, ring in catalogue.series().items() if code[0] == "P"),
)
_HARDNESSES = {"FKM": (75, 80, 90), "EPDM": (70, 80), "PU": (90, 95)}
_RUBBERS = tuple(f"{p} {s}" for p in RANGES for s in _HARDNESSES.get(p, (70, 80, 90)))
_OILS = (
    *(f"HLP {grade}" for grade in (10, 15, 22, 32, 46, 68, 100)),
    *(f"HVLP {grade}" for grade in (15, 22, 32, 46, 68)),
    *(f"ISO VG {grade}" for grade in (10, 15, 22, 32, 46, 68, 100, 150, 220)),
    *(f"{family} {grade}" for family in FAMILIES for grade in (32, 46, 68)),
    *("46 cSt at 40 degC, 6.8 cSt at 100 degC", "10 mPas", "100 mPas"),
)

CHOICES = (
    KeyChoice("ring", "Seal", "ISO 3601 36x4", _RINGS),
    KeyChoice("rod", "Rod, or bore of a piston", "36 f7", ()),
    KeyChoice("compound", "Rubber", "NBR 70", _RUBBERS),
    KeyChoice("oil", "Oil", "HLP 46", _OILS),
    KeyChoice("temperature", "Temperature", "40 degC", [f"{t} degC" for t in range(20, 101, 10)]),
    KeyChoice(
        key="sealed_pressure",
        label="Sealed pressure",
        value="10 bar",
        options=[f"{p} bar" for p in (1, 2, 6, 10, 16, 25, 40, 63, 100, 160)],
    ),
    KeyChoice(
        key="roughness",
        label="Surface of the seal",
        value="smooth",
        options=["smooth", *(f"Ra {height}" for height in (0.1, 0.2, 0.4, 0.8))],
    ),
    KeyChoice("gland", "Gland", "hydraulic", ["hydraulic", "pneumatic"]),
)
"""All that is chosen by one text, in the order of the desk."""


BORE = "bore "
"""What the size of a bore begins with."""


def slides_on(text: str) -> tuple[str, str]:
    """The key and its value that a rod, or a bore, is in a case."""
    bore = text.lower().startswith(BORE)
    return ("bore", text[len(BORE) :].strip()) if bore else ("rod", text)


def rods(ring: str) -> list[str]:
    """Rods that a ring goes with, the usual one first, and the bore that it just fits into; none
    where the ring is not understood.
    """
    try:
        ring_name = read_ring(ring)
    except NotUnderstoodError:
        return []
    if ring_name.outer is not None:
        inner, bore = ring_name.inner, ring_name.outer
        sizes: tuple[float, float] = (inner, ceil(1.02 * inner))
    else:
        try:
            found_ring = catalogue.ring(ring)
        except NotUnderstoodError:
            return []
        inner, bore = found_ring.inner_diameter, round(found_ring.outer_diameter, 1)
        of_any_size = not (ring_name.number or ring_name.code or ring_name.inch)
        sizes = (
            (inner, ceil(1.02 * inner)) if of_any_size else (ceil(inner), round(1.02 * inner, 1))
        )
    texts = dict.fromkeys(map(number_text, sizes))
    values = [f"{size}{fit}" for size in texts for fit in _FITS]
    return [*values, *(f"{BORE}{number_text(bore)}{fit}" for fit in _HOLES)]


_HOLES = (" H8", " H9", "")
_FITS = (" f7", " f8", " h8", " h9", " e8", "")


_HERE = "desk"
_TEXTS = frozenset(choice.key for choice in CHOICES)
"""Keys whose fields take any text."""

_BY_GROOVE = "u-cup"
"""A ring that is named by its groove, which has no other gland."""


class Form:
    """Widgets by key, and the keys of a case that follow from them."""

    def __init__(self) -> None:
        self.widgets: dict[str, Any] = {
            choice.key: pmui.AutocompleteInput(
                name=choice.label,
                value=choice.value,
                options=list(choice.options) or rods(CHOICES[0].value),
                restrict=False,
                case_sensitive=False,
                min_characters=0,
                search_strategy="includes",
                size="small",
                sizing_mode="stretch_width",
            )
            for choice in CHOICES
        }
        self.widgets["speeds"] = pn.widgets.MultiChoice(
            name="Rod speeds [mm/s]",
            value=list(USUAL_SPEEDS),
            options=list(SPEEDS),
            sizing_mode="stretch_width",
        )
        self.widgets["density"] = pn.widgets.Select(
            name="Mesh", value=DENSITIES["usual"], options=DENSITIES, sizing_mode="stretch_width"
        )
        self.widgets["more"] = pn.widgets.TextAreaInput(
            name="Other keys, KEY = VALUE in each line",
            placeholder="stroke = out",
            sizing_mode="stretch_width",
        )
        for attribute in ("value", "value_input"):
            self.widgets["ring"].param.watch(self._offer_rods, attribute)

    def watch(self, on_change: Callable[[Any], None]) -> None:
        """Call a function whenever a value changes, or what is typed in a field."""
        for key, widget in self.widgets.items():
            if key in _TEXTS:
                widget.param.watch(lambda event: _show_text(event.obj), "value")
                widget.param.watch(on_change, "value_input")
            widget.param.watch(on_change, "value")

    def settle(self) -> None:
        """Take over what was typed and not entered: the form is what its fields show."""
        for key in _TEXTS:
            widget = self.widgets[key]
            typed = widget.value_input
            if typed and widget.value != typed:
                _take(widget, typed, widget.options)

    def keep_in(self, address: Any) -> None:
        """Keep all values in the address of the page, so that they are there after a reload."""
        for key, widget in self.widgets.items():
            if key in _TEXTS and (text := address.query_params.get(key)):
                _take(widget, str(text), widget.options)
            address.sync(widget, {"value": key})

    def values(self) -> dict[str, Any]:
        """The keys of the case.  Raises BadInput for another key that cannot be read."""
        values: dict[str, Any] = {}
        for key, widget in self.widgets.items():
            value = widget.value_input or widget.value if key in _TEXTS else widget.value
            value = value.strip() if isinstance(value, str) else value
            if key != "more" and value and value != "smooth":
                values[key] = value
        if str(values.get("ring", "")).lower().startswith(_BY_GROOVE):
            values.pop("gland", None)
        if isinstance(rod := values.pop("rod", None), str):
            key, value = slides_on(rod)
            values[key] = value
        for line in (self.widgets["more"].value or "").splitlines():
            if line.strip():
                key, value = read_assignment(line, _HERE)
                values[key] = value
        return values

    def run(self) -> tuple[Run, Mapping[str, Any]]:
        """The run that is chosen, and its keys.  Raises BadInput, in words for the page."""
        values = self.values()
        case = load_case(SHIPPED[CASE])
        try:
            checked = validated(case.parameters, values, dict.fromkeys(values, _HERE))
        except BadInput as error:
            raise BadInput(error.message.removeprefix(f"{_HERE}: ")) from None
        return Run(case, checked, set_keys=frozenset(values)), values

    def _offer_rods(self, event: Any) -> None:
        """Offer the rods that a new ring goes with, and take the usual one."""
        offered = rods(event.new or "")
        if offered:
            rod = self.widgets["rod"]
            _take(rod, rod.value if rod.value in offered else offered[0], offered)


def _take(widget: Any, text: str, offered: Sequence[str]) -> None:
    """Give a field its text and what it offers, in one change: it drops a value that is not among
    its options, also one that was refused, as soon as these change.
    """
    options = list(offered) if text in offered else [*offered, text]
    widget.param.update(options=options, value=text)


def _show_text(widget: Any) -> None:
    """Write the value of a field into it: the widget empties itself where that is not listed."""
    if widget.value and widget.value_input != widget.value:
        with edit_readonly(widget):
            widget.value_input = widget.value


PERIOD = 500
"""Milliseconds between two looks at the runs."""

_NARROW = """
@media (max-width: 40rem) {
  #container { height: auto !important; overflow: visible !important; }
  #content { display: block; overflow: visible !important; }
  #sidebar { width: 100% !important; height: auto !important; border: none; }
  #main { width: 100%; max-height: none !important; overflow: visible !important; }
}
"""
"""On a telephone the form stands above the runs."""

_WIDE = {"sizing_mode": "stretch_width"}


class AppPage:
    """One page in a browser; the runs belong to the desk and outlive it."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.form = Form()
        self.drawing = pn.pane.SVG(
            max_width=460, encode=False, sizing_mode="stretch_width", styles={"flex": "1 1 20rem"}
        )
        self.preview_text = pn.pane.Alert(alert_type="light", styles={"flex": "1 1 18rem"})
        self.begin = pn.widgets.Button(name="Run", button_type="primary", **_WIDE)
        self.table = pn.widgets.Tabulator(
            pd.DataFrame(),
            selectable="checkbox",
            show_index=False,
            disabled=True,
            theme="bootstrap5",
            theme_classes=["table-sm"],
            layout="fit_columns",
            widths=_COLUMNS,
            formatters={name: {"type": "textarea"} for name in _COLUMNS},  # which wraps its text
            **_WIDE,
        )
        self.stop = pn.widgets.Button(name="Stop", button_type="danger", disabled=True)
        self.go_on = pn.widgets.Button(name="Go on", disabled=True)
        self.progress = pn.indicators.Progress(value=0, max=100, **_WIDE)
        self.run_status = pn.pane.Str("", styles={"white-space": "pre-wrap"}, **_WIDE)
        self.links = pn.pane.HTML("", **_WIDE)
        self.summaries = pn.Column(**_WIDE)
        self.plots = pn.pane.Bokeh(None), pn.pane.Bokeh(None)
        self.curves = pn.FlexBox(*self.plots)
        self.selected: list[str] = []
        self._names: list[str] = []
        self._display_state: object = None

    def view(self) -> Any:
        """The page, alive."""
        if pn.state.location is not None:
            self.form.keep_in(pn.state.location)
        self.form.watch(lambda _: self._preview())
        self.begin.on_click(lambda _: self._start())
        self.stop.on_click(lambda _: self._end())
        self.go_on.on_click(lambda _: self._resume())
        self.table.param.watch(lambda _: self._choose(), "selection")
        self._preview()
        self._look()
        pn.state.onload(self._keep_looking)
        buttons = pn.Row(self.stop, self.go_on, self.links)
        page = pn.template.BootstrapTemplate(
            title="softehl: reciprocating seals",
            meta_viewport="width=device-width, initial-scale=1",
            busy_indicator=None,  # it changes the document outside the lock
            sidebar=[*self.form.widgets.values(), self.begin],
            main=[
                pn.FlexBox(self.drawing, self.preview_text, **_WIDE),
                pn.pane.Markdown("## Runs"),
                self.table,
                self.progress,
                self.run_status,
                buttons,
                self.summaries,
                self.curves,
            ],
        )
        page.config.raw_css = [_NARROW]
        return page

    def _keep_looking(self) -> None:
        """Look at the runs from now on: the browser has the page that changes refer to."""
        pn.io.PeriodicCallback(callback=self._look, period=PERIOD, background=True).start()

    # --- what is chosen in the form -------------------------------------------------------------

    def _preview(self) -> None:
        """Draw the gland of the form, or say what is not understood."""
        try:
            run, _ = self.form.run()
        except BadInput as error:
            self.preview_text.param.update(object=html.escape(error.message), alert_type="danger")
            self.begin.disabled = True
            return
        self.form.settle()
        self.drawing.object = _drawing(run)
        warned = bool(run.case.warnings(run.parameters))
        self.preview_text.param.update(
            object=_messages(run), alert_type="warning" if warned else "light"
        )
        self.begin.disabled = False

    def _start(self) -> None:
        try:
            _, values = self.form.run()
            name = self.desk.start(values)
        except (BadInput, OSError) as error:
            self.preview_text.param.update(object=html.escape(str(error)), alert_type="danger")
            return
        self.selected = [name]
        self._look()

    # --- runs -----------------------------------------------------------------------------------

    def _choose(self) -> None:
        self.selected = [self._names[number] for number in self.table.selection]
        self._look()

    def _end(self) -> None:
        for name in self.selected:
            self.desk.stop(name)

    def _resume(self) -> None:
        try:
            for name in self.selected:
                self.desk.resume(name)
        except BadInput as error:
            self.run_status.object = error.message
            return
        self._look()

    def _look(self) -> None:
        """Show what has changed since the last look."""
        states = self.desk.states()
        names = [state.name for state in states]
        self.selected = [name for name in self.selected if name in names] or names[:1]
        rows = [_cells(state) for state in states]
        selected = [state for state in states if state.name in self.selected]
        display_state = rows, self.selected, [state.line for state in selected]
        if display_state == self._display_state:
            return
        self._display_state = display_state
        with pn.io.hold():  # one message: parts of several may refer to what is gone by then
            self._list(states, rows)
            self._show(selected)

    def _list(self, states: Sequence[RunState], rows: Sequence[dict[str, str]]) -> None:
        self._names = [state.name for state in states]
        self.table.value = pd.DataFrame(list(rows), columns=list(_COLUMNS))
        selection = [self._names.index(name) for name in self.selected]
        if self.table.selection != selection:
            self.table.selection = selection

    def _show(self, selected: Sequence[RunState]) -> None:
        """The chosen runs: how far they are, their answers and curves, what can be done."""
        self.stop.disabled = not any(state.running for state in selected)
        self.go_on.disabled = any(s.running or s.status == "done" for s in selected) or not selected
        requested, done = (
            sum(getattr(s, name) for s in selected) for name in ("requested", "done")
        )
        self.progress.value = round(100 * done / requested) if requested else 0
        self.run_status.object = "\n".join(
            f"{s.name}: {_SAVED if s.status == 'stopped' else s.line}"
            for s in selected
            if s.status != "done"
        )
        runs = [state.run for state in selected if state.run is not None and state.run.rows]
        self.links.object = _links([run.name for run in runs])
        self.summaries.objects = [
            pn.pane.Alert(
                f"**{html.escape(run.name)}**: " + "<br>".join(map(html.escape, lines)),
                alert_type="danger" if any(isinstance(x, Alarm) for x in lines) else "light",
            )
            for run in runs
            if (lines := _lines(run))
        ]
        plots = (curve_plot(runs), friction_plot(runs)) if runs else (None, None)
        for pane, plot in zip(self.plots, plots, strict=True):
            pane.object = plot


def _lines(run: FinishedRun) -> list[str]:
    """The answer of a run, and the reasons for states that are not ok."""
    return [*run.summary, *run.case.notes(run.rows, advice_of(run.content, run.rows))]


_SAVED = "stopped; what it reached is saved"
_COLUMNS = {
    **{"run": "16%", "seal": "14%", "rubber": "10%", "pressure": "12%"},
    **{"status": "10%", "states": "10%", "answer": "22%"},
}
"""Column of the list of runs -> its width."""


def _cells(state: RunState) -> dict[str, str]:
    """The row of a run in the list of runs."""
    cells = dict.fromkeys(_COLUMNS, "")
    cells |= {"run": state.name, "status": state.status}
    if state.run is None:
        return cells
    run, p = state.run, state.run.parameters
    summary = run.summary
    return cells | {
        "seal": p.ring or f"{p.named} {p.ring_diameter:g}x{p.section_diameter:g}",
        "rubber": p.compound or f"{p.shear_modulus:.3g} MPa",
        "pressure": f"{10 * p.sealed_pressure:g} bar",
        "states": f"{state.done} of {state.requested}",
        "answer": summary[0] if summary else "",
    }


def _drawing(run: Run) -> str:
    """The gland of a run as SVG."""
    buffer = StringIO()
    with style.drawing():
        gland_figure(run.parameters).savefig(buffer, format="svg")
    text = buffer.getvalue()
    text = text[text.index("<svg") :]  # without the head of a file
    return re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)  # as wide as the page has room


def _messages(run: Run) -> str:
    """Fit, warnings and what is assumed of a run, as the command line has them."""
    case, p = run.case, run.parameters
    fits = [f"{name} {value:.4g} {unit}" for name, (value, unit) in fit_numbers(p).items()]
    messages = [*case.warnings(p), *case.foreword(p)]
    if assumed := case.assumed(p, run.set_keys):
        messages.append(f"assumed: {'; '.join(assumed)}")
    return "\n".join(f"- {html.escape(line)}" for line in (*fits, *messages))


def _links(names: Sequence[str]) -> str:
    """Addresses of the files of runs."""
    if not names:
        return ""
    runs = urlencode([("run", name) for name in names])
    kinds = {"report.html": "Report", "report.xlsx": "Spreadsheet"}
    if len(names) == 1:
        kinds["case.toml"] = "Case file"
    return " &nbsp; ".join(
        f'<a href="file/{kind}?{html.escape(runs)}" target="_blank">{word}</a>'
        for kind, word in kinds.items()
    )
