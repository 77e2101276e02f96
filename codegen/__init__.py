"""The compiler: from a page of SymPy to lean C with an exact tangent."""
