"""Interpolate masks between their slices by ITK, in a process of its own.

``python interpolate_contours.py GIVEN FILLED [GIVEN FILLED ...]``: arrays (slice, i, j) of uint8 as NumPy
files; empty slices are filled. ITK beside SimpleITK and VTK can crash a process when it ends, and takes long
to load.
"""

import sys
from pathlib import Path

import numpy as np


def interpolate(given: Path, filled: Path) -> None:
    """Fill the slices of a file by morphological contour interpolation (Zukić et al. 2016)."""
    import itk  # pyright: ignore[reportMissingImports]

    labels = itk.image_from_array(np.load(given))
    result = itk.morphological_contour_interpolator(labels, axis=2, label=1)
    np.save(filled, itk.array_from_image(result))


if __name__ == "__main__":
    for name, result in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
        interpolate(Path(name), Path(result))
