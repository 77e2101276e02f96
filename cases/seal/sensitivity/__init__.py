"""Derivatives of results by parameters, tolerances, and design by derivatives."""
