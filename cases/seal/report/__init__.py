"""Pictures, tables and pages of the runs of a seal."""
