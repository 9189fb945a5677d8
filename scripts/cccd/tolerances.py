"""Numerical tolerances that several modules share; any other stands beside the code that uses it.

Lengths are in the unit that the name ends with; what has no unit in its name is dimensionless.
"""

from __future__ import annotations

#: Relative error within which two floating-point results count as equal.
ROUNDING = 1e-9

#: Squared lengths and pivots count as at least this, so that one can divide by them.
TINY = 1e-300

#: Speeds along a curve count as at least this.
STILL = 1e-12

#: Axes whose cosine exceeds this are not at right angles: slices are tilted, pixels would be no rectangles.
ORTHOGONALITY = 1e-3

#: Coordinates of stored control points are rounded by at most this share of a pixel: zero bits pack well.
CONTROL_POINT_PIXELS = 0.008

#: Smoothed distances enclose this share of a part of few voxels.
SHRUNK_PART = 0.5

#: Weight of a control polygon's bending against the data's; it only decides what the data leave open.
RIDGE = 1e-7

#: A surface that is moved until it holds a volume holds it but for this share.
HELD_VOLUME = 1e-4

#: A solid whose volume differs from its mesh's by more than this share gets a warning.
SOLID_VOLUME = 0.005

#: Grey values that span no more than this, in their own units, have no contrast to scale by.
CONTRAST = 1e-6

#: Triangles and radii smaller than this, in pixels, count as this small where they divide or weigh.
LEAST_PX = 1e-6
