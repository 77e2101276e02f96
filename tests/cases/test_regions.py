"""Sections of several materials: keys, the same material twice, layers in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.equations.loads import ContactLoads
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.regions import PRESETS
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.inlet import inlet_length
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.contacts import contact_pressure
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array

CAPPED: dict[str, Any] = {
    **{"section": "rectangular", "corner_radius": 0.4, "cap_thickness": 0.6},
    **{"housing_diameter": 56.4, "groove_width": 4.3, "density": 1},
}
SAME: dict[str, Any] = {"materials": {"cap": {"mu_1": 3.04, "mu_2": 0.62}}}
GENT: dict[str, Any] = {"material": "gent", "mu": 3.0, "J_m": 30.0}


def test_a_cap_is_of_ptfe() -> None:
    p = Seal(**CAPPED)
    assert p.materials["cap"].shear_modulus == PRESETS["ptfe"]["mu"]
    assert p.materials["cap"].bulk_modulus == PRESETS["ptfe"]["bulk_modulus"]
    assert p.surface_modulus == 171.0
    assert p.shear_modulus == pytest.approx(3.66)
    E, nu = 500.0, 0.46
    assert PRESETS["ptfe"]["mu"] == pytest.approx(E / (2.0 + 2.0 * nu), rel=2e-3)
    assert PRESETS["ptfe"]["bulk_modulus"] == pytest.approx(E / (3.0 - 6.0 * nu), rel=2e-3)
    assert inlet_length(p, 1.0, 100.0) > inlet_length(Seal(), 1.0, 100.0)


def _state(system: SealSystem, size: float) -> Array:
    rng = np.random.default_rng(1)
    return np.asarray(size * rng.normal(size=system.layout.total))


def test_two_regions_of_one_material_are_one_region_bitwise() -> None:
    two = build_system(Seal(**CAPPED, **SAME))
    p = two.parameters.model_copy(update={"materials": {}})
    one = SealSystem.of(p, replace(two.section, own_regions=()))
    assert (two.solids, one.solids) == (("solid cap", "solid"), ("solid",))
    x = _state(two, 2e-3)
    loads = ContactLoads(1.0, {}, 0.0)
    (r, K), (s, L) = (q.contact_problem(loads).linearise(x) for q in (two, one))
    assert np.array_equal(r, s)
    assert np.array_equal(K.data, L.data)
    other: dict[str, Any] = {"materials": {"cap": {"mu_1": 3.05, "mu_2": 0.62}}}
    t, _ = build_system(Seal(**CAPPED, **other)).contact_problem(loads).linearise(x)
    assert not np.array_equal(r, t)


def test_the_tangent_of_different_materials() -> None:
    gent: dict[str, Any] = {"materials": {"cap": GENT}}
    system = build_system(Seal(**CAPPED, **gent))
    assert [b.kernel_of(system.parameters) for b in system.blocks[:2]] == [
        "solid_taylor_mean_gent",
        "solid_taylor_mean",
    ]
    assembler, given = system.problem.assembler, system.problem.parameters
    solids = {name: given[name] for name in system.solids}
    x, dx, step = _state(system, 1e-4), _state(system, 1.0)[::-1].copy(), 1e-7
    change = assembler.residual(x + step * dx, solids) - assembler.residual(x - step * dx, solids)
    _, K = assembler.linearise(x, solids)
    exact = np.asarray(K @ dx)
    assert change / (2.0 * step) == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())


WIDE = 28.0
"""Width of a rectangle whose middle does not feel its ends, mm: with 9 it presses 13 % less, with
16 2 %; bonded layers of different moduli pull at one another along the sides."""


def _squeezed(**changes: Any) -> tuple[SealSystem, Array]:
    system = build_system(Seal(**changes))
    x = ContactSolver(PathDriver(Silent())).from_rest(system)
    return system, x


def test_two_layers_between_frictionless_plates() -> None:
    """Bonded, they have one stretch: p = m (lambda^-2 - lambda^2), m the mean of both by height."""
    stretch, cap, mu = 0.9, 1.0, 12.0
    gap = stretch * 3.53 + 0.01  # the rod is held 10 um off
    system, x = _squeezed(
        **{"section": "rectangular", "section_width": WIDE, "corner_radius": 0.1},
        **{"inner_diameter": 1000.0, "rod_diameter": 1000.0, "groove_width": 1.4 * WIDE},
        housing_diameter=1000.0 + 2.0 * gap,
        bulk_modulus=2e4,
        sealed_pressure=0.0,
        cap_thickness=cap,
        density=1,
        materials={"cap": {"material": "neo-hooke", "mu": mu, "bulk_modulus": 2e4}},
    )
    z, _ = system.arc_film(x)
    found = contact_pressure(system, 0.0, x)[int(np.argmin(np.abs(z)))]
    mean = (cap * mu + (3.53 - cap) * 3.66) / 3.53
    assert found == pytest.approx(mean * (stretch**-2 - stretch**2), rel=5e-3)
    assert found > 1.5 * 3.66 * (stretch**-2 - stretch**2)


def test_equal_parameters_with_a_cap_are_one() -> None:
    values: dict[str, Any] = {"section": "rectangular", "materials": {"cap": {"mu": 10.0}}}
    thin, again, thick = (Seal(**values, cap_thickness=t) for t in (0.4, 0.4, 0.5))
    assert len({thin, again, thick, Seal()}) == 3
