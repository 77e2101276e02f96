"""The page of the desk: a form, the gland that follows, runs with their curves, what to do."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from io import StringIO
from typing import Any
from urllib.parse import urlencode

import pandas as pd
import panel as pn

from softehl.cases.app.form import Form
from softehl.cases.app.runs import Desk, RunState
from softehl.cases.harness.case import Alarm, Run
from softehl.cases.harness.earlier import advice_of
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.seal.report import style
from softehl.cases.seal.report.drawing import fit_numbers, gland_figure
from softehl.cases.seal.report.interactive import curve_plot, friction_plot

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


class Page:
    """One page in a browser; the runs belong to the desk and outlive it."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.form = Form()
        self.drawing = pn.pane.SVG(
            max_width=460, encode=False, sizing_mode="stretch_width", styles={"flex": "1 1 20rem"}
        )
        self.words = pn.pane.Alert(alert_type="light", styles={"flex": "1 1 18rem"})
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
        self.told = pn.pane.Str("", styles={"white-space": "pre-wrap"}, **_WIDE)
        self.links = pn.pane.HTML("", **_WIDE)
        self.answer = pn.Column(**_WIDE)
        self.plots = pn.pane.Bokeh(None), pn.pane.Bokeh(None)
        self.curves = pn.FlexBox(*self.plots)
        self.chosen: list[str] = []
        self._names: list[str] = []
        self._shown: object = None

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
                pn.FlexBox(self.drawing, self.words, **_WIDE),
                pn.pane.Markdown("## Runs"),
                self.table,
                self.progress,
                self.told,
                buttons,
                self.answer,
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
            self.words.param.update(object=html.escape(error.message), alert_type="danger")
            self.begin.disabled = True
            return
        self.form.settle()
        self.drawing.object = _drawing(run)
        warned = bool(run.case.warnings(run.parameters))
        self.words.param.update(object=_told(run), alert_type="warning" if warned else "light")
        self.begin.disabled = False

    def _start(self) -> None:
        try:
            _, values = self.form.run()
            name = self.desk.start(values)
        except (BadInput, OSError) as error:
            self.words.param.update(object=html.escape(str(error)), alert_type="danger")
            return
        self.chosen = [name]
        self._look()

    # --- runs -----------------------------------------------------------------------------------

    def _choose(self) -> None:
        self.chosen = [self._names[number] for number in self.table.selection]
        self._look()

    def _end(self) -> None:
        for name in self.chosen:
            self.desk.stop(name)

    def _resume(self) -> None:
        try:
            for name in self.chosen:
                self.desk.resume(name)
        except BadInput as error:
            self.told.object = error.message
            return
        self._look()

    def _look(self) -> None:
        """Show what has changed since the last look."""
        states = self.desk.states()
        known = [state.name for state in states]
        self.chosen = [name for name in self.chosen if name in known] or known[:1]
        rows = [_cells(state) for state in states]
        chosen = [state for state in states if state.name in self.chosen]
        shown = rows, self.chosen, [state.line for state in chosen]
        if shown == self._shown:
            return
        self._shown = shown
        with pn.io.hold():  # one message: parts of several may refer to what is gone by then
            self._list(states, rows)
            self._show(chosen)

    def _list(self, states: Sequence[RunState], rows: Sequence[dict[str, str]]) -> None:
        self._names = [state.name for state in states]
        self.table.value = pd.DataFrame(list(rows), columns=list(_COLUMNS))
        selection = [self._names.index(name) for name in self.chosen]
        if self.table.selection != selection:
            self.table.selection = selection

    def _show(self, chosen: Sequence[RunState]) -> None:
        """The chosen runs: how far they are, their answers and curves, what can be done."""
        self.stop.disabled = not any(state.running for state in chosen)
        self.go_on.disabled = any(s.running or s.status == "done" for s in chosen) or not chosen
        asked, done = (sum(getattr(s, name) for s in chosen) for name in ("asked", "done"))
        self.progress.value = round(100 * done / asked) if asked else 0
        self.told.object = "\n".join(
            f"{s.name}: {_SAVED if s.status == 'stopped' else s.line}"
            for s in chosen
            if s.status != "done"
        )
        found = [state.run for state in chosen if state.run is not None and state.run.rows]
        self.links.object = _links([run.name for run in found])
        self.answer.objects = [
            pn.pane.Alert(
                f"**{html.escape(run.name)}**: " + "<br>".join(map(html.escape, lines)),
                alert_type="danger" if any(isinstance(x, Alarm) for x in lines) else "light",
            )
            for run in found
            if (lines := _lines(run))
        ]
        plots = (curve_plot(found), friction_plot(found)) if found else (None, None)
        for pane, plot in zip(self.plots, plots, strict=True):
            pane.object = plot


def _lines(run: FinishedRun) -> list[str]:
    """The answer of a run, and the reasons for states that are not ok."""
    return [*run.answer, *run.case.notes(run.rows, advice_of(run.content, run.rows))]


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
    answer = run.answer
    return cells | {
        "seal": p.ring or f"{p.named} {p.ring_diameter:g}x{p.section_diameter:g}",
        "rubber": p.compound or f"{p.shear_modulus:.3g} MPa",
        "pressure": f"{10 * p.sealed_pressure:g} bar",
        "states": f"{state.done} of {state.asked}",
        "answer": answer[0] if answer else "",
    }


def _drawing(run: Run) -> str:
    """The gland of a run as SVG."""
    found = StringIO()
    with style.drawing():
        gland_figure(run.parameters).savefig(found, format="svg")
    text = found.getvalue()
    text = text[text.index("<svg") :]  # without the head of a file
    return re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)  # as wide as the page has room


def _told(run: Run) -> str:
    """Fit, warnings and what is assumed of a run, as the command line has them."""
    case, p = run.case, run.parameters
    fits = [f"{name} {value:.4g} {unit}" for name, (value, unit) in fit_numbers(p).items()]
    words = [*case.warnings(p), *case.foreword(p)]
    if assumed := case.assumed(p, run.given):
        words.append(f"assumed: {', '.join(assumed)}")
    return "\n".join(f"- {html.escape(line)}" for line in (*fits, *words))


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
