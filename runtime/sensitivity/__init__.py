"""Derivatives of results by inputs of a study: direct, adjoint, along paths with history."""
