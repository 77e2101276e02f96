"""Export for simulations of systems: friction and leakage over speed and pressure.

Tables for Modelica (CombiTable2Ds) and as CSV, and the numbers of the friction law that cylinders
of Simscape have, fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array
from softehl.runtime.io import write_csv, write_text

FILES = ("seal.csv", "seal_modelica.txt", "cylinder_friction.txt")
HEADER = ("sealed_pressure_MPa", "rod_speed_mm_s", "friction_N", "leakage_mm3_s")


@dataclass(frozen=True, eq=False)
class SealMap:
    """Friction (N) and leakage (mm^3/s) at speeds (mm/s, + = outstroke) and pressures (MPa).

    friction, leakage: (speeds, pressures). left_out: speeds at which not every pressure has a
    film with its friction, in words.
    """

    speeds: Array
    pressures: Array
    friction: Array
    leakage: Array
    left_out: str = ""

    def stroke(self, sign: float) -> SealMap:
        """The part of one stroke: 1 out, -1 in."""
        selected = sign * self.speeds > 0.0
        return SealMap(
            self.speeds[selected], self.pressures, self.friction[selected], self.leakage[selected]
        )

    @classmethod
    def of(cls, runs: Sequence[FinishedRun]) -> SealMap:
        """The films of runs of one seal, at the speeds that all pressures have.  BadInput."""
        _require_one_seal(runs)
        rows = [row for run in runs for row in run.rows]
        pressures = sorted({row.sealed_pressure_MPa for row in rows})
        requested = sorted({row.rod_speed_mm_s for row in rows})
        rows_by_point: dict[tuple[float, float], FilmRow] = {
            (row.rod_speed_mm_s, row.sealed_pressure_MPa): row
            for row in rows
            if isfinite(row.rod_friction_N)  # that of an estimated state is not known
        }
        speeds = [u for u in requested if all((u, p) in rows_by_point for p in pressures)]
        if not speeds:
            raise BadInput(
                "no speed has a film with its friction at every sealed pressure: give runs of the "
                "same speeds, without states that are estimated"
            )
        lacking = [f"{u:+g} mm/s" for u in requested if u not in speeds]
        friction, leakage = (
            np.array([[getattr(rows_by_point[u, p], name) for p in pressures] for u in speeds])
            for name in ("rod_friction_N", "leak_rate_mm3_s")
        )
        return cls(np.array(speeds), np.array(pressures), friction, leakage, ", ".join(lacking))


def fading(speed: Array, more: float, rate: float) -> Array:
    """(1 + (K - 1) exp(-c |v|)) sign v of "Cylinder Friction"; more: K - 1, rate: c, s/mm."""
    return np.asarray((1.0 + more * np.exp(-rate * np.abs(speed))) * np.sign(speed))


def humped(speed: Array, more: float, rate: float) -> Array:
    """Fading of "Cylinder Friction (IL)", smooth at rest; rate: 1 / breakaway speed, s/mm."""
    v = rate * speed / np.sqrt(2.0)
    return np.asarray(
        more * np.exp(0.5) * np.sqrt(2.0) * v * np.exp(-(v**2)) + np.tanh(10.0 * rate * speed)
    )


BLOCKS = {"Cylinder Friction": fading, "Cylinder Friction (IL)": humped}
"""Blocks of Simscape -> how friction fades with the speed."""


@dataclass(frozen=True)
class FrictionLaw:
    """F = (F_pr + f_c p) fade(v) + f_v v.

    block: whose law it is. preload: F_pr, N. coulomb: f_c, N/MPa. breakaway: K, friction at rest
    over that of Coulomb. rate: of fading, s/mm. viscous: f_v, N s/mm. misfit: largest, in parts of
    the friction.
    """

    block: str
    preload: float
    coulomb: float
    breakaway: float
    rate: float
    viscous: float
    misfit: float

    def friction(self, speed: Array, pressure: Array) -> Array:
        """Friction (N) at speeds (mm/s) and pressures (MPa)."""
        fade = BLOCKS[self.block](speed, self.breakaway - 1.0, self.rate)
        return np.asarray((self.preload + self.coulomb * pressure) * fade + self.viscous * speed)

    @property
    def numbers(self) -> dict[str, tuple[float, str]]:
        """Numbers that the block asks for, in SI units."""
        block_numbers = {
            "Cylinder Friction": {
                "Breakaway friction increase coefficient": (self.breakaway, ""),
                "Transition coefficient": (1e3 * self.rate, "s/m"),
            },
            "Cylinder Friction (IL)": {
                "Breakaway to Coulomb friction force ratio": (self.breakaway, ""),
                "Breakaway friction velocity": (1e-3 / self.rate, "m/s"),
            },
        }
        return {
            "Preload force": (self.preload, "N"),
            "Coulomb friction coefficient": (1e-6 * self.coulomb, "N/Pa"),
            **block_numbers[self.block],
            "Viscous friction coefficient": (1e3 * self.viscous, "N/(m/s)"),
            "largest misfit": (100.0 * self.misfit, "%"),
        }

    @classmethod
    def fitted(cls, seal: SealMap, block: str) -> FrictionLaw | None:
        """The law nearest to the films, None where they are too few: least squares of parts.

        From starts with and without a breakaway, that fades over 3 to 300 mm/s: some end elsewhere.
        """
        u, p = (a.ravel() for a in np.meshgrid(seal.speeds, seal.pressures, indexing="ij"))
        force = seal.friction.ravel()
        if len(force) < 5 or len(set(np.abs(u))) < 2:  # the law has as many numbers
            return None
        one = len(seal.pressures) == 1

        def law(x: Array, misfit: float = 0.0) -> FrictionLaw:
            preload, coulomb, more, rate, viscous = (float(v) for v in x)
            return cls(block, preload, 0.0 if one else coulomb, 1.0 + more, rate, viscous, misfit)

        def parts(x: Array) -> Array:
            return law(x).friction(u, p) / force - 1.0

        size, fast = float(np.abs(force).mean()), float(np.abs(u).max())
        bounds = [0.0, 0.0, 0.0, 1e-4, 0.0], [np.inf, np.inf, 100.0, 100.0, np.inf]
        scale = size, size, 1.0, 0.1, size / fast
        fits = [
            least_squares(
                parts, (size, 0.0, more, rate, 0.1 * size / fast), bounds=bounds, x_scale=scale
            )
            for rate in (0.003, 0.01, 0.03, 0.1, 0.3)
            for more in (0.0, 1.0)
        ]
        best = min(fits, key=lambda fit: float(fit.cost)).x
        return law(best, float(np.abs(parts(best)).max()))


def write_hand_over(folder: Path, runs: Sequence[FinishedRun]) -> list[str]:
    """Write FILES; what is to be said of them, in lines.  Raises BadInput, OSError."""
    seal = SealMap.of(runs)
    folder.mkdir(parents=True, exist_ok=True)
    rows = [
        (p, u, seal.friction[i, k], seal.leakage[i, k])
        for k, p in enumerate(seal.pressures)
        for i, u in enumerate(seal.speeds)
    ]
    write_csv(folder / FILES[0], HEADER, rows)
    write_text(folder / FILES[1], modelica(seal))
    laws = friction_laws(seal)
    title = runs[0].case.titled(runs[0].parameters)
    write_text(folder / FILES[2], simscape(laws, title))
    sizes = (len(seal.speeds), "speed"), (len(seal.pressures), "pressure")
    counts = " at ".join(f"{count} {what}{'s' * (count != 1)}" for count, what in sizes)
    lines = [f"{counts} written to {folder}: {', '.join(FILES)}"]
    if seal.left_out:
        lines.append(f"left out, as not every pressure has their friction: {seal.left_out}")
    if not laws:
        lines.append("no friction law: a fit needs 5 films at two speeds |U| or more")
    for name, law in laws.items():
        lines.append(f"{name}: within {100.0 * law.misfit:.2g} % of every film")
    doubtful = sum(row.verdict != "ok" for run in runs for row in run.rows)
    return [*lines, f"films with a verdict other than ok: {doubtful}"] if doubtful else lines


def modelica(seal: SealMap) -> str:
    """Text of tables for CombiTable2Ds, in SI units: u1 is the speed, u2 the sealed pressure."""
    shape = f"({len(seal.speeds) + 1},{len(seal.pressures) + 1})"
    tables = {"friction": ("N", seal.friction), "leakage": ("m3/s", 1e-9 * seal.leakage)}
    lines = ["#1"]
    for name, (unit, values) in tables.items():
        lines.append(f"double {name}{shape} # [{unit}] over rod speed [m/s] and pressure [Pa]")
        head, speeds = [0.0, *(1e6 * seal.pressures)], 1e-3 * seal.speeds
        rows = [head, *([u, *row] for u, row in zip(speeds, values, strict=True))]
        lines += [" ".join(f"{v:.9g}" for v in row) for row in rows]
    return "\n".join([*lines, ""])


def simscape(laws: Mapping[str, FrictionLaw], title: str) -> str:
    """The numbers of friction laws in words and SI units."""
    lines = [title, "Fitted to the films; p is the sealed pressure, the other chamber has none."]
    for stroke, law in laws.items():
        lines += ["", stroke]
        numbers = law.numbers.items()
        lines += [f"{name} = {v:.6g} {unit}".rstrip() for name, (v, unit) in numbers]
    return "\n".join([*(lines if laws else [*lines, "too few films for a fit"]), ""])


def friction_laws(seal: SealMap) -> dict[str, FrictionLaw]:
    """The law of each block for both strokes, and for each alone where there are enough films."""
    parts = {"both strokes": seal, "outstroke": seal.stroke(1.0), "instroke": seal.stroke(-1.0)}
    laws = {
        f"{block}, {name}": FrictionLaw.fitted(part, block)
        for name, part in parts.items()
        for block in BLOCKS
    }
    return {name: law for name, law in laws.items() if law is not None}


def _require_one_seal(runs: Sequence[FinishedRun]) -> None:
    """Raises BadInput unless runs are of one seal but for its pressure and its motion."""
    first, free = runs[0], {"sealed_pressure", *runs[0].case.selection}
    for run in runs:
        if type(run.parameters) is not Seal:
            raise BadInput(f"{run.folder} is no curve of a seal; allowed: runs of oring")
        one, other = first.parameters.settled(), run.parameters.settled()
        differing = [k for k, v in one.items() if k not in free and other[k] != v]
        if differing:
            raise BadInput(
                f"{first.folder} and {run.folder} differ in {', '.join(differing)}; allowed: runs "
                "of one seal at several pressures and speeds"
            )
