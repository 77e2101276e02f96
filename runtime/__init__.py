"""Runtime: meshes, assembly and solvers around the generated kernels; no physics formulas here."""
