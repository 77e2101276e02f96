"""Benchmarks of elements of coupled fields and fluids."""

from __future__ import annotations

from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []
