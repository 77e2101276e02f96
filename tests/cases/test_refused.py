"""Inputs that are refused: `refused.json` has each with the words of its message, in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from softehl.cases.cycle import Cycle
from softehl.cases.harness.case_file import read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.shipped import SHIPPED
from softehl.cases.slider.case import Slider

REFUSED: dict[str, list[Any]] = json.loads(
    Path(__file__).with_name("refused.json").read_text(encoding="utf-8")
)
KEYS: dict[str, tuple[Any, ...]] = {
    "oring": (Seal,),
    "slider": (Slider,),
    "oring and slider": (Seal, Slider),
    "cycle": (lambda **given: Cycle.model_validate(Cycle.completed(given)),),
}


def assert_said(words: str | list[str], message: str) -> None:
    """Whether a message has all of the words."""
    missing = [
        word for word in ([words] if isinstance(words, str) else words) if word not in message
    ]
    assert not missing, message


@pytest.mark.parametrize("case", KEYS)
def test_keys_that_are_refused(case: str) -> None:
    for given, words in REFUSED[case]:
        for make in KEYS[case]:
            with pytest.raises(ValueError) as caught:  # noqa: PT011
                make(**given)
            assert_said(words, str(caught.value))


def test_what_is_typed_and_refused() -> None:
    for case, assignments, words in REFUSED["typed"]:
        with pytest.raises(BadInput) as caught:
            read_case(case, SHIPPED, assignments)
        assert_said(words, str(caught.value))
        assert "\n" not in str(caught.value)
