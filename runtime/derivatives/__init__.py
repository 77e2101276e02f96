"""Derivatives of results by what a study is given: direct, adjoint, along paths; least squares."""
