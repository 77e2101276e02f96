"""Messages about a seal before it is run: terms as parsed, assumed values, warnings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from softehl.cases.seal.gland.catalogue import ring, ring_gland
from softehl.cases.seal.gland.grooves import squeeze
from softehl.cases.seal.gland.key_values import value_text
from softehl.cases.seal.gland.oils import DENSITY
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.gland.rubbers import materials
from softehl.cases.seal.gland.rubbers.conditions import (
    NEAR,
    ROOM,
    modulus_at,
    swollen_modulus,
)
from softehl.cases.seal.gland.rubbers.hardness import shore_band, youngs_modulus
from softehl.cases.seal.gland.sections.section_keys import ROUND, dimensions
from softehl.cases.seal.gland.trade.oil_names import (
    IMPROVED,
    POUR,
    OilFamily,
    OilName,
    read_oil_name,
)
from softehl.cases.seal.gland.trade.parse_terms import understood
from softehl.cases.seal.gland.trade.ring_names import read_ring
from softehl.cases.seal.gland.trade.rubber_names import RANGES, read_rubber


def foreword(p: Seal, pressure: float) -> list[str]:
    """Words of the trade as they were understood, and the ratio of pressure to modulus.

    The latter is left out without a pressure, and where `warnings` has it: beyond what is known to
    run. pressure: the largest sealed pressure, MPa.
    """
    load, beyond = _load(p, pressure)
    ratio = [] if beyond or not pressure else [load]
    return [*understood(p.said, piston=p.piston), *_in_service(p), *ratio]


def _in_service(p: Seal) -> Iterator[str]:
    """Swelling and set: what they make of section, modulus and squeeze."""
    if not p.ring or (p.swelling is None and p.compression_set is None):
        return
    new = ring(p.ring).section_diameter
    parts = [
        f"{name.replace('_', ' ')} {value:g} %"
        for name, value in (("swelling", p.swelling), ("compression_set", p.compression_set))
        if value is not None
    ]
    modulus = ""
    if p.swelling is not None and p.shore_A is not None:
        modulus = f", modulus {swollen_modulus(p.swelling):.3g} times that of the new rubber"
    yield (
        f"{' and '.join(parts)}: section {new:.4g} to {p.section_diameter:.4g} mm, squeeze "
        f"{squeeze(new, p.depth):.3g} to {p.squeeze_percent:.3g} %{modulus}"
    )


def warnings(p: Seal, pressure: float) -> list[str]:
    """A pressure above what is known to run, keys without effect, what is unusual, a line each."""
    load, beyond = _load(p, pressure)
    message = "the run may take minutes and end without a film"
    if p.estimable and p.load_ratio(pressure) > HARDEST:
        message = "friction is not known there"
    message += "; a harder rubber or a lower pressure helps"
    first = [f"{load}; {message}"] if beyond else []
    return [*first, *_unused(p), *_unusual(p), *handbook(p)]


def _load(p: Seal, pressure: float) -> tuple[str, bool]:
    """The ratio of pressure to modulus in words, and whether it is above what is known to run."""
    ratio = p.load_ratio(pressure)
    if p.round:
        limit, sound = 3.0, 4.0
        sample = (
            "in a sample of O-rings all films were found at ratios to 4, nine of ten at 4 to 5; "
            "above 5 h* of instrokes is estimated by theory, above 8 that of outstrokes too"
        )
    else:
        limit, sound = 2.0, 2.0
        sample = (
            "in a sample of sections other than round all films were found at ratios to 2, "
            "four of five at 2 to 4, half of them at 4 to 5; nothing was tried above 4.9"
        )
    if ratio <= limit:
        sample = f"all films of a sample were found at ratios to {sound:g}"
    message = f"sealed pressure / shear modulus = {ratio:.2g}: {sample} (docs/limits.md)"
    return message, ratio > limit


HARDEST = 8.0
"""Largest p_s / mu at which films are computed, those of outstrokes."""

# --- warnings -----------------------------------------------------------------------------------

_NEEDS: Mapping[str, tuple[Callable[[Seal], Any], str]] = {
    "temperature": (
        lambda p: p.oil or p.fit or p.modulus_table or p.heating or _by_temperature(p),
        "an oil, a fit, or a rubber by its hardness in the cold",
    ),
    "glass_transition": (lambda p: p.shore_A is not None, "a hardness"),
    "modulus_rule": (lambda p: p.shore_A is not None, "a hardness"),
    "ogden_terms": (lambda p: p.fit, "a fit"),
    "corner_fillet": (lambda p: p.opens, "an extrusion_gap"),
    "cavitation_penalty": (lambda p: not p.conserving, 'cavitation = "penalty"'),
    "asperity_stiffness": (lambda p: p.rough, "a roughness"),
    "boundary_friction": (lambda p: p.rough, "a roughness"),
    "viscosity_slope": (lambda p: p.heating, "heating = true"),
}
"""Key -> whether it has an effect, and what it has none without."""


ALPHAS = 1e-3, 0.06
"""Pressure-viscosity coefficients beyond which no fluid is usual, 1/MPa."""
SWOLLEN = ("EPDM", "IIR", "SBR", "NR")
"""Polymers that are not resistant to mineral oil."""
FASTEST = 15_000.0
"""Largest speed in catalogues of reciprocating seals (filled PTFE), mm/s."""


def _unused(p: Seal) -> Iterator[str]:
    """Keys with a value of their own that change nothing: another one is missing."""
    for key, (used, needed) in _NEEDS.items():
        value = getattr(p, key)
        if value != type(p).model_fields[key].default and not used(p):
            yield f"{key} = {value_text(value)} has no effect without {needed}"


def _unusual(p: Seal) -> Iterator[str]:
    """Its compressibility, and a temperature outside the range of its polymer."""
    stiffness = p.bulk_modulus / p.shear_modulus
    if stiffness < 20.0:  # Poisson's ratio 0.475
        yield (
            f"bulk_modulus = {p.bulk_modulus:g} MPa is {stiffness:.3g} shear moduli: "
            "rubbers have hundreds to thousands"
        )
    alpha = p.pressure_viscosity
    if alpha and not ALPHAS[0] <= alpha <= ALPHAS[1]:
        yield (
            f"pressure_viscosity = {alpha:g} 1/MPa: oils have 0.01 to 0.04, water-glycols about "
            "0.003 (1e-8 1/Pa is 0.01 1/MPa)"
        )
    if p.swelling is not None and p.shore_A is None:
        yield "swelling: the modulus is taken as that of the swollen rubber, not changed by it"
    if p.oil and ((oil := read_oil_name(p.oil)).grade or oil.family):
        yield from _not_resistant(p, oil.family)
    if "speeds" in type(p).model_fields and max(p.speeds) > FASTEST:
        yield (
            f"a speed of {max(p.speeds):g} mm/s: reciprocating seals are used to {FASTEST:g} mm/s"
            f"{'' if p.heating else ', and the heat of the film is left out'}"
        )
    yield from _of_series(p)
    yield from _cold(p)
    used = RANGES[p.polymer] if p.polymer else None
    if used and p.temperature is not None and not used[0] <= p.temperature <= used[1]:
        yield (
            f"temperature = {p.temperature:g} degC: {p.polymer} is used from {used[0]:g} to "
            f"{used[1]:g} degC"
        )


def _not_resistant(p: Seal, family: OilFamily | None) -> Iterator[str]:
    """A polymer that its oil swells or attacks, and a fluid that is too hot."""
    if family is None:
        if p.polymer in SWOLLEN:
            yield f"{p.polymer} swells in mineral oil, and its modulus falls; {p.oil} is one"
        return
    if p.polymer in family.attacks:
        yield f"{p.polymer} does not resist {family.name}, a {family.kind}: it swells or decays"
    if family.highest is not None and (p.temperature or 0.0) > family.highest:
        yield (
            f"temperature = {p.temperature:g} degC: {family.name} fluids are used to "
            f"{family.highest:g} degC"
        )


_STATIC = {
    "G": "rings of the G series are for seals without motion; those for motion are of the P series",
    "V": "rings of the V series are for flanges of vacuum, and have no groove in a cylinder",
    "S": "rings of the slim series are for seals without motion, and the groove is not that of "
    "their maker",
}
"""Series of rings -> what their catalogue says of seals that move."""


def _of_series(p: Gland) -> Iterator[str]:
    """A series of rings that is not made for motion."""
    code = read_ring(p.ring).code if p.ring else None
    if code and (message := _STATIC.get(code[0])):
        yield f"ring = {p.ring}: {message}"


def _cold(p: Seal) -> Iterator[str]:
    """A rubber by its hardness and an oil that are colder than what is known of them."""
    heat = p.temperature
    if heat is None:
        return
    if p.shore_A is not None:
        yield from _cold_rubber(p, heat)
    for part, region in p.materials.items():
        if region.shore_A is not None and heat < 0.0:
            yield (
                f"temperature = {heat:g} degC: materials.{part} has its modulus at room "
                "temperature; give mu at this temperature"
            )
    if p.oil is None:
        return
    name = read_oil_name(p.oil)
    if name.family and not name.points and heat < 0.0:
        yield (
            f"temperature = {heat:g} degC: the viscosity of {p.oil} is extrapolated from 40 and "
            f"100 degC; below its pour point a {name.family.kind} does not flow (see its data "
            "sheet)"
        )
    if name.points and heat < min(0.0, *(at for _, at in name.points)):
        yield (
            f"temperature = {heat:g} degC is below both viscosities of the oil: it is "
            "extrapolated, and below its pour point the oil does not flow (see its data sheet)"
        )
    improved = name.index is not None and name.index >= IMPROVED
    pour = None if name.family else POUR.get((name.grade or 0, improved))
    if pour is not None and heat < pour:
        yield (
            f"temperature = {heat:g} degC: the pour point of {p.oil} may be as high as {pour:g} "
            "degC (DIN 51524); below its pour point an oil does not flow (see its data sheet)"
        )


def _cold_rubber(p: Seal, heat: float) -> Iterator[str]:
    """A rubber by its hardness near its glass transition, or of an unknown one."""
    glass = p.glass
    if glass is None or p.modulus_rule == "constant":
        if heat < 0.0:
            yield (
                f"temperature = {heat:g} degC: the modulus is that of a hardness at room "
                "temperature; rubber is stiffer in the cold; give glass_transition, mu at this "
                "temperature, or tests (fit)"
            )
        return
    if heat < glass + NEAR:
        lower, upper = (_stiffer(p, glass + away) for away in (-3.0, 3.0))
        yield (
            f"temperature = {heat:g} degC is {heat - glass:.0f} K above the glass transition of "
            f"{p.compound or 'the rubber'}, {glass:g} degC: its modulus is "
            f"{_stiffer(p, glass):.2g} times that at room temperature by rule "
            f"({lower:.2g} to {upper:.2g} times if that is known to 3 K), and its damping "
            "is left out; give glass_transition, or measured values (modulus_table)"
        )


def _stiffer(p: Seal, glass: float | None) -> float:
    """Modulus of a hardness at the temperature of the seal over that at room temperature."""
    mu = youngs_modulus(p.shore_A or 0.0, p.polymer) / 3.0
    heat = ROOM if p.temperature is None else p.temperature
    return modulus_at(mu, heat, glass, p.modulus_rule) / mu


def _by_temperature(p: Seal) -> bool:
    """True if the modulus of a hardness is another one at the temperature of the seal."""
    return p.shore_A is not None and _stiffer(p, p.glass) != 1.0


def handbook(p: Gland) -> Iterator[str]:
    """Warnings of handbooks about a ring and its gland."""
    if not 60.0 <= p.fill_percent <= 95.0:
        yield f"the ring fills {p.fill_percent:.0f} % of its gland; handbooks advise 60 to 95 %"
    if p.stretch_percent > 5.0:
        yield (
            f"the ring is stretched by {p.stretch_percent:.1f} % on its "
            f"{'piston' if p.piston else 'rod'}; handbooks advise at most 5 %"
        )


# --- values assumed where keys were not given ---------------------------------------------------


def assumed(p: Seal, set_keys: Collection[str]) -> list[str]:
    """Important values that were not given.  set_keys: the keys that were."""
    keys_set = frozenset(set_keys)
    return [*_ring(p, keys_set), *_gland(p, keys_set), *_fluids(p, keys_set)]


_RUBBER = frozenset(("material", "compound", "shore_A", "modulus_table", "fit", *materials.KEYS))
"""Keys that a rubber is given by."""


def _ring(p: Seal, keys_set: frozenset[str]) -> Iterator[str]:
    """Ring and rubber."""
    if not keys_set & {"ring", "section_diameter", "outline"}:
        yield f"a section of {p.section_diameter:g} mm"
    if p.section != ROUND and not keys_set & set(dimensions(p.section)):
        yield f"the usual proportions of section {p.section}"
    if not keys_set & {"ring", "inner_diameter"}:
        yield f"inner diameter {p.ring_diameter:g} mm"
    ring_name = read_ring(p.ring) if p.ring else None
    if ring_name and ring_name.standard and not keys_set & _RUBBER:
        yield f"a rubber {ring_name.rubber}, as {ring_name.standard} asks for"
    if p.shore_A is not None:
        low, high = shore_band(p.shore_A, p.polymer)
        known = f"by hardness, known to {low:+.0f} and {high:+.0f} %"
        factor, text = _stiffer(p, p.glass), f"a shear modulus of {p.shear_modulus:.3g} MPa"
        if factor == 1.0:
            yield f"{text} {known}"
        else:
            room = f"{p.shear_modulus / factor:.3g} MPa {known}"
            yield f"{text}: {room}, times {factor:.3g} at {p.temperature:g} degC{_by_glass(p)}"
        yield from _hardness(p)
    elif p.energy == "mooney_rivlin" and len(unsaid := {"mu_1", "mu_2"} - keys_set) == 1:
        (name,) = unsaid
        yield f"{name} = {getattr(p, name):g} MPa"
    elif not keys_set & _RUBBER - {"material"}:
        yield f"a rubber of shear modulus {p.shear_modulus:.3g} MPa"


def _hardness(p: Seal) -> Iterator[str]:
    """Another scale than Shore A, and the temperature."""
    rubber = read_rubber("compound", p.compound) if p.compound else None
    if rubber and rubber.hardness_text:
        chart = " (chart of ASTM D2240)" if "D" in rubber.hardness_text.split() else ""
        yield f"{rubber.hardness_text} as {p.shore_A:g} Shore A{chart}"
    if p.temperature is not None and _stiffer(p, p.glass) == 1.0:
        yield f"its modulus at room temperature, not at {p.temperature:g} degC"


def _by_glass(p: Seal) -> str:
    """The glass transition that a modulus follows from, in words."""
    if p.glass is None:
        return ""
    typical = f", typical of {p.polymer}" if p.glass_transition is None else ""
    return f" by a glass transition of {p.glass:g} degC{typical}"


def _gland(p: Gland, keys_set: frozenset[str]) -> Iterator[str]:
    """Rod and groove."""
    if p.ring and read_ring(p.ring).outer is not None:
        keys_set |= {"rod", "housing_diameter", "groove_width"}  # a U-cup is named by its groove
    if not keys_set & {"rod", "rod_diameter", "bore"}:
        yield f"a rod of {p.rod_diameter:g} mm"
    kind, charted = _kind(p)
    decided = {
        "housing_diameter": {"squeeze", "groove_depth", "gland", "groove_diameter"},
        "groove_width": {"fill", "gland"},
    }
    if not charted:  # assumed even if the gland was asked for by name
        decided = {key: set() for key in decided}
    if unsaid := [key for key, others in decided.items() if not keys_set & {key, *others}]:
        texts = (f"{p.called(key)} = {abs(getattr(p, key)):g} mm" for key in unsaid)
        yield f"{kind} ({', '.join(texts)})"
    if not keys_set & {"backup", "extrusion_gap"}:
        yield "a back-up ring"


def _kind(p: Gland) -> tuple[str, bool]:
    """A gland in words, and whether it is one of a chart or was given."""
    if not p.gland:
        return "a gland", True
    if p.section == "u_cup":
        return "the gland of a U-cup by rule, its ground half way between heel and lips", False
    if p.section not in (ROUND, "x_ring") or p.outline:
        return f"the gland of an O-ring, as none is known for this {p.named}", False
    if ring_gland(p.ring, p.section_diameter, p.gland, p.section).by_rule:
        return "a gland in proportions between those of the neighbouring sections", False
    return "its standard gland", True


def _typical(p: Seal, name: OilName, family: OilFamily, keys_set: frozenset[str]) -> Iterator[str]:
    """Values taken from the family of a fluid."""
    texts = []
    if "oil_density" not in keys_set:
        texts.append(f"the density {family.density:g} kg/m3 at 15 degC")
    if name.index is None and not name.points:
        texts.append(
            f"the viscosity index {family.index:g}"
            if family.index is not None
            else "the fall of the viscosity with temperature"
        )
    if not keys_set & {"pressure_viscosity", "roelands"}:
        texts.append(
            f"the pressure-viscosity coefficient {p.pressure_viscosity:.3g} 1/MPa (to a third)"
        )
    if texts:
        yield f"{', '.join(texts)}: typical of a {family.kind}"


def _fluids(p: Seal, keys_set: frozenset[str]) -> Iterator[str]:
    """Pressure and oil."""
    if "sealed_pressure" not in keys_set:
        yield f"a sealed pressure of {p.sealed_pressure:g} MPa"
    if not keys_set & {"viscosity", "oil"}:
        yield f"an oil of {1e9 * p.viscosity:.3g} mPa s"
    name = read_oil_name(p.oil) if p.oil is not None else None
    if name and name.family:
        yield from _typical(p, name, name.family, keys_set)
    elif name and name.points:
        texts = [] if "oil_density" in keys_set else [f"the density {DENSITY:g} kg/m3 at 15 degC"]
        if not keys_set & {"pressure_viscosity", "roelands"}:
            texts.append(f"the pressure-viscosity coefficient {p.pressure_viscosity:.3g} 1/MPa")
        if texts:
            yield f"{' and '.join(texts)}, of a mineral oil"
    elif name and not keys_set & {"pressure_viscosity", "roelands"}:
        yield f"the pressure-viscosity coefficient {p.pressure_viscosity:.3g} 1/MPa (to 15 %)"
    elif "viscosity" in keys_set and not keys_set & {"pressure_viscosity", "roelands"}:
        yield f"a pressure-viscosity coefficient of {p.pressure_viscosity:g} 1/MPa"
    if name and name.improved:
        yield f"a viscosity index of {IMPROVED:g}, the least that HVLP oils have (DIN 51524-3)"
