"""The solution of a state: dry contact, film, next speed, and a mesh that resolves them."""
