"""Values assumed where keys of a seal were not given, in words."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from softehl.cases.seal.gland.grooves import gland
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.gland.rubbers import materials
from softehl.cases.seal.gland.rubbers.hardness import shore_band
from softehl.cases.seal.gland.sections.keys import ROUND, dimensions
from softehl.cases.seal.gland.trade.oil_names import IMPROVED, read_oil_name
from softehl.cases.seal.gland.trade.ring_names import read_ring

_RUBBER = {"fit", "shore_A"}.union(*(m.keys for m in materials.MATERIALS.values()))


def assumed(p: Seal, given: Collection[str]) -> list[str]:
    """Important values that were not given.  given: the keys that were."""
    said = frozenset(given)
    return [*_ring(p, said), *_gland(p, said), *_fluids(p, said)]


def _ring(p: Seal, said: frozenset[str]) -> Iterator[str]:
    """Ring and rubber."""
    if not said & {"ring", "section_diameter", "outline"}:
        yield f"a section of {p.section_diameter:g} mm"
    if p.section != ROUND and not said & set(dimensions(p.section)):
        yield f"the usual proportions of section {p.section}"
    if not said & {"ring", "inner_diameter"}:
        yield f"inner diameter {p.ring_diameter:g} mm"
    if p.shore_A is not None:
        low, high = shore_band(p.shore_A, p.polymer)
        yield (
            f"a shear modulus of {p.shear_modulus:.3g} MPa by hardness, known to {low:+.0f} and "
            f"{high:+.0f} %"
        )
    elif not said & _RUBBER:
        yield f"a rubber of shear modulus {p.shear_modulus:.3g} MPa"


def _gland(p: Gland, said: frozenset[str]) -> Iterator[str]:
    """Rod and groove."""
    if p.ring and read_ring(p.ring).outer is not None:
        said |= {"rod", "housing_diameter", "groove_width"}  # a U-cup is named by its groove
    if not said & {"rod", "rod_diameter", "bore"}:
        yield f"a rod of {p.rod_diameter:g} mm"
    kind, charted = _kind(p)
    decided = {
        "housing_diameter": {"squeeze", "groove_depth", "gland", "groove_diameter"},
        "groove_width": {"fill", "gland"},
    }
    if not charted:  # assumed even if the gland was asked for by name
        decided = {key: set() for key in decided}
    if unsaid := [key for key, others in decided.items() if not said & {key, *others}]:
        called = {"housing_diameter": "groove_diameter"} if p.piston else {}
        words = (f"{called.get(key, key)} = {abs(getattr(p, key)):g} mm" for key in unsaid)
        yield f"{kind} ({', '.join(words)})"
    if not said & {"backup", "extrusion_gap"}:
        yield "a back-up ring"


def _kind(p: Gland) -> tuple[str, bool]:
    """A gland in words, and whether it is one of a chart or was given."""
    if not p.gland:
        return "a gland", True
    if p.section == "u_cup":
        return "the gland of a U-cup by rule, its ground half way between heel and lips", False
    if p.section not in (ROUND, "x_ring") or p.outline:
        return f"the gland of an O-ring, as none is known for this {p.named}", False
    if gland(p.section_diameter, p.gland, p.section).by_rule:
        return "a gland in proportions between those of the neighbouring sections", False
    return "its standard gland", True


def _fluids(p: Seal, said: frozenset[str]) -> Iterator[str]:
    """Pressure and oil."""
    if "sealed_pressure" not in said:
        yield f"a sealed pressure of {p.sealed_pressure:g} MPa"
    if not said & {"viscosity", "oil"}:
        yield f"an oil of {1e9 * p.viscosity:.3g} mPa s"
    if p.oil and read_oil_name(p.oil).improved:
        yield f"a viscosity index of {IMPROVED:g}, the least that HVLP oils have (DIN 51524-3)"
