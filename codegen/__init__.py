"""The compiler: from a model of SymPy to lean C with an exact tangent."""
