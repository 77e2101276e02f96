"""Around the compiler: cache, build, check against the oracle, command line."""
