"""Verification: kernels compared with exact evaluations of the page and with themselves."""
