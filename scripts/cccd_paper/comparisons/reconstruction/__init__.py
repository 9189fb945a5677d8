"""Curve reconstruction from points alone: one file per algorithm, all ``points (N, 2) -> links (M, 2)``.

Written from the publications on Delaunay triangulations. Where a publication leaves something open, or
its text could not be had, the docstring says what was taken.
"""
