"""What everything else speaks: meshes, ragged polygons, grids, B-splines, and what is measured on them.

One of each. Nothing here knows an organ, a slice stack or a file of the pipeline; lengths are in the unit
of the coordinates, mostly mm.
"""
