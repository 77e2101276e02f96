"""Warnings about a seal before it is run, a line each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from softehl.cases.seal.gland.given import shown
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.gland.trade.rubber_names import RANGES

_NEEDS: Mapping[str, tuple[Callable[[Seal], Any], str]] = {
    "temperature": (lambda p: p.oil or p.fit, "an oil or a fit"),
    "ogden_terms": (lambda p: p.fit, "a fit"),
    "corner_fillet": (lambda p: p.opens, "an extrusion_gap"),
    "cavitation_penalty": (lambda p: not p.conserving, 'cavitation = "penalty"'),
    "asperity_stiffness": (lambda p: p.rough, "a roughness"),
    "boundary_friction": (lambda p: p.rough, "a roughness"),
}
"""Key -> whether it has an effect, and what it has none without."""

_FILL = (60.0, 95.0)
"""Volume of the ring over that of its gland that handbooks advise, %."""

_STRETCH = 5.0
"""Largest stretch that handbooks advise, %."""

_LEAST_BULK = 20.0
"""Bulk over shear modulus of a rubber at least; Poisson's ratio is 0.475 there."""


def warnings(p: Seal) -> list[str]:
    """Keys without effect, what is unusual of the rubber, and what handbooks warn of."""
    return [*_unused(p), *_rubber(p), *handbook(p)]


def _unused(p: Seal) -> Iterator[str]:
    """Keys with a value of their own that change nothing: another one is missing."""
    for key, (used, needed) in _NEEDS.items():
        value = getattr(p, key)
        if value != type(p).model_fields[key].default and not used(p):
            yield f"{key} = {shown(value)} has no effect without {needed}"


def _rubber(p: Seal) -> Iterator[str]:
    """Its compressibility, and a temperature outside the range of its polymer."""
    ratio = p.bulk_modulus / p.shear_modulus
    if ratio < _LEAST_BULK:
        yield (
            f"bulk_modulus = {p.bulk_modulus:g} MPa is {ratio:.3g} shear moduli: "
            "rubbers have hundreds to thousands"
        )
    used = RANGES[p.polymer] if p.polymer else None
    if used and p.temperature is not None and not used[0] <= p.temperature <= used[1]:
        yield (
            f"temperature = {p.temperature:g} degC: {p.polymer} is used from {used[0]:g} to "
            f"{used[1]:g} degC"
        )


def handbook(p: Gland) -> Iterator[str]:
    """What handbooks warn of in a ring and its gland."""
    low, high = _FILL
    if not low <= p.fill_percent <= high:
        yield (
            f"the ring fills {p.fill_percent:.0f} % of its gland; handbooks advise {low:g} to "
            f"{high:g} %"
        )
    if p.stretch_percent > _STRETCH:
        yield (
            f"the ring is stretched by {p.stretch_percent:.1f} % on its "
            f"{'piston' if p.piston else 'rod'}; handbooks advise at most {_STRETCH:g} %"
        )
