"""The O-ring in the groove and on the arc that the numbers of the tests belong to."""

from typing import Any

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmRow


def oring(**changes: Any) -> Seal:
    """The O-ring on the mesh and by the scheme of the paper, with other values for some keys."""
    values: dict[str, Any] = {
        "mesh": "uniform",
        "upwinding": 0.0,
        "solid": "taylor",
        "groove_width": 3.74,
        "arc_start": -34.0,
        "arc_end": 43.0,
        **changes,
    }
    return Seal(**values)


def film_values(**given: Any) -> dict[str, Any]:
    """The columns of a made-up row: what is given, and zeros."""
    return {**{column.name: column.kind() for column in FilmRow.columns()}, **given}
