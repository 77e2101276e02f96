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
    """Run every parameter set into a folder of its own below `folder`; curves in the same order.

    cases: parameter sets, or folder name -> parameter set; without names a folder is called after
    all that is not at its default, such as `density=4-sealed_pressure=2`. executor: any
    `concurrent.futures.Executor` (its workers must see the same file system), None to run one after
    the other in this process. resume: keep the rows that the folders have;
    overwrite: begin anew there; without both a folder that holds a run is refused, or other
        files.

    Runs share files (the contact states of an O-ring in `folder/contacts`).
    A run that does not reach everything is no error: see `Curve.complaints`. Raises BadInput, also
    for two curves of one name, and whatever else ends a run; curves that have not begun are then
    given up, what was reached is saved.
    """
    from softehl.cases.harness import sweep
    from softehl.cases.harness.earlier import existing_of

    existing = existing_of(resume=resume, overwrite=overwrite)
    return sweep.solve_all(sweep.named(cases, case_of), Path(folder), executor, existing)
