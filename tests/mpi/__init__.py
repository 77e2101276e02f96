"""The engine on several processes: run by `make mpi`, where PETSc is installed."""
