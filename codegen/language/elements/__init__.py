"""Elements: shape functions, quadrature rules and unit cells."""
