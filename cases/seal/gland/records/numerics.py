"""Solvers, support of the section, and results beside the curve."""

from typing import Literal

from softehl.cases.harness.parameters import Parameters, key


class Numerics(Parameters):
    """Solvers, support, sensitivities."""

    sensitivity: bool = key(
        False, "whether sensitivity.csv is written: derivatives of the results by every parameter"
    )
    tolerances: tuple[str, ...] = key(
        (),
        "+- tolerances for tolerances.csv, beside those of a catalogue ring",
        bounds='texts such as "viscosity 10 %", "rod_diameter 0.05 mm" or "modulus 15 %"',
        strict=False,
    )
    rotation: Literal["fixed", "free"] = key(
        "fixed", "mean rotation of the section", bounds='"fixed" (held at zero) or "free"'
    )
    solver: Literal["auto", "monolithic"] = key(
        "auto",
        "method of solution",
        bounds='"auto" (fast, checks itself) or "monolithic" (reference)',
    )
    linear: Literal["auto", "superlu", "pardiso", "petsc"] = key(
        "auto",
        "linear solver",
        bounds='"superlu", "pardiso", "petsc" (MUMPS, also under mpirun) or "auto" (pardiso where '
        "installed)",
    )
