"""Benchmarks of elements of solids."""

from __future__ import annotations

from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []
