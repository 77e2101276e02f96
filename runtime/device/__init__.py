"""Kernels of pages on a device: CUDA by CuPy, or the same text on the processor."""
