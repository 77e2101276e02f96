"""Kernels of a page of fields as CUDA: blocks of threads around the functions of a point."""
