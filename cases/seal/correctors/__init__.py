"""Nonlinear solvers of a soft body with a film: chord Newton, Schur complement, lagged pressure."""
