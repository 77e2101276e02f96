"""Registry of hosts: programs that take a model, by the name of their target.

A package registers a host as an entry point of the group `softehl.hosts`, whose object is a `Host`:

    [project.entry-points."softehl.hosts"]
    my_program = "my_package.my_module:HOST"

The hosts of softehl itself also work from a checkout without metadata.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, TypeAlias

from softehl.codegen.abi import TargetError

if TYPE_CHECKING:
    from softehl.codegen.graph.evaluation import EvaluationState
    from softehl.codegen.hosts.element_interface import ElementInterface
    from softehl.codegen.language.definition import Definition
    from softehl.codegen.language.material import Law

GROUP = "softehl.hosts"
BUILT_IN = {
    "c": "softehl.codegen.hosts.c_library:C",
    "cpp": "softehl.codegen.hosts.c_library:CPP",
    "fortran": "softehl.codegen.hosts.fortran:FORTRAN",
    "matlab": "softehl.codegen.hosts.matlab:MATLAB",
    "feap": "softehl.codegen.hosts.feap:FEAP",
    "abaqus": "softehl.codegen.hosts.abaqus_material:ABAQUS",
    "calculix": "softehl.codegen.hosts.calculix:CALCULIX",
    "ansys": "softehl.codegen.hosts.ansys:ANSYS",
    "jax": "softehl.codegen.hosts.jax:JAX",
    "ngsolve": "softehl.codegen.hosts.ngsolve:NGSOLVE",
    "ufcx": "softehl.codegen.hosts.dolfinx:DOLFINX",
    "cuda": "softehl.codegen.hosts.cuda:CUDA",
}
"""Hosts of softehl, as in pyproject.toml."""

Files: TypeAlias = dict[str, str]
"""Text of each file of a folder, by its name."""
StatesOf: TypeAlias = "Callable[[Definition], Sequence[EvaluationState]]"
"""States at which a model has values, for the tests of a folder."""


@dataclass(frozen=True)
class Host:
    """Writers of the files for an element and for a material; None where the host takes none.

    They raise `TargetError` for models that the program cannot hold. arrays: whether the program
    hands over run-time arrays (`Model.table`, `Model.network`).
    """

    element: Callable[[ElementInterface, Sequence[EvaluationState]], Files] | None = None
    material: Callable[[Law, StatesOf], Files] | None = None
    arrays: bool = False


def targets() -> dict[str, EntryPoint]:
    """Entry points of all hosts by the name of their target."""
    registered = {e.name: e for e in entry_points(group=GROUP)}
    return registered | {name: EntryPoint(name, at, GROUP) for name, at in BUILT_IN.items()}


def host(target: str) -> Host:
    """Host of a target.  Raises `TargetError` where its entry point is no `Host`."""
    loaded = targets()[target].load()
    if not isinstance(loaded, Host):
        raise TargetError(f"target {target}: its entry point is no softehl Host, but {loaded!r}")
    return loaded
