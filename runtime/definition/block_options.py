"""Reading what `Study.add` is given of the form of a page: names, places, quadrature, elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.definition.element_blocks import On
from softehl.runtime.definition.problem_definition import Form, StudyError
from softehl.runtime.kernels.kernel import Rule


def form_of(
    name: str,
    shared: Sequence[str],
    called: Mapping[str, str] | None,
    along: Mapping[str, int | Integers] | None,
    rule: object,
    constant: bool,
) -> Form:
    """The form of a page on the elements of block `name`.  Raises StudyError."""
    names = _mapping(name, "called", called, '{"u": "u_x"}')
    if not all(isinstance(said, str) for said in names.values()):
        raise StudyError(f'{name!r}: called = {names}: names are text, as in called={{"u": "u_x"}}')
    fields = _mapping(name, "along", along, '{"p": 2}')
    orders = {n: int(g) if isinstance(g, np.integer) else g for n, g in fields.items()}
    one = (shared,) if isinstance(shared, str) else shared
    return Form(frozenset(one), names, orders, _rule(name, rule), constant)


def elements_on(name: str, on: Any) -> On:
    """A side, or node numbers as an array, which may be given as lists.  Raises StudyError."""
    given: On = on
    if isinstance(on, np.ma.MaskedArray):
        raise StudyError(f"{name!r}: on is a masked array, whose mask says nothing here")
    if not isinstance(on, list | tuple):
        return given
    try:
        return np.array(on)
    except ValueError:
        raise StudyError(f"{name!r}: on = {on}: elements have the same number of nodes") from None


def _mapping(name: str, word: str, given: Any, example: str) -> Mapping[str, Any]:
    if given is None or isinstance(given, Mapping):
        return dict(given or {})
    raise StudyError(f"{name!r}: {word} = {given!r}: a dict is needed, as in {word}={example}")


def _rule(name: str, given: Any) -> Rule | None:
    """A rule of quadrature as numbers, also one of a page."""
    if given is None or isinstance(given, Rule):
        return given
    if not callable(getattr(given, "rows", None)):
        raise StudyError(
            f"{name!r}: rule = {given!r}: a rule is needed, as in "
            "rule=softehl.quadrature.gauss(4, 1)"
        )
    rows = np.array(given.rows(), dtype=np.float64)
    return Rule(rows[:, :-1].copy(), rows[:, -1].copy())
