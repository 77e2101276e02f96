"""What a seal is taken to be where its keys were not given, in words."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.gland.rubbers import materials
from softehl.cases.seal.gland.rubbers.rubber import shore_band
from softehl.cases.seal.gland.sections.keys import ROUND, dimensions

_RUBBER = {"fit", "shore_A"}.union(*(m.keys for m in materials.MATERIALS.values()))


def assumed(p: ORing, given: Collection[str]) -> list[str]:
    """What results hang on and nobody said.  given: the keys that were."""
    said = frozenset(given)
    return [*_ring(p, said), *_gland(p, said), *_fluids(p, said)]


def _ring(p: ORing, said: frozenset[str]) -> Iterator[str]:
    """Ring and rubber."""
    if not said & {"ring", "section_diameter", "outline"}:
        yield f"a section of {p.section_diameter:g} mm"
    if p.section != ROUND and not said & set(dimensions(p.section)):
        yield f"the usual proportions of section {p.section}"
    if not said & {"ring", "inner_diameter"}:
        yield f"inner diameter {p.inner_diameter:g} mm"
    if p.shore_A is not None:
        low, high = shore_band(p.shore_A)
        yield (
            f"a shear modulus of {p.shear_modulus:.3g} MPa by hardness, known to {low:+.0f} and "
            f"{high:+.0f} %"
        )
    elif not said & _RUBBER:
        yield f"a rubber of shear modulus {p.shear_modulus:.3g} MPa"


def _gland(p: ORing, said: frozenset[str]) -> Iterator[str]:
    """Rod and groove."""
    if not said & {"rod", "rod_diameter"}:
        yield f"a rod of {p.rod_diameter:g} mm"
    sizes = {
        "housing_diameter": (p.housing_diameter, {"squeeze", "gland"}),
        "groove_width": (p.groove_width, {"gland"}),
    }
    unsaid = [k for k, (_, others) in sizes.items() if not said & {k, *others}]
    if p.gland and not p.round:
        unsaid = [k for k in sizes if k not in said]  # also where the gland was asked for by name
    if unsaid:
        kind = "its standard gland" if p.gland else "a gland"
        if not p.round:
            kind = f"the gland of an O-ring, as none is known for this {p.named}"
        yield f"{kind} ({', '.join(f'{k} = {sizes[k][0]:g} mm' for k in unsaid)})"
    if not said & {"backup", "extrusion_gap"}:
        yield "a back-up ring"


def _fluids(p: ORing, said: frozenset[str]) -> Iterator[str]:
    """Pressure and oil."""
    if "sealed_pressure" not in said:
        yield f"a sealed pressure of {p.sealed_pressure:g} MPa"
    if not said & {"viscosity", "oil"}:
        yield f"an oil of {1e9 * p.viscosity:.3g} mPa s"
