"""Tetrahedra through organs, for simulation: regions, named boundaries, quality, files."""
