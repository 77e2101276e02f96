"""Definition of a boundary-value problem: blocks of elements, loads, supports, as written down."""
