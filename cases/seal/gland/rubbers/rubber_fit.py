"""Fit of a rubber: tests from a table, and the parameters of a material that fit them.

The table is a CSV file with the columns `test` (uniaxial, biaxial or shear, which is planar
tension), `stretch` and `stress_MPa` (nominal), and `temperature_degC` where there are several.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.seal.gland.key_values import times
from softehl.cases.seal.gland.rubbers.materials import (
    MATERIALS,
    MODULI,
    SECOND,
    TERMS,
    nominal_stress,
    strains,
    stress_by,
    unstable_at,
)
from softehl.cases.seal.gland.tables import reading
from softehl.runtime.arrays import Array

COLUMNS = ("test", "stretch", "stress_MPa")
TEMPERATURE = "temperature_degC"


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
        return strains(self.test, self.stretch)

    @property
    def temperatures(self) -> list[float]:
        """The temperatures of the table, rising; empty if it has none."""
        return sorted(set(self.temperature[np.isfinite(self.temperature)].tolist()))

    def part(self, selection: Array) -> RubberData:
        """Some of the points."""
        points = self.test, self.stretch, self.stress, self.temperature
        return RubberData(*(of_all[selection] for of_all in points))


def read_data(path: Path) -> RubberData:
    """The tests in a table.  Raises ValueError, which names the line."""
    with reading(path):
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        rows = [
            (number, row)
            for number, row in enumerate(csv.reader(lines), 1)
            if row and not row[0].lstrip().startswith("#")
        ]
        header = [name.strip() for name in rows[0][1]] if rows else []
        if not set(COLUMNS) <= set(header):
            raise ValueError(f"its first line must name the columns {', '.join(COLUMNS)}")
        points = [_point(n, dict(zip(header, row, strict=False))) for n, row in rows[1:]]
        if not points:
            raise ValueError("it holds no test; write a line for each measured point")
    test, *numbers = zip(*points, strict=True)
    return RubberData(np.array(test), *(np.array(column, dtype=np.float64) for column in numbers))


def _point(line: int, row: Mapping[str, str]) -> tuple[str, float, float, float]:
    test = row.get("test", "").strip()
    if test not in SECOND:
        raise ValueError(f"line {line}: test = {test!r}; allowed are {', '.join(SECOND)}")
    stretch, stress = (_number(line, row, name) for name in COLUMNS[1:])
    if not stretch > 0.0:
        raise ValueError(
            f"line {line}: stretch = {stretch:g}; a stretch is length over unloaded length, > 0 "
            "(a strain of 10 % is a stretch of 1.1)"
        )
    heat = _number(line, row, TEMPERATURE) if row.get(TEMPERATURE, "").strip() else np.nan
    return test, stretch, stress, heat


def _number(line: int, row: Mapping[str, str], name: str) -> float:
    text = row.get(name, "").strip()
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"line {line}: {name} = {text!r} is no number") from None
    if not np.isfinite(value):
        raise ValueError(f"line {line}: {name} = {text} is not finite")
    return value


@dataclass(frozen=True, eq=False)
class RubberFit:
    """A material fitted to tests.

    values: of its keys, at the temperature that was asked for. model: (n,) its nominal stress at
    the points, at the temperature of each, MPa. unstable: as `unstable_at`, also within the
    stretches of the data.
    """

    material: str
    data: RubberData
    values: Mapping[str, Any]
    model: Array
    unstable: tuple[str, float] | None

    @property
    def error(self) -> float:
        """Root of the mean square of the differences, MPa."""
        return float(np.sqrt(np.mean((self.model - self.data.stress) ** 2)))

    @property
    def quality(self) -> float:
        """R^2: 1 less squares of the differences over those of the stresses about their mean."""
        return 1.0 - self.error**2 / float(self.data.stress.var())


def fit(
    name: str, data: RubberData, terms: int = TERMS, temperature: float | None = None
) -> RubberFit:
    """The parameters of a material by least squares of the nominal stresses, all points alike.

    terms: of Ogden's energy. temperature: at which the moduli are wanted, degC. Raises ValueError
    where the points are too few or the temperature is outside those of the data.
    """
    material, heats = MATERIALS[name], data.temperatures
    if heats and temperature is None and len(heats) > 1:
        heats_text = ", ".join(f"{heat:g}" for heat in heats)
        raise ValueError(f"the tests are at {heats_text} degC: give the temperature of the seal")
    counts = [int((data.temperature == heat).sum()) for heat in heats]
    base = data.part(data.temperature == heats[int(np.argmax(counts))]) if heats else data
    required = 2 * terms if name == "ogden" else len(material.keys)
    if len(base.stretch) < required + 1:
        raise ValueError(
            f"{len(base.stretch)} points are too few for the {required} parameters of {name}"
        )
    parameters = _fitted(name, base, terms)
    values = material.kernel_values(parameters)
    model = nominal_stress(material, values, data.strains, data.stretch)
    factors: dict[float, float] = {}  # on all stresses, 1 where the shape was fitted
    for heat in heats:
        at = data.temperature == heat
        factors[heat] = float(model[at] @ data.stress[at] / (model[at] @ model[at]))
        model[at] *= factors[heat]
    if factors:
        factor = _factor(factors, temperature)
        parameters |= {k: times(v, factor) for k, v in parameters.items() if k in MODULI}
    tested = {test: data.stretch[data.test == test] for test in set(data.test.tolist())}
    limits = {test: (float(at.min()), float(at.max())) for test, at in tested.items()}
    instability = unstable_at(material, material.kernel_values(parameters), limits)
    return RubberFit(name, data, parameters, model, instability)


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


# --- least squares --------------------------------------------------------------------------------


def _fitted(name: str, data: RubberData, terms: int) -> dict[str, Any]:
    """The keys of a material with the least squares, the best of several starts."""
    from scipy.optimize import least_squares

    material, e, stretch = MATERIALS[name], data.strains, data.stretch
    starts, limits = _starts(name, data, terms)
    bounds = limits[:, 0], limits[:, 1]
    if name == "ogden":
        names = [f"{letter}_{k + 1}" for letter in ("mu", "alpha") for k in range(terms)]
    else:  # the kernel of neo-hooke has a modulus more, which is 0
        names = list(material.kernel_values(dict.fromkeys(material.keys, 1.0)))[: len(limits)]

    def keys_of(x: Array) -> dict[str, Any]:
        numbers = tuple(map(float, x))
        if name == "ogden":
            return {"ogden_mu": numbers[:terms], "ogden_alpha": numbers[terms:]}
        return dict(zip(material.keys, numbers, strict=True))

    def residual(x: Array) -> Array:
        values = material.kernel_values(keys_of(x))
        return nominal_stress(material, values, e, stretch) - data.stress

    def jacobian(x: Array) -> Array:
        values = material.kernel_values(keys_of(x))
        return np.stack([stress_by(material, n, values, e, stretch) for n in names], axis=1)

    fits = (
        least_squares(residual, start, jacobian, bounds, x_scale="jac", max_nfev=2000)
        for start in starts
    )
    return keys_of(min(fits, key=lambda one: one.cost).x)


def _starts(name: str, data: RubberData, terms: int) -> tuple[Array, Array]:
    """Starts (starts, n) of fits, and the limits (n, 2) of their parameters.

    The first exponents are Ogden's of 1972; at an exponent of 0 a term has no stress, and with
    mu alpha >= 0 it is stable at every stretch.
    """
    if name == "ogden":
        alpha = np.array([(1.3, 5.0, -2.0), (2.0, 8.0, -1.0), (0.6, 3.0, -4.0)])[:, :terms]
        bounds = [np.outer(np.sign(alpha[0]), sizes) for sizes in ((0.0, np.inf), (0.05, 20.0))]
        mu = 0.25 ** np.arange(terms) / alpha
        return np.hstack([mu, alpha]), np.sort(np.vstack(bounds), axis=1)
    if name in ("gent", "arruda-boyce"):  # J_m above all I1 - 3 of the data, lambda_m above 1
        squares = np.exp(2.0 * data.strains)
        first = float((squares.sum(axis=1) + 1.0 / squares.prod(axis=1)).max()) - 3.0
        lower = 1.001 * (first if name == "gent" else 1.0)
        starts = [(1.0, part * lower) for part in (1.1, 2.0, 10.0)]
        return np.array(starts), np.array([(0.0, np.inf), (lower, np.inf)])
    count = len(MATERIALS[name].keys)
    return np.ones((1, count)), np.array([(-np.inf if name == "yeoh" else 0.0, np.inf)] * count)
