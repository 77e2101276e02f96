"""The form of the desk: a list for each key, in which anything else may be typed as well."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import panel as pn
import panel_material_ui as pmui

from softehl.cases.app.choices import CHOICES, DENSITIES, SPEEDS, USUAL_SPEEDS, rods, slides_on
from softehl.cases.app.runs import CASE
from softehl.cases.harness.case import Run, load_case
from softehl.cases.harness.case_file import read_assignment, validated
from softehl.cases.harness.errors import BadInput
from softehl.cases.shipped import SHIPPED

_HERE = "desk"
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
        self.widgets["ring"].param.watch(self._offer_rods, "value")

    def watch(self, told: Callable[[Any], None]) -> None:
        """Call a function whenever a value changes."""
        for widget in self.widgets.values():
            widget.param.watch(told, "value")

    def keep_in(self, address: Any) -> None:
        """Keep all values in the address of the page, so that they are there after a reload."""
        for key, widget in self.widgets.items():
            address.sync(widget, {"value": key})

    def values(self) -> dict[str, Any]:
        """The keys of the case.  Raises BadInput for another key that cannot be read."""
        found: dict[str, Any] = {}
        for key, widget in self.widgets.items():
            value = widget.value.strip() if isinstance(widget.value, str) else widget.value
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
            self.widgets["rod"].options = offered
            if self.widgets["rod"].value not in offered:
                self.widgets["rod"].value = offered[0]
