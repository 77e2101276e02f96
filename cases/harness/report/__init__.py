"""Self-contained reports of runs: one file of HTML that works offline, and tables for a sheet."""
