"""From what a user knows of a rubber to the keys of its material: a hardness, tests, or numbers.

Whatever is given twice must agree; what belongs to another material is an error that names both
keys.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softehl.cases.seal.gland.key_values import number, put, value_text
from softehl.cases.seal.gland.rubbers.conditions import (
    LEAST,
    modulus_at,
    modulus_of_table,
    swollen_modulus,
)
from softehl.cases.seal.gland.rubbers.hardness import shore_range, youngs_modulus
from softehl.cases.seal.gland.rubbers.materials import (
    KEYS,
    MATERIALS,
    RubberMaterial,
    shear_modulus,
)
from softehl.cases.seal.gland.rubbers.rubber_fit import fit, read_data
from softehl.cases.seal.gland.trade.normalise_text import refused
from softehl.cases.seal.gland.trade.rubber_names import GLASS, read_rubber

PAPER = {"mu_1": 3.04, "mu_2": 0.62}
"""Moduli of Table 1 of the paper, MPa."""


def with_rubber(specified: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case with those of its material filled in.

    Raises ValueError where something is missing or contradicts; values of wrong types pass, to be
    refused with their keys.
    """
    values = dict(specified)
    polymer = _with_hardness(values)
    given_by = {
        k: values[k] for k in ("shore_A", "modulus_table", "fit") if values.get(k) is not None
    }
    if len(given_by) > 1:
        (one, first), (other, second) = [*given_by.items()][:2]
        raise ValueError(
            f"{one} = {first!r} and {other} = {second!r} contradict: leave one of them out"
        )
    shore, table = values.get("shore_A"), values.get("fit")
    if values.get("material") is None:
        one_modulus = shore is not None or values.get("modulus_table") is not None
        values["material"] = "neo-hooke" if one_modulus else "mooney-rivlin"
    material = MATERIALS.get(values["material"]) if isinstance(values["material"], str) else None
    if material is None:
        return values
    _require_own(values, material)
    if number(shore):
        _with_shore(values, material, polymer)
    if isinstance(values.get("modulus_table"), str):
        _with_table(values, material, Path(values["modulus_table"]))
    if isinstance(table, str):
        _with_fit(values, material, Path(table))
    if values["material"] == "mooney-rivlin":
        values.update({k: v for k, v in PAPER.items() if values.get(k) is None})
    _require_complete(values, material)
    return values


def _with_hardness(values: dict[str, Any]) -> str | None:
    """The hardness of a rubber that is given by its name, "NBR 70"; returns its polymer."""
    text, polymer = values.get("compound"), None
    if isinstance(text, str):
        rubber = read_rubber("compound", text)
        if rubber is None:
            raise refused("compound", text, "is not understood", "NBR 70", "PU 95", "70 Shore A")
        values["compound"], polymer = rubber.text, rubber.polymer
        put(values, "shore_A", rubber.shore_A, f'compound = "{rubber.text}"')
    shore = values.get("shore_A")
    if isinstance(shore, str):
        raise ValueError(f'shore_A = "{shore}" is not understood; write shore_A = 70 or "NBR 70"')
    low, high = shore_range(polymer)
    if number(shore) and not low <= shore <= high:
        named = f"of {polymer} " if polymer else ""
        others, mu = 'harder ones are polyurethane, "PU 95", or', "15 MPa"
        if shore < low:
            others, mu = "softer ones", "0.2 MPa"
        elif polymer == "PU":
            others = "harder ones"
        raise ValueError(
            f"shore_A = {shore:g}: a hardness {named}gives a modulus from {low:g} to {high:g} "
            f'Shore A; {others} have their modulus given, as in material = "neo-hooke" and '
            f'mu = "{mu}", a third of Young\'s modulus'
        )
    return polymer


