"""Engines: one process, matrix-free, PETSc and SLEPc on all processes of mpirun."""
