"""Benchmarks: our generator next to others, one element, one driver, one run."""
