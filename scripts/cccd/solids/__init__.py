"""Solids: the final mesh as closed bodies for CAD, of B-spline patches or of facets."""
