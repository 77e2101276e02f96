"""What a run of a seal shows: the curve as a table on the terminal, and its pictures (PNG, SVG)."""

from softehl.cases.seal.report.pictures import PICTURES, write_plots
from softehl.cases.seal.report.table import curve_table, print_curve

__all__ = ["PICTURES", "curve_table", "print_curve", "write_plots"]
