"""Results of a state and their verdict: films, contacts, estimate of the error, leakage."""
