"""Tests of a rubber from a table, and the parameters of a material that fit them.

The table is a CSV file with the columns `test` (uniaxial, biaxial or shear, which is planar
tension), `stretch` and `stress_MPa` (nominal), and `temperature_degC` where there are several.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.seal.gland.given import times
from softehl.cases.seal.gland.rubbers.materials import (
    MATERIALS,
    SECOND,
    TERMS,
    Material,
    nominal_stress,
    stress_by,
    unstable_at,
)
from softehl.runtime.arrays import Array

COLUMNS = ("test", "stretch", "stress_MPa")
TEMPERATURE = "temperature_degC"
_LARGEST = 1 << 20  # bytes of a table; tests of a rubber have some 10 kB


@dataclass(frozen=True, eq=False)
class RubberData:
    """Measured points, arrays (n,): kind of test, stretch, nominal stress (MPa), temperature.

    temperature: in degC, nan where the table has none.
    """

    test: Array
    stretch: Array
    stress: Array
    temperature: Array

    @property
    def strains(self) -> Array:
        """Principal logarithmic strains (n, 2)."""
        second = np.array([SECOND[test] for test in self.test])
        along = np.log(self.stretch)
        return np.stack([along, second * along], axis=1)

    @property
    def temperatures(self) -> list[float]:
        """The temperatures of the table, rising; empty if it has none."""
        return sorted(set(self.temperature[np.isfinite(self.temperature)].tolist()))

    def part(self, chosen: Array) -> RubberData:
        """Some of the points."""
        return RubberData(*(getattr(self, f)[chosen] for f in _FIELDS))


_FIELDS = ("test", "stretch", "stress", "temperature")


def read_data(path: Path) -> RubberData:
    """The tests in a table.  Raises ValueError, which names the line."""
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"{path} is no table of tests: it has more than 1 MB")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise ValueError(f"{path} cannot be read: {reason}") from None
    rows = [
        (number, row)
        for number, row in enumerate(csv.reader(lines), 1)
        if row and not row[0].lstrip().startswith("#")
    ]
    header = [name.strip() for name in rows[0][1]] if rows else []
    if not set(COLUMNS) <= set(header):
        raise ValueError(f"{path}: its first line must name the columns {', '.join(COLUMNS)}")
    points = [
        _point(f"{path}, line {n}", dict(zip(header, row, strict=False))) for n, row in rows[1:]
    ]
    if not points:
        raise ValueError(f"{path} holds no test; write a line for each measured point")
    test, *numbers = zip(*points, strict=True)
    return RubberData(np.array(test), *(np.array(column, dtype=np.float64) for column in numbers))


def _point(where: str, row: Mapping[str, str]) -> tuple[str, float, float, float]:
    test = row.get("test", "").strip()
    if test not in SECOND:
        raise ValueError(f"{where}: test = {test!r}; allowed are {', '.join(SECOND)}")
    stretch, stress = (_number(where, row, name) for name in COLUMNS[1:])
    if not stretch > 0.0:
        raise ValueError(
            f"{where}: stretch = {stretch:g}; a stretch is length over unloaded length, > 0 "
            "(a strain of 10 % is a stretch of 1.1)"
        )
    heat = _number(where, row, TEMPERATURE) if row.get(TEMPERATURE, "").strip() else np.nan
    return test, stretch, stress, heat


def _number(where: str, row: Mapping[str, str], name: str) -> float:
    text = row.get(name, "").strip()
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{where}: {name} = {text!r} is no number") from None
    if not np.isfinite(value):
        raise ValueError(f"{where}: {name} = {text} is not finite")
    return value


@dataclass(frozen=True, eq=False)
class Fit:
    """A material fitted to tests.

    values: of its keys, at the temperature that was asked for. model: (n,) its nominal stress at
    the points, at the temperature of each, MPa. factors: temperature (degC) -> factor on all
    stresses, 1 where the shape was fitted; empty without temperatures. unstable: as `unstable_at`,
    also within the stretches of the data.
    """

    material: str
    data: RubberData
    values: Mapping[str, Any]
    model: Array
    factors: Mapping[float, float]
    unstable: tuple[str, float] | None

    @property
    def error(self) -> float:
        """Root of the mean square of the differences, MPa."""
        return float(np.sqrt(np.mean((self.model - self.data.stress) ** 2)))

    @property
    def quality(self) -> float:
        """R^2: 1 less squares of the differences over those of the stresses about their mean."""
        spread = self.data.stress - self.data.stress.mean()
        return float(1.0 - np.sum((self.model - self.data.stress) ** 2) / np.sum(spread**2))


def fit(name: str, data: RubberData, terms: int = TERMS, temperature: float | None = None) -> Fit:
    """The parameters of a material by least squares of the nominal stresses, all points alike.

    terms: of Ogden's energy. temperature: at which the moduli are wanted, degC. Raises ValueError
    where the points are too few or the temperature is outside those of the data.
    """
    material, heats = MATERIALS[name], data.temperatures
    if heats and temperature is None and len(heats) > 1:
        raise ValueError(
            f"the tests are at {_listed(heats)} degC: give the temperature of the seal"
        )
    counts = [int((data.temperature == heat).sum()) for heat in heats]
    base = data.part(data.temperature == heats[int(np.argmax(counts))]) if heats else data
    wanted = 2 * terms if name == "ogden" else len(material.keys)
    if len(base.stretch) < wanted + 1:
        raise ValueError(
            f"{len(base.stretch)} points are too few for the {wanted} parameters of {name}"
        )
    given = _SOLVERS[name](material, base, terms)
    values = material.kernel_values(given)
    model = nominal_stress(material, values, data.strains, data.stretch)
    factors: dict[float, float] = {}
    for heat in heats:
        at = data.temperature == heat
        factors[heat] = float(model[at] @ data.stress[at] / (model[at] @ model[at]))
        model[at] *= factors[heat]
    if factors:
        given = _scaled(material, given, _factor(factors, temperature))
    tested = {test: data.stretch[data.test == test] for test in set(data.test.tolist())}
    limits = {test: (float(at.min()), float(at.max())) for test, at in tested.items()}
    found = unstable_at(material, material.kernel_values(given), limits)
    return Fit(name, data, given, model, factors, found)


def _factor(factors: Mapping[float, float], temperature: float | None) -> float:
    """Linear between the temperatures of the tests."""
    heats = sorted(factors)
    at = heats[0] if temperature is None else temperature
    if temperature is not None and not heats[0] <= at <= heats[-1]:
        raise ValueError(
            f"temperature = {at:g} degC is outside those of the tests, {heats[0]:g} to "
            f"{heats[-1]:g} degC; nothing is extrapolated"
        )
    return float(np.interp(at, heats, [factors[heat] for heat in heats]))


def _scaled(material: Material, given: Mapping[str, Any], factor: float) -> dict[str, Any]:
    return {k: times(v, factor) if k in material.moduli else v for k, v in given.items()}


def _listed(numbers: list[float]) -> str:
    return ", ".join(f"{n:g}" for n in numbers)


# --- least squares --------------------------------------------------------------------------------


def _linear(material: Material, data: RubberData, _: int) -> dict[str, Any]:
    """Energies that are linear in their parameters; moduli of Mooney-Rivlin are not negative."""
    from scipy.optimize import lsq_linear

    names = material.kernel_values(dict.fromkeys(material.keys, 1.0))
    names = {n: v for n, v in names.items() if v == 1.0}
    e, stretch = data.strains, data.stretch
    zero = dict.fromkeys(material.sheet.parameters, 0.0)
    columns = [stress_by(material, n, zero, e, stretch) for n in names]
    lower = -np.inf if material.energy == "yeoh" else 0.0
    found = lsq_linear(np.stack(columns, axis=1), data.stress, (lower, np.inf))
    return dict(zip(material.keys, map(float, found.x), strict=True))


def _locking(material: Material, data: RubberData, _: int) -> dict[str, Any]:
    """A modulus and what locks the chains: J_m above all I1 - 3 of the data, or lambda_m > 1."""
    from scipy.optimize import least_squares

    squares = np.exp(2.0 * data.strains)
    first = float((squares.sum(axis=1) + 1.0 / squares.prod(axis=1)).max()) - 3.0
    least = 1.001 * first if material.energy == "gent" else 1.001
    names = material.keys
    residual, slopes = _problem(material, data, lambda x: dict(zip(names, x, strict=True)))
    best = min(
        (
            least_squares(residual, (1.0, c * least), slopes, ((1e-6, least), (np.inf, np.inf)))
            for c in (1.1, 2.0, 10.0)
        ),
        key=lambda found: found.cost,
    )
    return dict(zip(names, map(float, best.x), strict=True))


_EXPONENTS = ((1.3, 5.0, -2.0), (2.0, 8.0, -1.0), (0.6, 3.0, -4.0))
"""Exponents alpha of three terms with which fits are begun: the first are Ogden's of 1972; the best
of the three fits counts."""

_BOUNDS = ((0.05, 20.0), (0.05, 20.0), (-20.0, -0.05))
"""Least and largest exponent of each term; at 0 a term has no stress."""


def _ogden(material: Material, data: RubberData, terms: int) -> dict[str, Any]:
    """Ogden's terms with mu alpha >= 0, which makes each of them stable at every stretch."""
    from scipy.optimize import least_squares

    def values(x: Array) -> dict[str, float]:
        g, alpha = x[:terms], x[terms:]
        return material.kernel_values({"ogden_mu": list(g / alpha), "ogden_alpha": list(alpha)})

    plain, slopes_of = _problem(material, data, values)

    def slopes(x: Array) -> Array:
        g, alpha = x[:terms], x[terms:]
        by = slopes_of(x)
        by_mu, by_alpha = by[:, 0 : 2 * terms : 2], by[:, 1 : 2 * terms : 2]
        return np.hstack([by_mu / alpha, by_alpha - by_mu * g / alpha**2])

    lower = [0.0] * terms + [low for low, _ in _BOUNDS[:terms]]
    upper = [np.inf] * terms + [high for _, high in _BOUNDS[:terms]]
    found = [
        least_squares(
            plain,
            [1.0 / 4**k for k in range(terms)] + list(start[:terms]),
            slopes,
            (lower, upper),
            x_scale="jac",
            max_nfev=2000,
        )
        for start in _EXPONENTS
    ]
    best = min(found, key=lambda one: one.cost).x
    mu = tuple(map(float, best[:terms] / best[terms:]))
    return {"ogden_mu": mu, "ogden_alpha": tuple(map(float, best[terms:]))}


def _problem(
    material: Material, data: RubberData, values: Callable[[Array], Mapping[str, float]]
) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Differences (n,) of the stresses, and their derivatives by the parameters of the kernel."""
    e, stretch = data.strains, data.stretch

    def residual(x: Array) -> Array:
        return nominal_stress(material, values(x), e, stretch) - data.stress

    def slopes(x: Array) -> Array:
        at = values(x)
        return np.stack([stress_by(material, n, at, e, stretch) for n in at], axis=1)

    return residual, slopes


_SOLVERS: dict[str, Callable[[Material, RubberData, int], dict[str, Any]]] = {
    "mooney-rivlin": _linear,
    "neo-hooke": _linear,
    "yeoh": _linear,
    "ogden": _ogden,
    "arruda-boyce": _locking,
    "gent": _locking,
}
