"""Rubbers: parameters of a material, its kernels, its shear modulus and its stable stretches.

The energies are in `codegen/language/energies.py`. Each has a kernel of the solid, and one of a
sheet (`codegen/models/biaxial_sheet.py`), an incompressible unit volume at principal logarithmic
strains. Stresses of tests, moduli and stability come from the sheet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import log
from typing import Any, Literal

import numpy as np

from softehl.runtime.arrays import Array, Flags
from softehl.runtime.kernels.kernel import Kernel, load_kernel

Name = Literal["mooney-rivlin", "neo-hooke", "yeoh", "ogden", "arruda-boyce", "gent"]
Values = Mapping[str, float]

TERMS = 3
"""Terms of the Ogden kernel."""

RANGE = (0.6, 1.6)
"""Stretches between which a rubber of a seal must be stable."""


@dataclass(frozen=True)
class RubberMaterial:
    """A material: its keys in a case, and the energy of its kernels."""

    energy: str
    keys: tuple[str, ...]

    @property
    def sheet(self) -> Kernel:
        """Its kernel of a sheet."""
        return load_kernel(f"sheet_{self.energy}")

    def kernel_values(self, parameters: Mapping[str, Any]) -> dict[str, float]:
        """Parameters of its kernels (without the bulk modulus) from the keys of a case."""
        values = {key: parameters[key] for key in self.keys}
        if "ogden_mu" in values:
            return _ogden(values["ogden_mu"], values["ogden_alpha"])
        if self.energy == "mooney_rivlin":
            return {"mu_1": values.get("mu_1", values.get("mu")), "mu_2": values.get("mu_2", 0.0)}
        names = {"c_10": "c_1", "c_20": "c_2", "c_30": "c_3"}
        return {names.get(key, key): value for key, value in values.items()}


def _ogden(mu: Sequence[float], alpha: Sequence[float]) -> dict[str, float]:
    """Terms that are not there have no modulus."""
    missing = TERMS - len(mu)
    pairs = zip([*mu, *[0.0] * missing], [*alpha, *[2.0] * missing], strict=True)
    return {
        name: value
        for k, (m, a) in enumerate(pairs, 1)
        for name, value in ((f"mu_{k}", m), (f"alpha_{k}", a))
    }


MATERIALS: dict[str, RubberMaterial] = {
    "mooney-rivlin": RubberMaterial("mooney_rivlin", ("mu_1", "mu_2")),
    "neo-hooke": RubberMaterial("mooney_rivlin", ("mu",)),
    "yeoh": RubberMaterial("yeoh", ("c_10", "c_20", "c_30")),
    "ogden": RubberMaterial("ogden", ("ogden_mu", "ogden_alpha")),
    "arruda-boyce": RubberMaterial("arruda_boyce", ("mu", "lambda_m")),
    "gent": RubberMaterial("gent", ("mu", "J_m")),
}
"""Materials by the names that a case gives them.  A hardness may stand for a single modulus, mu."""

MODULI = ("mu_1", "mu_2", "mu", "c_10", "c_20", "c_30", "ogden_mu")
"""Keys that are stresses."""

KEYS = tuple(dict.fromkeys(key for m in MATERIALS.values() for key in m.keys))
"""Every key of a material."""


def shear_modulus(material: RubberMaterial, parameters: Mapping[str, Any]) -> float:
    """Shear modulus without deformation, MPa."""
    values = material.kernel_values(parameters)
    if material.energy == "mooney_rivlin":
        return values["mu_1"] + values["mu_2"]
    return _modulus(material.energy, tuple(values.items()))


@cache
def _modulus(energy: str, values: tuple[tuple[str, float], ...]) -> float:
    # the energy of small strains is mu (e_1^2 + e_2^2 + e_3^2) with e_3 = -e_1 - e_2
    kernel = load_kernel(f"sheet_{energy}")
    _, K = kernel.tangent(np.ones((1, 2)), np.zeros((1, 2)), parameters=dict(values))
    return float(K[0, 0, 0]) / 4.0


def incremental_stiffness(
    material: RubberMaterial, values: Values, along: float, hoop: float
) -> tuple[float, float]:
    """Stress difference of a stretched rubber, and its derivative by the first strain, MPa.

    Parameters
    ----------
    material : Material
        The rubber.
    values : mapping
        Parameters of its kernel.
    along, hoop : float
        Principal logarithmic strains; the third follows, as the volume does not change.

    Returns
    -------
    (float, float)
        True stress along minus that of the third direction, and its derivative by `along`.
    """
    e = np.array([[along, hoop]])
    R, K = material.sheet.tangent(np.ones((1, 2)), e, parameters=dict(values))
    return float(R[0, 0]), float(K[0, 0, 0])


# --- tests of a rubber ------------------------------------------------------------------------

SECOND = {"uniaxial": -0.5, "biaxial": 1.0, "shear": 0.0}
"""Test -> logarithmic strain across over that along; `shear` is planar tension, pure shear."""


def strains(test: str | Array, stretch: Array) -> Array:
    """Principal logarithmic strains (n, 2) of a test, or of the tests (n,), at stretches (n,)."""
    along = np.log(stretch)
    return np.stack([along, np.vectorize(SECOND.get)(test) * along], axis=1)


def nominal_stress(material: RubberMaterial, values: Values, e: Array, stretch: Array) -> Array:
    """Nominal stress (n,) of an incompressible rubber along the first strain of e (n, 2), MPa."""
    R = material.sheet.residual(np.ones((len(e), 2)), e, parameters=dict(values))
    return np.asarray(R[:, 0] / stretch)


def stress_by(
    material: RubberMaterial, name: str, values: Values, e: Array, stretch: Array
) -> Array:
    """Derivative (n,) of the nominal stress by a parameter of the kernel."""
    points = np.ones((len(e), 2))
    R = material.sheet.derivative(name, points, e, parameters=dict(values))
    return np.asarray(R[:, 0] / stretch)


def unstable_at(
    material: RubberMaterial,
    values: Values,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[str, float] | None:
    """The test and the stretch nearest to 1 at which Drucker's criterion fails, if one does.

    Asked is that the true stresses grow with the logarithmic strains in every direction, in every
    test within RANGE or the wider limits given for it.
    """
    failures = []
    for test in SECOND:
        low, high = (limits or {}).get(test, RANGE)
        steps = np.linspace(log(min(low, RANGE[0])), log(max(high, RANGE[1])), 241)
        e = strains(test, np.exp(steps))
        _, K = material.sheet.tangent(np.ones((len(e), 2)), e, parameters=dict(values))
        failing = steps[np.logical_not(_positive(K))]
        failures += [(abs(s), test, float(np.exp(s))) for s in failing]
    return min(failures)[1:] if failures else None


def _positive(K: Array) -> Flags:
    """Which of the matrices (n, 2, 2) are positive definite; one that is no number is not."""
    with np.errstate(invalid="ignore"):
        return np.asarray((K[:, 0, 0] > 0.0) & (K[:, 0, 0] * K[:, 1, 1] > K[:, 0, 1] * K[:, 1, 0]))
