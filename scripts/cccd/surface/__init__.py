"""Surfaces: from a stack of slices to one closed spline.

`loft` reads as the whole pipeline, one module per step: `borders` (distances within slices), `stack` (in
space, on slices and between them, by `learned_distance`), `smooth_mesh` (their zero level, low-passed),
`spline` (control mesh, fit, refinement), `checks` (what must hold).
"""
