"""Mesh files: Gmsh, Abaqus and CalculiX, all other formats by meshio, and meshes in parts."""
