"""The harness knows no physics: no word of it, no import of a case."""

import re
from pathlib import Path

import pytest

from tests.test_walls import imports_of

HARNESS = Path(__file__).parents[2] / "cases" / "harness"
PHYSICS = (
    *("seal", "sealed", "sealing", "rod", "ring", "oring", "groove", "gland", "housing", "arc"),
    *("pressure", "film", "stroke", "outstroke", "instroke", "contact", "speed", "density"),
    *("leak", "leakage", "friction", "viscosity", "lubricant", "oil", "inlet", "wedge", "slider"),
)
CASES = ("cases.seal", "cases.paper", "cases.oring", "cases.slider", "cases.shipped", "cases.cli")
QUANTITIES = {"units.py": {"viscosity", "density", "oil"}}
"""What a table of units has to say of cSt: that a density is missing."""
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def physics(source: str) -> set[str]:
    """Words of physics in a file: parts of identifiers, strings, comments; also in the plural."""
    words = {word.lower() for word in _WORD.findall(source)}
    return {word for word in words if re.sub("(ies|s)$", _singular, word) in PHYSICS}


def _singular(ending: re.Match[str]) -> str:
    return "y" if ending[0] == "ies" else ""


def test_the_harness_mentions_no_physics() -> None:
    for path in HARNESS.glob("*.py"):
        source = path.read_text(encoding="utf-8")
        assert physics(source) <= QUANTITIES.get(path.name, set()), path
        names = {name.removeprefix("softehl.") for name in imports_of(source)}
        assert {name for name in names if name.startswith(CASES)} == set(), path


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("sealed_pressure: float", "pressure"),
        ("class FilmRow:", "film"),
        ('"""Both strokes of the rod."""', "strokes"),
        ("density # of the mesh", "density"),
        ("DENSITIES = ()", "densities"),
        ("from softehl.cases import oring", "oring"),
    ],
)
def test_a_word_of_physics_is_found(source: str, word: str) -> None:
    assert word in physics(source)
