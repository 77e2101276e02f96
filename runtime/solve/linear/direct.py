"""The linear solver by name: SuperLU comes with SciPy, PARDISO is optional and much faster.

MUMPS works on all processes that mpirun started."""

from __future__ import annotations

from typing import Literal, TypeAlias

from softehl.errors import SoftehlError
from softehl.runtime.mpi import MissingPetsc
from softehl.runtime.solve.linear import mumps, pardiso
from softehl.runtime.solve.linear.linear_solver import Condenser
from softehl.runtime.solve.linear.superlu import SuperLU

Backend: TypeAlias = Literal["auto", "superlu", "pardiso", "petsc"]


class MissingBackend(SoftehlError, ValueError):  # noqa: N818 (named after what it is)
    """Error: the requested linear solver is not installed; the message gives the remedy."""


def direct_solver(backend: Backend) -> Condenser:
    """Direct solver by name; "auto" is PARDISO if installed, else SuperLU.

    Raises MissingBackend if "pardiso" or "petsc" is asked for and not installed.
    """
    if backend == "superlu" or (backend == "auto" and not pardiso.available()):
        return SuperLU()
    if backend == "petsc":
        try:
            return mumps.Mumps.of_all()
        except MissingPetsc as error:
            raise MissingBackend(f"linear = {error}") from None
    if not pardiso.available():
        raise MissingBackend(
            'linear = "pardiso": it is not installed; allowed here: "auto" or "superlu", '
            "or install the extra `fast` (pip install 'softehl[fast]')"
        )
    return pardiso.Pardiso()
