"""The way to a state: dry contact, film, falling speed, and the mesh that suits them."""
