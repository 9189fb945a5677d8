"""Structures that no mask gives away: a scan as scanners make them, and damaged boundary maps.

The mask stays beside them as ground truth: what finds the organ never sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage

from cccd.containers import Structure
from cccd.geometry.arrays import FloatArray
from cccd.inputs.grid import Volume

#: Voxels of the template that become one: 2 x 2 x 5 mm, a quick clinical scan, and seconds to order.
EVERY = (2, 2, 5)

#: BrainWeb's middle level of noise, 3 %, and its stronger field, 40 %: factors from 0.8 to 1.2.
NOISE, BIAS = 0.03, 0.4

#: How much maps are damaged, as in the comparison of the decoders.
SEVERITY = 1.0

#: Values along each axis between which the bias field runs smoothly.
_LATTICE = 3

#: Background that damage may spread to beyond the crop, in pixels: spurs are up to 12.5 long.
_ROOM_PX = 16


def rescan(
    image: Volume,
    mask: Volume,
    rng: np.random.Generator,
    every: tuple[int, int, int] = EVERY,
    noise: float = NOISE,
    bias: float = BIAS,
) -> tuple[Volume, Volume]:
    """Scan a clean volume again: larger voxels, a coil's bias field, the noise of magnitude images.

    Parameters
    ----------
    image, mask : Volume
        Clean grey values, 0 in the background, and the organ, on one grid.
    rng : Generator
    every : (int, int, int)
        Voxels that become one, along each axis.
    noise : float
        Its standard deviation, as a share of the brightest tissue. It is Rician (Gudbjartsson and Patz,
        Magn. Reson. Med. 34:910, 1995): Gaussian in both channels of the signal, of which the image is the
        magnitude.
    bias : float
        How far the field spreads one tissue's grey values, as a share of their mean.

    Returns
    -------
    image, mask : Volume
        The scan (float32), and the voxels of which the organ fills half or more.
    """
    grey, share = (coarser(volume, every) for volume in (image, mask))
    signal = grey.data * bias_field(rng, grey.shape, bias)
    real, imaginary = rng.normal(0, noise * float(grey.data.max()), (2, *grey.shape))
    scanned = np.hypot(signal + real, imaginary).astype(np.float32)
    return replace(grey, data=scanned), replace(share, data=share.data >= 0.5)


def coarser(volume: Volume, every: tuple[int, int, int]) -> Volume:
    """Average blocks of voxels, as a scanner does over its larger ones; an incomplete block is left out.

    Parameters
    ----------
    volume : Volume
    every : (int, int, int)
        Voxels of a block along each axis.
    """
    blocks = np.array(volume.shape) // every
    a, b, c = blocks * every
    (i, j, k), (di, dj, dk) = blocks, every
    data = volume.data[:a, :b, :c].reshape(i, di, j, dj, k, dk).mean(axis=(1, 3, 5), dtype=np.float32)
    step = np.diag([*every, 1.0])
    step[:3, 3] = (np.array(every) - 1) / 2  # a block's centre
    return replace(volume, data=data, affine=volume.affine @ step)


def bias_field(rng: np.random.Generator, shape: tuple[int, int, int], spread: float) -> FloatArray:
    """Smooth factors (shape) from ``1 - spread / 2`` to ``1 + spread / 2``, both reached.

    Examples
    --------
    >>> field = bias_field(np.random.default_rng(0), (20, 20, 9), 0.4)
    >>> round(float(field.min()), 3), round(float(field.max()), 3)
    (0.8, 1.2)
    """
    lattice = rng.standard_normal((_LATTICE,) * 3)
    smooth = ndimage.zoom(lattice, np.array(shape) / _LATTICE, order=2, mode="nearest")
    return 1 + spread * ((smooth - smooth.min()) / np.ptp(smooth) - 0.5)


def damage_maps(
    structure: Structure, rng: np.random.Generator, kinds: Sequence[str] = (), severity: float = SEVERITY
) -> Structure:
    """Take a masked structure's boundary maps, each slice's damaged in one way, in place of its image.

    Parameters
    ----------
    structure : Structure
        With a mask, which stays as ground truth, and so does a true surface.
    rng : Generator
    kinds : sequence of str
        Of which each slice has one, drawn by chance: all but for undamaged maps by default.
    severity : float

    Returns
    -------
    Structure
        With ``boundary``, without an image; ``provenance["damaged"]`` says which slice was damaged how.
    """
    from cccd_datasets.corruptions import KINDS, corrupt  # OpenCV draws them

    kinds = kinds or [kind for kind in KINDS if kind not in ("clean", "everything")]
    axis = structure.frame.slice_axis
    room = [(0, 0) if along == axis else (_ROOM_PX, _ROOM_PX) for along in range(3)]
    roomy = replace(
        structure,
        image=None,
        mask=np.pad(structure.mask, room) if structure.mask is not None else None,
        origin=np.asarray(structure.origin) - [before for before, _ in room],
    )
    planes = roomy.required_stack("mask").astype(np.uint8)
    chosen = {int(s): str(rng.choice(kinds)) for s in np.flatnonzero(planes.any(axis=(1, 2)))}
    maps = np.zeros(planes.shape, bool)
    for s, kind in chosen.items():
        maps[s] = corrupt(rng, planes[s], kind, severity)
    first = int(roomy.stack_origin[0])
    damaged = {str(first + s): kind for s, kind in chosen.items()}
    how = {"severity": severity, "kinds": list(kinds)}
    return replace(
        roomy,
        boundary=np.moveaxis(maps, 0, axis),
        provenance=structure.provenance | {"damage": how, "damaged": damaged},
    )
