"""The models: one page of mathematics each.  `ALL` lists the pages that ship."""

from __future__ import annotations

from collections.abc import Callable

from softehl.codegen.language.definition import Definition
from softehl.codegen.models import boundary, contact, film, solid, support

ALL: dict[str, Callable[[], Definition]] = {
    "solid_q4": solid.plain,
    "solid_fbar": solid.fbar,
    "solid_taylor": solid.taylor,
    "solid_taylor_mean": solid.taylor_mean,
    "follower_pressure": boundary.follower_pressure,
    "contact": contact.augmented_lagrangian,
    "film": film.reynolds_segment,
    "film_upwind": film.bubble_load,
    "film_facet": film.reynolds_facet,
    "mean_rotation": support.mean_rotation,
    "mean_axial": support.mean_axial,
    "axial_spring": support.axial_spring,
}
