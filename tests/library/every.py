"""All benchmarks of the library."""

from tests.library import coupled, laws, solids, structures

BENCHMARKS = [
    *structures.BENCHMARKS,
    *solids.BENCHMARKS,
    *laws.BENCHMARKS,
    *coupled.BENCHMARKS,
]
CONVERGENCE = structures.CONVERGENCE
