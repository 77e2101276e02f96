"""Files of a mesh in parts."""
