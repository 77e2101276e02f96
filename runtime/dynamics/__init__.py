"""Second-order time: schemes of structural dynamics for a study, and their energies."""
