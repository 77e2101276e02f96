"""Who runs a case: this process, or process 0 of those that mpirun started."""

from collections.abc import Iterator
from contextlib import contextmanager

from softehl.cases.harness.errors import BadInput


@contextmanager
def leading(engine: str, jobs: int) -> Iterator[bool]:
    """Yield True in the process that runs the case; the others have done their part by then.

    engine: "serial" or "petsc".  Raises BadInput where PETSc is missing, or for jobs beside it.
    """
    if engine == "serial":
        yield True
        return
    from softehl.runtime.mpi import MissingPetsc
    from softehl.runtime.solve.linear import mumps

    if jobs > 1:
        raise BadInput(
            f"--jobs {jobs} with --engine petsc: allowed is 1; the processes of mpirun work "
            "together, start more of them"
        )
    try:
        mumps.require()
    except MissingPetsc as error:
        raise BadInput(f"--engine {error}") from None
    with mumps.leading() as leads:
        yield leads
