"""Derivatives of a film by the parameters, and design by them."""
