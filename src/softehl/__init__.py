"""softehl: soft elastohydrodynamic lubrication from SymPy models compiled to lean C.

The public names are listed here once and imported when they are first used, so that a script which
solves a case loads no SymPy and `softehl --help` loads nothing at all.
"""

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softehl.errors import SoftehlError

if TYPE_CHECKING:
    from softehl.__main__ import main
    from softehl.cases.harness.processes import processes
    from softehl.cases.harness.sweep import Curve
    from softehl.cases.oring import run_oring
    from softehl.cases.seal.gland.parameters import ORing, Seal
    from softehl.cases.seal.states.state import FilmState, Observer, Outcome, Silent
    from softehl.cases.shipped import solve_cases
    from softehl.codegen.language import kinematics
    from softehl.codegen.language.complaints import ModelError
    from softehl.codegen.language.definition import Definition
    from softehl.codegen.language.elements import quadrature, shapes
    from softehl.codegen.language.elements.cells import element
    from softehl.codegen.language.material import Law, material
    from softehl.codegen.language.model import Model
    from softehl.codegen.language.pages import Page, page
    from softehl.runtime.definition.problem_definition import StudyError
    from softehl.runtime.discretisation.assembly import Assembler
    from softehl.runtime.discretisation.dofmap import DofLayout
    from softehl.runtime.discretisation.element_blocks import ElementBlock
    from softehl.runtime.discretisation.problem import Problem
    from softehl.runtime.discretisation.problem_checks import ProblemError
    from softehl.runtime.kernels.kernel import Kernel, KernelError
    from softehl.runtime.mesh.mesh import Mesh, MeshError
    from softehl.runtime.results.result import Result
    from softehl.runtime.solve.arclength import Arclength
    from softehl.runtime.solve.continuation import Continuation, StepRule
    from softehl.runtime.solve.newton import Newton
    from softehl.runtime.solve.solution import Branch, NotConverged, Solution, Status
    from softehl.runtime.solve.solver_cascade import Ladder
    from softehl.runtime.study import Study

__version__ = "0.2.0"

if not (Path(__file__).parent / "runtime").is_dir():
    __path__.append(str(Path(__file__).resolve().parents[2]))  # a checkout without symbolic links

_PUBLIC = {
    "Arclength": "softehl.runtime.solve.arclength",
    "Assembler": "softehl.runtime.discretisation.assembly",
    "Branch": "softehl.runtime.solve.solution",
    "Continuation": "softehl.runtime.solve.continuation",
    "Curve": "softehl.cases.harness.sweep",
    "DofLayout": "softehl.runtime.discretisation.dofmap",
    "ElementBlock": "softehl.runtime.discretisation.element_blocks",
    "FilmState": "softehl.cases.seal.states.state",
    "Kernel": "softehl.runtime.kernels.kernel",
    "KernelError": "softehl.runtime.kernels.shared_library",
    "Ladder": "softehl.runtime.solve.solver_cascade",
    "Mesh": "softehl.runtime.mesh.mesh",
    "MeshError": "softehl.runtime.mesh.mesh",
    "Newton": "softehl.runtime.solve.newton",
    "NotConverged": "softehl.runtime.solve.solution",
    "ORing": "softehl.cases.seal.gland.parameters",
    "Observer": "softehl.cases.seal.states.state",
    "Outcome": "softehl.cases.seal.states.state",
    "Problem": "softehl.runtime.discretisation.problem",
    "ProblemError": "softehl.runtime.discretisation.problem_checks",
    "Result": "softehl.runtime.results.result",
    "Seal": "softehl.cases.seal.gland.parameters",
    "Silent": "softehl.cases.seal.states.state",
    "Solution": "softehl.runtime.solve.solution",
    "Status": "softehl.runtime.solve.solution",
    "StepRule": "softehl.runtime.solve.continuation",
    "Study": "softehl.runtime.study",
    "StudyError": "softehl.runtime.definition.problem_definition",
    "main": "softehl.__main__",
    "processes": "softehl.cases.harness.processes",
    "run_oring": "softehl.cases.oring",
    "solve_cases": "softehl.cases.shipped",
}
_MODELLING = {
    "Definition": "softehl.codegen.language.definition",
    "Model": "softehl.codegen.language.model",
    "ModelError": "softehl.codegen.language.complaints",
    "element": "softehl.codegen.language.elements.cells",
    "kinematics": "softehl.codegen.language.kinematics:",
    "material": "softehl.codegen.language.material",
    "page": "softehl.codegen.language.pages",
    "quadrature": "softehl.codegen.language.elements.quadrature:",
    "shapes": "softehl.codegen.language.elements.shapes:",
}
"""What a model page needs; these import SymPy."""

