"""One spline for a cohort: the same quads on every subject, point for point, and statistics of shape."""
