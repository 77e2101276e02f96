"""The discretisation: mesh, elements, quadrature, and what is asked of their errors."""

from typing import Literal, get_args

from pydantic import field_validator

from softehl.cases.harness.parameters import Parameters, key

Density = Literal[1, 2, 4, 8, 16]
DENSITIES: tuple[int, ...] = get_args(Density)
"""Mesh densities of the paper, coarsest first."""


class Discretisation(Parameters):
    """Mesh, elements of section and film, and the error that is allowed."""

    density: Density = key(
        2,
        "mesh density d: 27 d segments on an arc that is given, 33 d or more on one that is found",
        bounds="1, 2, 4, 8 or 16",
    )
    mesh: Literal["graded", "uniform", "file"] = key(
        "graded",
        "segments of the arc",
        bounds='"graded" (fine at the contact edges), "uniform" or "file" (those of the mesh file '
        "that outline names, each divided by density)",
    )
    pressure_order: int = key(
        4, "order m_p of the film pressure on a segment", bounds="1 to 64", ge=1, le=64
    )
    reynolds: Literal["fe", "dg"] = key(
        "fe", "treatment of the Reynolds equation", bounds='"fe" (continuous pressure) or "dg"'
    )
    quadrature: Literal["gauss", "lobatto"] = key("gauss", "quadrature rule of the film")
    quadrature_points: int | None = key(
        None, "points of the film rule", bounds="2 to 128, left out = automatic", ge=2, le=128
    )
    upwinding: float = key(
        1.0, "strength c of the bubble-load upwinding", bounds=">= 0, 0 = the paper's scheme", ge=0
    )
    error_estimate: bool = key(True, "whether the error of h* is estimated, on a graded mesh")
    tolerance: float | None = key(
        None,
        "largest estimated error of h*, reached by finer meshes",
        unit="%",
        bounds="left out = any",
        gt=0,
    )
    solid: Literal["taylor_mean", "taylor", "fbar", "q4"] = key(
        "taylor_mean",
        "solid element",
        bounds='"taylor_mean" (passes the patch test), "taylor" (the paper\'s), "fbar" or "q4"',
    )

    @field_validator("density", mode="before")
    @classmethod
    def _density_is_integer(cls, density: object) -> object:
        # a Literal compares by ==, which would let 2.0 and True through
        if type(density) is not int:
            raise ValueError("not an integer")
        return density
