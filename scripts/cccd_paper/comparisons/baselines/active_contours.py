"""Active contours: corner points (K, 2) or an image, and a seed circle in; a closed curve (n, 2) out."""

from __future__ import annotations

from cccd_paper.comparisons.active_contour import b_spline_snake, image_snake
from cccd_paper.comparisons.baselines import Baseline

CONTOURS = {
    "corners": Baseline("B-spline snake on corners", b_spline_snake, "as the paper used Marsousi et al."),
    "grey": Baseline("B-spline snake on the image", image_snake, "after Marsousi et al., forces ours"),
}
