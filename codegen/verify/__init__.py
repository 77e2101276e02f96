"""Verification: kernels compared with exact evaluations of the model and with themselves."""
