"""The meaning of a state, and how far to trust it: films, contacts, verdict, leakage."""
