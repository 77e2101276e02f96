"""The pictures of a run of a seal (PNG, SVG)."""

from softehl.cases.seal.report.pictures import PICTURES, SOME, write_plots

__all__ = ["PICTURES", "SOME", "write_plots"]