__all__ = [
    "Arclength",
    "Assembler",
    "Branch",
    "Continuation",
    "Curve",
    "Definition",
    "DofLayout",
    "ElementBlock",
    "FilmState",
    "Kernel",
    "KernelError",
    "Ladder",
    "Mesh",
    "MeshError",
    "Model",
    "ModelError",
    "Newton",
    "NotConverged",
    "ORing",
    "Observer",
    "Outcome",
    "Problem",
    "ProblemError",
    "Result",
    "Seal",
    "Silent",
    "SoftehlError",
    "Solution",
    "Status",
    "StepRule",
    "Study",
    "StudyError",
    "element",
    "kinematics",
    "load_kernel",
    "main",
    "material",
    "page",
    "processes",
    "quadrature",
    "run_oring",
    "shapes",
    "solve_cases",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    place = _PUBLIC.get(name) or _MODELLING.get(name)
    if place is None:
        raise AttributeError(f"module 'softehl' has no attribute {name!r}")
    module, colon, attribute = place.partition(":")
    with with_sympy():
        imported = importlib.import_module(module)
    value = imported if colon and not attribute else getattr(imported, attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *_PUBLIC, *_MODELLING]


class SymPyNeededError(SoftehlError, ModuleNotFoundError):
    """Kernels can be derived only where SymPy and mpmath are installed."""


@contextmanager
def with_sympy() -> Iterator[None]:
    """Say in one line what to install where SymPy is needed and missing: `SymPyNeededError`."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("sympy", "mpmath"):
            raise
        raise SymPyNeededError(
            "deriving kernels needs SymPy: pip install 'softehl[generate]'", name=error.name
        ) from None


def load_kernel(
    source: "str | Path | Definition | Page | Law",
    name: str | None = None,
    *,
    cell: str | None = None,
    geometry: str | None = None,
    materials: bool = False,
    derivatives: bool = False,
) -> "Kernel":
    """Return a compiled kernel; derive and compile it if the cache does not have it.

    Parameters
    ----------
    source : str, Path, Definition, Page or Law
        The name of a kernel that ships, "solid_q4"; with `materials`, that of a material that
        ships, "neo_hooke". A model file, "my_model.py", which is run. A folder that
        `softehl generate` wrote. Or a Definition, page or material, for notebooks.
    name : str, optional
        Which model, if the file or folder has several.
    cell : str, optional
        Cell of a page of fields, cell="hex8". Others ignore it.
    geometry : str, optional
        Geometry of a page of fields: "plane strain" (the default), "axisymmetric" or "solid".
    materials : bool
        Take the stress laws of a file, as bodies, in place of its pages.
    derivatives : bool
        Add the tasks `pseudo_load` and `fields_rate`, for derivatives of results; the point data
        are then those of the page and the rate of each.

    Returns
    -------
    Kernel
        The compiled kernel.

    Raises
    ------
    KernelError
        There is no such kernel.
    ModelError
        The model is wrong.
    SymPyNeededError
        The kernel must be derived, and SymPy is not installed.
    """
    from softehl.runtime.kernels import kernel

    # os.path: a name that is too long for a file is none
    folder_given = isinstance(source, (str, Path)) and os.path.isdir(source)
    where = (() if cell is None else (cell,), geometry or "", materials)
    if isinstance(source, str) and not source.endswith(".py") and not folder_given:
        if materials:
            with with_sympy():
                from softehl.codegen.tools.library import of_law

                return kernel.kernel_in(of_law(source, where, derivatives=derivatives), None, cell)
        shipped = kernel.load_kernel(source)
        if not derivatives:
            return shipped
        with with_sympy():
            from softehl.codegen.models import ALL

            return load_kernel(ALL[source](), derivatives=True)
    if isinstance(source, (str, Path)) and folder_given:
        return kernel.kernel_in(Path(source).resolve(), name, cell)
    from softehl.codegen.tools import library

    place = Path(source) if isinstance(source, str) else source
    with with_sympy():
        folder = library.folder_of(place, where, derivatives=derivatives)
    return kernel.kernel_in(folder, name, cell)
