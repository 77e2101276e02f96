"""Outlines and meshes of sections: layers along a boundary, a graded interior, mesh transfer."""
