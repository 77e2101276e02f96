"""The form of the desk: a list for each key, in which anything else may be typed as well."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import panel as pn
import panel_material_ui as pmui
from panel.util import edit_readonly

from softehl.cases.app.choices import CHOICES, DENSITIES, SPEEDS, USUAL_SPEEDS, rods, slides_on
from softehl.cases.app.runs import CASE
from softehl.cases.harness.case import Run, load_case
from softehl.cases.harness.case_file import read_assignment, validated
from softehl.cases.harness.errors import BadInput
from softehl.cases.shipped import SHIPPED

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
        for shown in ("value", "value_input"):
            self.widgets["ring"].param.watch(self._offer_rods, shown)

    def watch(self, told: Callable[[Any], None]) -> None:
        """Call a function whenever a value changes, or what is typed in a field."""
        for key, widget in self.widgets.items():
            if key in _TEXTS:
                widget.param.watch(lambda event: _show_text(event.obj), "value")
                widget.param.watch(told, "value_input")
            widget.param.watch(told, "value")

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
        found: dict[str, Any] = {}
        for key, widget in self.widgets.items():
            value = widget.value_input or widget.value if key in _TEXTS else widget.value
            value = value.strip() if isinstance(value, str) else value
            if key != "more" and value and value != "smooth":
                found[key] = value
        if str(found.get("ring", "")).lower().startswith(_BY_GROOVE):
            found.pop("gland", None)
        if isinstance(rod := found.pop("rod", None), str):
            key, value = slides_on(rod)
            found[key] = value
        for line in (self.widgets["more"].value or "").splitlines():
            if line.strip():
                key, value = read_assignment(line, _HERE)
                found[key] = value
        return found

    def run(self) -> tuple[Run, Mapping[str, Any]]:
        """The run that is chosen, and its keys.  Raises BadInput, in words for the page."""
        values = self.values()
        case = load_case(SHIPPED[CASE])
        try:
            checked = validated(case.parameters, values, dict.fromkeys(values, _HERE))
        except BadInput as error:
            raise BadInput(error.message.removeprefix(f"{_HERE}: ")) from None
        return Run(case, checked, given=frozenset(values)), values

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
