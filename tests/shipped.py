"""What the shipped kernels promise, and typical parameters: one line for each that is added."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shipped:
    """Numbers of nodes and of direct unknowns; is there an energy, are there fields?"""

    nodes: int
    unknowns: int
    energy: bool = False
    fields: bool = False


RUBBERS = {
    "yeoh": {"c_1": 1.5, "c_2": -0.03, "c_3": 0.002},
    "ogden": {
        **{"mu_1": 3.04, "alpha_1": 1.3, "mu_2": 0.62, "alpha_2": 5.0},
        **{"mu_3": -0.1, "alpha_3": -2.0},
    },
    "arruda_boyce": {"mu": 2.1, "lambda_m": 4.0},
    "gent": {"mu": 2.1, "J_m": 30.0},
}
"""Solids beside the paper's and values of their parameters (MPa)."""

SHIPPED = {
    "solid_q4": Shipped(4, 8, energy=True, fields=True),
    "solid_fbar": Shipped(4, 8, fields=True),
    "solid_taylor": Shipped(4, 8, energy=True, fields=True),
    "solid_taylor_mean": Shipped(4, 8, energy=True, fields=True),
    **{f"solid_taylor_mean_{name}": Shipped(4, 8, energy=True, fields=True) for name in RUBBERS},
    "follower_pressure": Shipped(2, 4),
    "contact": Shipped(1, 3),
    "contact_friction": Shipped(1, 4),
    "contact_corner": Shipped(1, 3, energy=True),
    **{f"mortar_{a}{b}": Shipped(a + b, 2 * (a + b) + 4) for a in (2, 3) for b in (2, 3)},
    **{f"mortar_side_{a}": Shipped(a, 2 * a + 4, fields=True) for a in (2, 3)},
    "touch": Shipped(1, 16),
    **{
        f"touch_side_{a}": Shipped(a, 3 * a + 4 * (3 if a in (3, 6) else 4), fields=True)
        for a in (3, 4, 6, 8, 9)
    },
    "rigid_link_2": Shipped(2, 7, energy=True),
    "rigid_link_3": Shipped(2, 12, energy=True),
    "rigid_moment": Shipped(1, 3),
    "rigid_touch_2": Shipped(1, 7),
    "rigid_touch_3": Shipped(1, 13),
    "film": Shipped(2, 4, fields=True),
    "film_upwind": Shipped(2, 4),
    "film_facet": Shipped(3, 6, fields=True),
    "film_conserving": Shipped(2, 4, fields=True),
    "film_rough": Shipped(2, 4, fields=True),
    "film_upwind_rough": Shipped(2, 4),
    "film_void": Shipped(1, 2),
    **{
        f"{film}_{oil}": Shipped(2, 4, fields=True)
        for film in ("film", "film_conserving")
        for oil in ("eyring", "carreau")
    },
    "film_squeeze": Shipped(2, 4, fields=True),
    "film_squeeze_rough": Shipped(2, 4, fields=True),
    "mean_rotation": Shipped(4, 9, energy=True),
    "mean_axial": Shipped(4, 9, energy=True),
    "axial_spring": Shipped(4, 8, energy=True),
    **{f"sheet_{name}": Shipped(1, 2, energy=True) for name in ("mooney_rivlin", *RUBBERS)},
}
ENERGIES = tuple(name for name, s in SHIPPED.items() if s.energy)
FIELDS = tuple(name for name, s in SHIPPED.items() if s.fields)

VALUES = {
    **{name: value for rubber in RUBBERS.values() for name, value in rubber.items()},
    "mu_1": 3.04,
    "mu_2": 0.62,
    "kappa": 500.0,
    "pressure": 2.5,
    "offset": 0.01,
    "force_weight": 0.7,
    "friction": 0.3,
    "wall": 1.8,
    "lip": 25.05,
    "fillet": 0.2,
    "rod_radius": 25.0,
    "rod_speed": 400.0,
    "viscosity": 6.6e-8,
    "pressure_viscosity": 0.02,
    "cavitation_penalty": 1e4,
    "shear_weight": 0.9,
    "centre_z": 0.1,
    "centre_r": 25.4,
    "polar_moment": 7.6,
    "angle": 0.05,
    "stiffness": 0.4,
    "area": 9.8,
    "place": 0.04,
    "shear_modulus": 3.66,
    "upwinding": 1.0,
    "rate": 200.0,
    "roughness": 4e-4,
    "roughness_difference": -1.0,
    "asperity_stiffness": 14.6,
    "boundary_friction": 0.1,
    "boundary_speed": 1.0,
    "cavitation_pressure": 0.0,
    "pressure_scale": 1.0,
    "void_scale": 1e-3,
    "critical_stress": 0.05,
    "thinning_exponent": 0.5,
    "thinning_plateau": 0.1,
}
"""A value of every parameter (mm, MPa, N, s)."""