def _require_own(values: dict[str, Any], material: RubberMaterial) -> None:
    """No key of another material; those that have a default elsewhere are emptied."""
    source = f'material = "{values["material"]}"'
    for key in ("shore_A", "modulus_table"):
        if (specified := values.get(key)) is None:
            continue
        if "mu" not in material.keys:
            names = ", ".join(f'"{n}"' for n, m in MATERIALS.items() if "mu" in m.keys)
            one = "a hardness" if key == "shore_A" else "it"
            raise ValueError(
                f"{key} = {specified} and {source} contradict: {one} gives one modulus; "
                f"allowed are {names}"
            )
        source = f"{key} = {specified} ({source})"
    for key in KEYS:
        if key in material.keys:
            continue
        if values.get(key) is not None:
            own_keys = " and ".join(material.keys)
            raise ValueError(
                f"{key} = {value_text(values[key])} and {source} contradict: it has {own_keys}; "
                "leave one of them out"
            )
        values[key] = None


def _with_shore(values: dict[str, Any], material: RubberMaterial, polymer: str | None) -> None:
    """The modulus of a hardness, at the temperature of the seal and as far as it has swollen."""
    mu = youngs_modulus(float(values["shore_A"]), polymer) / 3.0
    heat, rule, swelling = (values.get(k) for k in ("temperature", "modulus_rule", "swelling"))
    glass = values.get("glass_transition")
    if glass is None:
        glass = GLASS.get(polymer or "")
    if number(heat) and (glass is None or number(glass)):
        if rule != "constant" and glass is not None and heat < glass + LEAST:
            typical = ", typical of its polymer" if values.get("glass_transition") is None else ""
            raise ValueError(
                f"temperature = {heat:g} degC: {values.get('compound') or 'the rubber'} becomes a "
                f"glass at {glass:g} degC{typical}, and its hardness says nothing of it below "
                f"{glass + LEAST:g} degC; for a compound for the cold give its glass_transition, "
                'or its modulus at this temperature, as in material = "neo-hooke" and mu = "15 MPa"'
            )
        mu = modulus_at(mu, heat, glass, rule)
    if number(swelling) and swelling > -100.0:
        mu *= swollen_modulus(swelling)
    _put_modulus(values, material, mu, f"shore_A = {values['shore_A']:g}")


def _with_table(values: dict[str, Any], material: RubberMaterial, path: Path) -> None:
    """The modulus of a table at the temperature of the seal."""
    if not number(heat := values.get("temperature")):
        raise ValueError(f'modulus_table = "{path}" needs the temperature of the seal')
    _put_modulus(values, material, modulus_of_table(path, heat), f'modulus_table = "{path}"')


def _put_modulus(values: dict[str, Any], material: RubberMaterial, mu: float, source: str) -> None:
    """The key mu of a material by its shear modulus, MPa."""
    if all(number(values.get(key)) for key in material.keys if key != "mu"):
        put(values, "mu", mu / shear_modulus(material, {**values, "mu": 1.0}), source)


def _with_fit(values: dict[str, Any], material: RubberMaterial, path: Path) -> None:
    name, terms, heat = values["material"], values.get("ogden_terms"), values.get("temperature")
    terms = terms if isinstance(terms, int) and 1 <= terms <= 3 else 3
    result = fit(name, read_data(path), terms, float(heat) if number(heat) else None)
    if result.unstable:
        test, stretch = result.unstable
        raise ValueError(
            f'fit = "{path}": material = "{name}" fitted to these tests is not stable in {test} '
            f"tension at a stretch of {stretch:.3g}; take another material or more tests"
        )
    for key, value in result.values.items():
        # a fit of another version or machine agrees to about 1e-5
        put(values, key, value, f'fit = "{path}"', within=1e-3)


def _require_complete(values: dict[str, Any], material: RubberMaterial) -> None:
    missing = [key for key in material.keys if values.get(key) is None]
    if missing:
        other = ", or shore_A" if missing == ["mu"] else ""
        raise ValueError(
            f'material = "{values["material"]}" needs {" and ".join(missing)}{other}, '
            'or fit = "tests.csv"'
        )
