"""softehl: soft elastohydrodynamic lubrication from SymPy models compiled to lean C.

The public names are listed here once and imported when they are first used, so that a script which
solves a case loads no SymPy and `softehl --help` loads nothing at all.
"""

import dataclasses
import importlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softehl.errors import SoftehlError, UnknownNameError

if TYPE_CHECKING:
    from softehl.__main__ import main
    from softehl.cases.harness.errors import BadInput
    from softehl.cases.harness.observer import Observer, Outcome
    from softehl.cases.harness.parameters import Parameters
    from softehl.cases.harness.process_pool import processes
    from softehl.cases.harness.sweep import Curve
    from softehl.cases.oring import run_oring
    from softehl.cases.seal.gland.parameters import ORing, Seal
    from softehl.cases.seal.states.state import (
        ContactState,
        FilmState,
        Profile,
        Silent,
    )
    from softehl.cases.shipped import solve_cases
    from softehl.codegen.abi import BuildError, TargetError
    from softehl.codegen.elements import quadrature, shapes
    from softehl.codegen.elements.cells import element
    from softehl.codegen.elements.element import Element
    from softehl.codegen.elements.quadrature import QuadratureRule
    from softehl.codegen.graph.partial_derivatives import DifferentiationError
    from softehl.codegen.language import kinematics
    from softehl.codegen.language.definition import Definition
    from softehl.codegen.language.errors import ModelError, ModelWarning
    from softehl.codegen.language.fields import Fields
    from softehl.codegen.language.material import Law, Material, material
    from softehl.codegen.language.model import Model
    from softehl.codegen.language.run_time_terms import TermArray
    from softehl.codegen.language.weak_form import Page, page
    from softehl.codegen.tools.cache_dir import CacheError
    from softehl.codegen.tools.library import LibraryError
    from softehl.codegen.tools.model_text import ModelFileError
    from softehl.codegen.verify.random_states import NoStateError
    from softehl.runtime.analyses.arc_length_path import LoadPath
    from softehl.runtime.analyses.bifurcation import Bifurcation, MissedBifurcations
    from softehl.runtime.analyses.buckling import Buckling
    from softehl.runtime.analyses.callbacks import Series
    from softehl.runtime.analyses.dynamics import UnbalancedStart
    from softehl.runtime.analyses.explicit_dynamics import SoftContact, StiffContact
    from softehl.runtime.analyses.homogenisation import Cell, Homogenised
    from softehl.runtime.analyses.motion import EnergyGain, Motion
    from softehl.runtime.analyses.solver_options import SolverOptions
    from softehl.runtime.analyses.time_integrators import (
        BDF2,
        CentralDifference,
        Euler,
        FirstOrderIntegrator,
        GeneralisedAlpha,
        Midpoint,
        Newmark,
        SecondOrderIntegrator,
    )
    from softehl.runtime.contact.rigid_surfaces import (
        Cylinder,
        Plane,
        Polyline,
        Sphere,
        SurfaceError,
    )
    from softehl.runtime.definition.problem_definition import StudyError
    from softehl.runtime.device.device_module import DeviceError
    from softehl.runtime.discretisation.assembly import Assembler
    from softehl.runtime.discretisation.dofmap import DofLayout
    from softehl.runtime.discretisation.element_blocks import ElementBlock
    from softehl.runtime.discretisation.problem import Problem
    from softehl.runtime.discretisation.problem_checks import ProblemError
    from softehl.runtime.equations.stability import UnstableState
    from softehl.runtime.equations.system import System
    from softehl.runtime.fit.jax_operation import Operation
    from softehl.runtime.fit.least_squares import Fit
    from softehl.runtime.fit.objective import Objective
    from softehl.runtime.kernels.explanation import ElementState, Explanation
    from softehl.runtime.kernels.kernel import Kernel
    from softehl.runtime.kernels.kernel_call import ArgumentError
    from softehl.runtime.kernels.networks import initial_weights, network_layers
    from softehl.runtime.kernels.run_time_arrays import ArrayDataError
    from softehl.runtime.kernels.shared_library import KernelError
    from softehl.runtime.kernels.tables import Table
    from softehl.runtime.mesh.mesh import Mesh, MeshError
    from softehl.runtime.mesh.plotting import MissingPyvista, PictureError
    from softehl.runtime.mpi import MissingPetsc
    from softehl.runtime.parallel.matrix_free import MatrixFree
    from softehl.runtime.parallel.petsc import Petsc
    from softehl.runtime.results.modes import Modes
    from softehl.runtime.results.plotting import animate
    from softehl.runtime.results.result import ModeShape, Result
    from softehl.runtime.results.tensors import principal_values, von_mises
    from softehl.runtime.solve.arclength import Arclength
    from softehl.runtime.solve.continuation import Continuation, StepRule
    from softehl.runtime.solve.eigen import NoModes
    from softehl.runtime.solve.linear.direct import MissingBackend
    from softehl.runtime.solve.linear.linear_solver import SingularMatrix
    from softehl.runtime.solve.newton import Newton
    from softehl.runtime.solve.solution import (
        Branch,
        LimitPoint,
        NotConverged,
        Point,
        Solution,
        Status,
    )
    from softehl.runtime.solve.solver_cascade import Ladder
    from softehl.runtime.study import Study

