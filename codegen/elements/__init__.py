"""Elements: reference cells, shape functions and quadrature rules, exact until printed."""
