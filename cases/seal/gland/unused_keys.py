"""Keys that were given and change nothing, because another one is missing that they belong to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from softehl.cases.seal.gland.given import shown
from softehl.cases.seal.gland.parameters import Seal

_NEEDS: Mapping[str, tuple[Callable[[Seal], Any], str]] = {
    "temperature": (lambda p: p.oil or p.fit, "an oil or a fit"),
    "ogden_terms": (lambda p: p.fit, "a fit"),
    "corner_fillet": (lambda p: p.opens, "an extrusion_gap"),
    "cavitation_penalty": (lambda p: not p.conserving, 'cavitation = "penalty"'),
    "asperity_stiffness": (lambda p: p.rough, "a roughness"),
    "boundary_friction": (lambda p: p.rough, "a roughness"),
}
"""Key -> whether it has an effect, and what it has none without."""


def unused_keys(p: Seal) -> list[str]:
    """Keys with a value of their own that have no effect, in words."""
    fields = type(p).model_fields
    return [
        f"{key} = {shown(getattr(p, key))} has no effect without {needed}"
        for key, (used, needed) in _NEEDS.items()
        if getattr(p, key) != fields[key].default and not used(p)
    ]
