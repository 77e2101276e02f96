"""Engines that solve a study: this process, or PETSc on all processes of mpirun."""
