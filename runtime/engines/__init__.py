"""Where a study is solved: in this process, or by PETSc on all processes that mpirun started."""
