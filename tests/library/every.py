"""All benchmarks of the library."""

from tests.library import coupled, fracture, laws, solids, structures

BENCHMARKS = [
    *structures.BENCHMARKS,
    *solids.BENCHMARKS,
    *laws.BENCHMARKS,
    *coupled.BENCHMARKS,
    *fracture.BENCHMARKS,
]
CONVERGENCE = structures.CONVERGENCE
