"""Solids: closed bodies for CAD, of the spline's patches or of facets; USD."""
