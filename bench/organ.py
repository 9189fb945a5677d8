"""The organ that every benchmark works on: a lobed ellipsoid with a cavity, of as many slices as wanted."""

import numpy as np

from cccd.containers import Frame, Structure

#: In-plane pixels of the grid; an outline of a middle slice is about 600 pixels long.
WIDTH = 224


def make_organ(slices: int) -> Structure:
    """Give mask and image of the organ; twice the slices are twice the voxels and twice the boundary pixels.

    Parameters
    ----------
    slices : int
        Slices that the organ meets.
    """
    k = (np.arange(slices + 4) - (slices + 3) / 2) / (slices / 2)
    i, j = np.indices((WIDTH, WIDTH)) / (WIDTH / 2) - 1
    angle, radius = np.arctan2(j, i), np.hypot(i, j)
    outline = 0.7 * (1 + 0.12 * np.cos(3 * angle) + 0.05 * np.sin(7 * angle))
    cavity = np.hypot(i - 0.15, j + 0.1) / 0.18
    depth = np.sqrt(np.clip(1 - k**2, 0, None))[:, None, None]
    mask = (radius < outline * depth) & ~((cavity < depth) & (np.abs(k) < 0.5)[:, None, None])
    image = np.where(mask, 110.0, -60.0) + np.random.default_rng(0).normal(0, 12, mask.shape)
    frame = Frame(np.diag([0.8, 0.8, 2.5, 1.0]), 2, (WIDTH, WIDTH, slices + 4))
    return Structure(
        "bench",
        "organ",
        frame,
        np.zeros(3, int),
        image=np.moveaxis(image, 0, 2).astype(np.float32),
        mask=np.moveaxis(mask, 0, 2),
    )
