"""The cases that ship, one line each, and runs of many of them.

from concurrent.futures import ProcessPoolExecutor
import softehl

cases = [softehl.Seal(sealed_pressure=p) for p in (0.5, 1.0, 2.0)]
if __name__ == "__main__":
    with ProcessPoolExecutor(2) as executor:
        curves = softehl.solve_cases(cases, "results/sweep", executor)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # so that `softehl run --help` loads nothing heavy
    from softehl.cases.harness.case import AnyCase
    from softehl.cases.harness.parameters import Parameters
    from softehl.cases.harness.sweep import Curve

SHIPPED = {
    "oring": "softehl.cases.oring",
    "slider": "softehl.cases.slider.case",
    "cycle": "softehl.cases.cycle",
}
"""Name of a case -> the module that declares it, imported when the case is needed."""


def case_of(parameters: Parameters) -> AnyCase:
    """The case that parameters of this class belong to.  Raises TypeError if there is none."""
    from softehl.cases.harness.case import load_case

    for module in SHIPPED.values():
        case = load_case(module)
        if type(parameters) is case.parameters:
            return case
    raise TypeError(f"{type(parameters).__name__} is not the parameter class of a case")


def solve_cases(
    cases: Iterable[Parameters] | Mapping[str, Parameters],
    folder: Path | str,
    executor: Executor | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
) -> list[Curve]:
    """Run every parameter set in its own folder below `folder`.

    Parameters
    ----------
    cases : iterable of Parameters, or mapping of str to Parameters
        Parameter sets, such as `softehl.Seal`, or folder name -> parameter set. Without names a
        folder is named after the keys that differ from their defaults, such as
        `density=4-sealed_pressure=2`.
    folder : str or Path
        Folder of the runs. They share files in it (contact states in `folder/contacts`).
    executor : Executor, optional
        Any `concurrent.futures.Executor` whose workers see the same file system; left out, runs
        follow one another in this process.
    resume : bool
        Keep the rows that the folders have.
    overwrite : bool
        Begin anew in folders that have a run. Without both, such a folder is refused.

    Returns
    -------
    list of Curve
        In the order of `cases`. An incomplete run is no error: see `Curve.complaints`.

    Raises
    ------
    BadInput
        Folders are in use, have a run, or two runs have one name. Runs that have not begun are
        cancelled; those that have are saved.
    """
    from softehl.cases.harness import sweep
    from softehl.cases.harness.resume import existing_of

    existing = existing_of(resume=resume, overwrite=overwrite)
    return sweep.solve_all(sweep.named(cases, case_of), Path(folder), executor, existing)