__version__ = "0.3.0"

if not (Path(__file__).parent / "runtime").is_dir():
    __path__.append(str(Path(__file__).resolve().parents[2]))  # a checkout without symbolic links

_PUBLIC = {
    "Arclength": "softehl.runtime.solve.arclength",
    "ArgumentError": "softehl.runtime.kernels.kernel_call",
    "ArrayDataError": "softehl.runtime.kernels.run_time_arrays",
    "Assembler": "softehl.runtime.discretisation.assembly",
    "BDF2": "softehl.runtime.analyses.time_integrators",
    "BadInput": "softehl.cases.harness.errors",
    "Bifurcation": "softehl.runtime.analyses.bifurcation",
    "Branch": "softehl.runtime.solve.solution",
    "Buckling": "softehl.runtime.analyses.buckling",
    "Cell": "softehl.runtime.analyses.homogenisation",
    "CentralDifference": "softehl.runtime.analyses.time_integrators",
    "ContactState": "softehl.cases.seal.states.state",
    "Continuation": "softehl.runtime.solve.continuation",
    "Curve": "softehl.cases.harness.sweep",
    "Cylinder": "softehl.runtime.contact.rigid_surfaces",
    "DofLayout": "softehl.runtime.discretisation.dofmap",
    "ElementBlock": "softehl.runtime.discretisation.element_blocks",
    "EnergyGain": "softehl.runtime.analyses.motion",
    "Euler": "softehl.runtime.analyses.time_integrators",
    "Explanation": "softehl.runtime.kernels.explanation",
    "FilmState": "softehl.cases.seal.states.state",
    "FirstOrderIntegrator": "softehl.runtime.analyses.time_integrators",
    "Fit": "softehl.runtime.fit.least_squares",
    "GeneralisedAlpha": "softehl.runtime.analyses.time_integrators",
    "Homogenised": "softehl.runtime.analyses.homogenisation",
    "Kernel": "softehl.runtime.kernels.kernel",
    "KernelError": "softehl.runtime.kernels.shared_library",
    "Ladder": "softehl.runtime.solve.solver_cascade",
    "LimitPoint": "softehl.runtime.solve.solution",
    "LoadPath": "softehl.runtime.analyses.arc_length_path",
    "MatrixFree": "softehl.runtime.parallel.matrix_free",
    "Mesh": "softehl.runtime.mesh.mesh",
    "MeshError": "softehl.runtime.mesh.mesh",
    "Midpoint": "softehl.runtime.analyses.time_integrators",
    "MissedBifurcations": "softehl.runtime.analyses.bifurcation",
    "MissingBackend": "softehl.runtime.solve.linear.direct",
    "MissingPetsc": "softehl.runtime.mpi",
    "MissingPyvista": "softehl.runtime.mesh.plotting",
    "ModeShape": "softehl.runtime.results.result",
    "Modes": "softehl.runtime.results.modes",
    "Motion": "softehl.runtime.analyses.motion",
    "Newmark": "softehl.runtime.analyses.time_integrators",
    "Newton": "softehl.runtime.solve.newton",
    "NoModes": "softehl.runtime.solve.eigen",
    "NotConverged": "softehl.runtime.solve.solution",
    "ORing": "softehl.cases.seal.gland.parameters",
    "Objective": "softehl.runtime.fit.objective",
    "Observer": "softehl.cases.harness.observer",
    "Operation": "softehl.runtime.fit.jax_operation",
    "Outcome": "softehl.cases.harness.observer",
    "Parameters": "softehl.cases.harness.parameters",
    "Petsc": "softehl.runtime.parallel.petsc",
    "DeviceError": "softehl.runtime.device.device_module",
    "PictureError": "softehl.runtime.mesh.plotting",
    "Plane": "softehl.runtime.contact.rigid_surfaces",
    "Point": "softehl.runtime.solve.solution",
    "Polyline": "softehl.runtime.contact.rigid_surfaces",
    "Problem": "softehl.runtime.discretisation.problem",
    "ProblemError": "softehl.runtime.discretisation.problem_checks",
    "Profile": "softehl.cases.seal.states.state",
    "Result": "softehl.runtime.results.result",
    "Seal": "softehl.cases.seal.gland.parameters",
    "SecondOrderIntegrator": "softehl.runtime.analyses.time_integrators",
    "Series": "softehl.runtime.analyses.callbacks",
    "Silent": "softehl.cases.seal.states.state",
    "SingularMatrix": "softehl.runtime.solve.linear.linear_solver",
    "Solution": "softehl.runtime.solve.solution",
    "SoftContact": "softehl.runtime.analyses.explicit_dynamics",
    "SolverOptions": "softehl.runtime.analyses.solver_options",
    "Sphere": "softehl.runtime.contact.rigid_surfaces",
    "Status": "softehl.runtime.solve.solution",
    "StiffContact": "softehl.runtime.analyses.explicit_dynamics",
    "StepRule": "softehl.runtime.solve.continuation",
    "Study": "softehl.runtime.study",
    "StudyError": "softehl.runtime.definition.problem_definition",
    "SurfaceError": "softehl.runtime.contact.rigid_surfaces",
    "System": "softehl.runtime.equations.system",
    "Table": "softehl.runtime.kernels.tables",
    "UnbalancedStart": "softehl.runtime.analyses.dynamics",
    "UnstableState": "softehl.runtime.equations.stability",
    "animate": "softehl.runtime.results.plotting",
    "initial_weights": "softehl.runtime.kernels.networks",
    "main": "softehl.__main__",
    "principal_values": "softehl.runtime.results.tensors",
    "network_layers": "softehl.runtime.kernels.networks",
    "processes": "softehl.cases.harness.process_pool",
    "run_oring": "softehl.cases.oring",
    "solve_cases": "softehl.cases.shipped",
    "von_mises": "softehl.runtime.results.tensors",
}
_MODELLING = {
    "BuildError": "softehl.codegen.abi",
    "CacheError": "softehl.codegen.tools.cache_dir",
    "Definition": "softehl.codegen.language.definition",
    "DifferentiationError": "softehl.codegen.graph.partial_derivatives",
    "Element": "softehl.codegen.elements.element",
    "Fields": "softehl.codegen.language.fields",
    "Law": "softehl.codegen.language.material",
    "LibraryError": "softehl.codegen.tools.library",
    "Material": "softehl.codegen.language.material",
    "Model": "softehl.codegen.language.model",
    "ModelError": "softehl.codegen.language.errors",
    "ModelFileError": "softehl.codegen.tools.model_text",
    "ModelWarning": "softehl.codegen.language.errors",
    "NoStateError": "softehl.codegen.verify.random_states",
    "Page": "softehl.codegen.language.weak_form",
    "QuadratureRule": "softehl.codegen.elements.quadrature",
    "TargetError": "softehl.codegen.abi",
    "TermArray": "softehl.codegen.language.run_time_terms",
    "element": "softehl.codegen.elements.cells",
    "kinematics": "softehl.codegen.language.kinematics:",
    "material": "softehl.codegen.language.material",
    "page": "softehl.codegen.language.weak_form",
    "quadrature": "softehl.codegen.elements.quadrature:",
    "shapes": "softehl.codegen.elements.shapes:",
}
"""What a model page needs; these import SymPy."""

