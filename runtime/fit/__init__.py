"""Inverse problems: objectives, least-squares fits of measurements, a study as a JAX operation."""
