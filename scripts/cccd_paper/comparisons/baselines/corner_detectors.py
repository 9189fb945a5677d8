"""Pixel corner detectors: an 8-bit image (I, J) and named parameters in, corner pixels (K, 2) out.

Their parameters are in `cccd_paper.comparisons.parameters`; a detector that is not there runs with its
defaults.
"""

from __future__ import annotations

from cccd_paper.comparisons.baselines import Baseline
from cccd_paper.comparisons.pixel_corners import fast, harris, shi_tomasi, susan

CORNER_DETECTORS = {
    "harris": Baseline("FUSE1 (Harris)", harris, "OpenCV"),
    "shi_tomasi": Baseline("FUSE2 (Shi-Tomasi)", shi_tomasi, "OpenCV"),
    "fast": Baseline("FUSE3 (FAST)", fast, "OpenCV"),
    "susan": Baseline("SUSAN + B-spline", susan, "written from the publication"),
}
