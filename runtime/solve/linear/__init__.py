"""Linear systems: direct solvers, Krylov methods, multigrid, condensation."""
