"""Worked problems, one file each, with the command line and the report of a run."""