__all__ = [
    "BDF2",
    "Arclength",
    "ArgumentError",
    "ArrayDataError",
    "Assembler",
    "BadInput",
    "Bifurcation",
    "Branch",
    "Buckling",
    "BuildError",
    "CacheError",
    "Cell",
    "CentralDifference",
    "ContactState",
    "Continuation",
    "Curve",
    "Cylinder",
    "Definition",
    "DeviceError",
    "DifferentiationError",
    "DofLayout",
    "Element",
    "ElementBlock",
    "EnergyGain",
    "Euler",
    "Explanation",
    "Fields",
    "FilmState",
    "FirstOrderIntegrator",
    "Fit",
    "GeneralisedAlpha",
    "Homogenised",
    "Kernel",
    "KernelError",
    "Ladder",
    "Law",
    "LibraryError",
    "LimitPoint",
    "LoadPath",
    "Material",
    "MatrixFree",
    "Mesh",
    "MeshError",
    "Midpoint",
    "MissedBifurcations",
    "MissingBackend",
    "MissingPetsc",
    "MissingPyvista",
    "ModeShape",
    "Model",
    "ModelError",
    "ModelFileError",
    "ModelWarning",
    "Modes",
    "Motion",
    "Newmark",
    "Newton",
    "NoModes",
    "NoStateError",
    "NotConverged",
    "ORing",
    "Objective",
    "Observer",
    "Operation",
    "Outcome",
    "Page",
    "Parameters",
    "Petsc",
    "PictureError",
    "Plane",
    "Point",
    "Polyline",
    "Problem",
    "ProblemError",
    "Profile",
    "QuadratureRule",
    "Result",
    "Seal",
    "SecondOrderIntegrator",
    "Series",
    "Silent",
    "SingularMatrix",
    "SoftContact",
    "SoftehlError",
    "Solution",
    "SolverOptions",
    "Sphere",
    "Status",
    "StepRule",
    "StiffContact",
    "Study",
    "StudyError",
    "SurfaceError",
    "SymPyNeededError",
    "System",
    "Table",
    "TargetError",
    "TermArray",
    "UnbalancedStart",
    "UnknownNameError",
    "UnstableState",
    "animate",
    "element",
    "initial_weights",
    "kinematics",
    "load_kernel",
    "main",
    "material",
    "network_layers",
    "page",
    "principal_values",
    "processes",
    "quadrature",
    "run_oring",
    "shapes",
    "solve_cases",
    "von_mises",
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
    derivatives: int = 0,
    varying: "Mapping[str, str] | None" = None,
    values: tuple[str, ...] = (),
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
    derivatives : int
        1: add the tasks `pseudo_load` and `fields_rate`, for derivatives of results; the point data
        are then those of the page and the rate of each. 2: only the tasks `adjoint_rate` and
        `point_adjoint_rate`, for second derivatives; the adjoint of each datum and its rate follow.
    varying : mapping of str to str, optional
        Parameters of a page of fields or of a material that become "data" of elements or "point
        data"; other names are ignored.
    values : tuple of str
        Names that the page has given (`Model.define`): the only task is `fields`, with these.

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
    moved = tuple(sorted((varying or {}).items()))
    where = (() if cell is None else (cell,), geometry or "", materials, moved)
    if isinstance(source, str) and not source.endswith(".py") and not folder_given:
        if materials:
            from softehl.codegen.tools import library

            if library.has(source, "material"):
                return load_kernel(
                    library.entry(source, "material").path,
                    name,
                    cell=cell,
                    geometry=geometry,
                    materials=True,
                    derivatives=derivatives,
                    varying=varying,
                    values=values,
                )
            with with_sympy():
                from softehl.codegen.tools.kernel_cache import of_law

                folder = of_law(source, where, derivatives=values or derivatives)
                return kernel.kernel_in(folder, None, cell)
        shipped = kernel.load_kernel(source)
        if not (derivatives or values):
            return shipped
        with with_sympy():
            from softehl.codegen.models import ALL

            return load_kernel(ALL[source](), derivatives=derivatives, values=values)
    if isinstance(source, (str, Path)) and folder_given:
        return kernel.kernel_in(Path(source).resolve(), name, cell)
    from softehl.codegen.tools import kernel_cache

    place = Path(source) if isinstance(source, str) else source
    with with_sympy():
        folder = kernel_cache.folder_of(place, where, derivatives=values or derivatives)
        loaded = kernel.kernel_in(folder, name, cell)
        if not loaded.functions:
            return loaded
        definition = kernel_cache.definition_of(folder, loaded.name)
        known = dict(definition.addresses if definition else ())
        return dataclasses.replace(loaded, addresses=known)


from softehl.runtime.definition import page_loader  # noqa: E402, after __path__ is complete

page_loader.load_page = load_kernel  # the runtime has no compiler


def _element_file(name: str) -> tuple[Path, tuple[str, ...]]:
    from softehl.codegen.tools.library import entry

    found = entry(name, "element")
    return found.path, found.kinds


page_loader.element_file = _element_file
page_loader.stress_page = Path(__file__).parent / "codegen" / "models" / "linearised_stress.py"

from softehl.runtime.kernels import page_evaluator  # noqa: E402


def _evaluate_page(
    folder: Path, kernel: str, state: "ElementState"
) -> "tuple[list[tuple[str, tuple[float, ...], str]], str]":
    with with_sympy():
        from softehl.codegen.tools.page_evaluation import evaluate
    return evaluate(folder, kernel, state)


page_evaluator.evaluate_page = _evaluate_page

from softehl.device_source import DeviceSource  # noqa: E402
from softehl.runtime.device import device_printer  # noqa: E402


def _device_source(folder: Path, kernel: str, real: str) -> DeviceSource:
    with with_sympy():
        from softehl.codegen.tools import device_library
    return device_library.source_of(folder, kernel, real)


def _emulated_library(source: DeviceSource, fibers: bool) -> Path:
    with with_sympy():
        from softehl.codegen.tools import device_library
    return device_library.emulated_library(source, fibers)


device_printer.device_source = _device_source
device_printer.emulated_library = _emulated_library
