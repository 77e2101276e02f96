"""The records of a seal: keys that belong together, with what follows from them alone."""
