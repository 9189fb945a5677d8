"""A whole head drawn around a skull-stripped brain: what a threshold meets in a T1 image.

The brain keeps its grey values. Around it lie fluid, dura, the skull's two tables with marrow between them,
fat and skin, in shells whose thickness varies by chance, and where the fluid is thinner than a voxel the
dura touches the brain; muscles, face, orbits with their nerves, sinuses of blood and of air, and the
pituitary gland. Grey values are those of T1 images.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import AnyArray, SingleArray
from cccd.inputs.grid import Volume
from cccd_datasets.implicit_solids import (
    Tissue,
    capsule,
    ellipsoid,
    interpolate_lattice,
    paint_tissues,
    union,
)

# Grey values of T1 images (spoiled gradient echo at 1.5 T) beside white matter, whose value is one.
_AIR, _BONE, _FLUID, _BLOOD, _MUSCLE, _DURA, _MARROW, _FAT = 0.0, 0.06, 0.22, 0.42, 0.5, 0.55, 0.75, 1.1
_NERVE, _GLAND, _SKIN = 0.8, 0.7, 0.55

#: White matter has the largest grey values of a brain: above this quantile.
_WHITE_QUANTILE = 0.8

# Shells from the brain outwards: value, mean thickness in mm and its standard deviation as a share; and those
# that lie on the skull where no muscle or face does.
_SHELLS = ((_FLUID, 2.2, 0.6), (_DURA, 1.0, 0.3), (_BONE, 1.8, 0.2), (_MARROW, 2.5, 0.4), (_BONE, 1.8, 0.2))
_SCALP = ((_FAT, 3.5, 0.3), (_SKIN, 2.0, 0.2))

# The shells follow the brain's mask, blurred by so many mm to bridge its sulci, at this level.
_HULL_MM, _HULL_LEVEL = 4.0, 0.4

# Thickness varies from one end to the other of this distance, mm.
_VARIES_MM = 25


def draw_head(image: Volume, brain: Volume, rng: np.random.Generator) -> Volume:
    """Draw a head around a brain.

    Parameters
    ----------
    image, brain : Volume
        Grey values, and the brain (bool), on one grid of 1 mm in the space of the MNI template.
    rng : Generator
        Draws the shells' thickness.

    Returns
    -------
    Volume
        Grey values (float32), those of white matter about one.
    """
    inside, shape = brain.data, np.array(image.shape)
    origin, step = image.affine[:3, 3], np.diag(image.affine)[:3]
    hull = (ndimage.gaussian_filter(inside.astype(np.float32), _HULL_MM) > _HULL_LEVEL) | inside
    away = np.asarray(ndimage.distance_transform_edt(~hull), np.float32) - np.float32(0.5)
    soft = paint_tissues(np.zeros(shape, np.float32), _soft_tissues(), origin, step)
    outer = np.zeros(shape, np.float32)
    shells: list[tuple[float, SingleArray]] = []
    for value, thickness, spread in (*_SHELLS, *_SCALP):
        outer = outer + np.maximum(thickness * (1 + spread * _wander(rng, shape)), 0)
        shells.append((value, outer))
    grey = _covered(np.zeros_like(soft), shells[len(_SHELLS) :], away)
    grey = _covered(np.where(soft > 0, soft, grey), shells[: len(_SHELLS)], away)
    grey = paint_tissues(grey, _through_the_skull(), origin, step)
    grey[hull] = _FLUID
    grey[inside] = image.data[inside] / np.quantile(image.data[inside], _WHITE_QUANTILE)
    return Volume(grey, image.affine, image.location)


def _covered(
    grey: SingleArray, shells: Sequence[tuple[float, SingleArray]], away: SingleArray
) -> SingleArray:
    """Cover grey values by shells, from the outer one inwards, each with an edge one voxel wide."""
    for value, border in reversed(shells):
        grey += np.clip(border - away + 0.5, 0, 1) * (value - grey)
    return grey


def _wander(rng: np.random.Generator, shape: AnyArray) -> SingleArray:
    """Draw values (shape) of standard deviation about one that vary smoothly."""
    lattice = rng.standard_normal(shape // _VARIES_MM + 2, dtype=np.float32)
    return interpolate_lattice(lattice, np.full(3, _VARIES_MM), shape)


def _soft_tissues() -> list[Tissue]:
    """Neck, muscles and face, which the skull's shells cover."""
    sides = (1, -1)
    return [
        (ellipsoid((0, -5, -60), (84, 112, 110)), _FAT),
        (ellipsoid((0, -5, -60), (80, 108, 106)), _MUSCLE),
        (ellipsoid((0, 78, -60), (48, 40, 45)), _FAT),
        (ellipsoid((0, 72, -62), (26, 36, 26)), _MUSCLE),
        *((ellipsoid((side * 72, 18, -28), (9, 34, 40)), _MUSCLE) for side in sides),  # temporal muscle
        *((ellipsoid((side * 36, 58, -62), (15, 18, 17)), _AIR) for side in sides),  # maxillary sinuses
        (ellipsoid((0, 48, -52), (11, 26, 15)), _AIR),  # ethmoid cells
        *((ellipsoid((side * 60, -48, -48), (12, 14, 14)), _AIR) for side in sides),  # mastoid cells
    ]


def _through_the_skull() -> list[Tissue]:
    """Parts near the brain that no shell has: sinuses of blood and air, orbits, nerves, the pituitary."""
    sides = (1, -1)
    sagittal = union(
        capsule((0, 68, 20), (0, 20, 84), 4),
        capsule((0, 20, 84), (0, -50, 84), 5),
        capsule((0, -50, 84), (0, -108, 10), 5),
    )
    return [
        *((ellipsoid((side * 32, 60, -36), (19, 26, 18)), _FAT) for side in sides),  # orbits
        *((capsule((side * 42, 36, -36), (side * 44, 62, -38), 3), _MUSCLE) for side in sides),
        *((ellipsoid((side * 32, 68, -37), (12, 12, 12)), _FLUID) for side in sides),  # eyes
        *((capsule((side * 32, 58, -37), (0, 8, -20), 2.5), _NERVE) for side in sides),  # optic nerves
        (ellipsoid((0, 62, 2), (20, 9, 14)), _AIR),  # frontal sinus
        (sagittal, _BLOOD),
        *((capsule((0, -100, -14), (side * 58, -58, -32), 4.5), _BLOOD) for side in sides),  # transverse
        *((ellipsoid((side * 13, 0, -35), (8, 14, 8)), _BLOOD) for side in sides),  # cavernous
        *((capsule((side * 12, -22, -38), (side * 26, -2, -42), 3.5), _NERVE) for side in sides),
        (ellipsoid((0, 1, -35), (6, 5, 5)), _GLAND),
    ]
