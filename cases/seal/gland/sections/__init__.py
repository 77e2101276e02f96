"""Sections of seals: their shapes, their keys in a case, sections from files."""
