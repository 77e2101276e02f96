"""Compiled kernels: native build, loading, calling."""
