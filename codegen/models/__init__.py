"""The models: one page of mathematics each.  `ALL` lists the pages that ship."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from softehl.codegen.language import energies
from softehl.codegen.language.definition import Definition
from softehl.codegen.models import (
    biaxial_sheet,
    contact,
    film,
    follower_pressure,
    mixed_film,
    mortar_2d,
    mortar_3d,
    restraints,
    rheology,
    rigid,
    solid,
)

MATERIALS = {
    "yeoh": energies.YEOH,
    "ogden": energies.OGDEN,
    "arruda_boyce": energies.ARRUDA_BOYCE,
    "gent": energies.GENT,
}
"""Energies beside the paper's; of the elements the Taylor-expanded one, the default, has them.

Their points are a loop: less than half the C, for a few per cent of the time of a run.
"""

THINNING = {"eyring": rheology.eyring, "carreau": rheology.carreau}
"""Oils of smooth films beside the Newtonian one."""

_SMOOTH = {"film": film.reynolds_segment, "film_conserving": mixed_film.conserving_segment}


def _of(name: str, energy: energies.Energy) -> Callable[[], Definition]:
    return partial(solid.taylor_mean, name, (energy, energies.VOLUMETRIC), unroll=False)


ALL: dict[str, Callable[[], Definition]] = {
    "solid_q4": solid.plain,
    "solid_fbar": solid.fbar,
    "solid_taylor": solid.taylor,
    "solid_taylor_mean": solid.taylor_mean,
    **{(name := f"solid_taylor_mean_{m}"): _of(name, energy) for m, energy in MATERIALS.items()},
    "follower_pressure": follower_pressure.follower_pressure,
    "contact": contact.augmented_lagrangian,
    "contact_friction": contact.coulomb,
    "contact_corner": contact.corner,
    **{f"mortar_{a}{b}": partial(mortar_2d.pair, a, b) for a in (2, 3) for b in (2, 3)},
    **{f"mortar_side_{a}": partial(mortar_2d.side, a) for a in (2, 3)},
    "touch": mortar_3d.touch,
    **{f"touch_side_{a}": partial(mortar_3d.face, a) for a in (3, 4, 6, 8, 9)},
    **{f"rigid_link_{d}": partial(rigid.link, d) for d in (2, 3)},
    "rigid_moment": rigid.moment,
    **{f"rigid_touch_{d}": partial(rigid.touch, d) for d in (2, 3)},
    "film": film.reynolds_segment,
    "film_upwind": film.bubble_load,
    "film_facet": film.reynolds_facet,
    "film_conserving": mixed_film.conserving_segment,
    "film_rough": mixed_film.rough_segment,
    "film_upwind_rough": mixed_film.rough_bubble_load,
    "film_void": mixed_film.void_fraction,
    **{
        (name := f"{film_name}_{oil}"): partial(page, name, law)
        for film_name, page in _SMOOTH.items()
        for oil, law in THINNING.items()
    },
    "film_squeeze": mixed_film.squeeze,
    "film_squeeze_rough": mixed_film.rough_squeeze,
    "mean_rotation": restraints.mean_rotation,
    "mean_axial": restraints.mean_axial,
    "axial_spring": restraints.axial_spring,
    **{
        (name := f"sheet_{m}"): partial(biaxial_sheet.sheet, name, energy)
        for m, energy in {"mooney_rivlin": energies.MOONEY_RIVLIN, **MATERIALS}.items()
    },
}
