"""The seal program: input, mesh, equations, solution, verdict, results."""
