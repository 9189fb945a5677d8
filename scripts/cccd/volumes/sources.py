"""Sources that bring their own scan: what ``source`` may name besides ``files``."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from cccd.errors import InputError
from cccd.volumes.grid import Volume

__all__ = ["read_mni152"]


def read_mni152(organ: str, place: str) -> tuple[Volume, Volume, dict]:
    """Give the MNI ICBM 152 brain template at 1 mm, its brain mask and its provenance, from nilearn's wheel.

    Raises
    ------
    InputError
        ``organ`` is not ``brain``.
    """
    if organ != "brain":
        raise InputError(place, f"source mni152 has no organ {organ!r}", "set organ to brain")
    from nilearn import datasets  # slow to import, and only this source needs it

    image = datasets.load_mni152_template(resolution=1)
    mask = datasets.load_mni152_brain_mask(resolution=1)
    facts = {"nilearn": version("nilearn"), "template": "MNI ICBM 152 symmetric 2009a, 1 mm"}
    return (
        Volume(np.asarray(image.dataobj, np.float32), image.affine, "mni152"),
        Volume(np.asarray(mask.dataobj) > 0, mask.affine, "mni152"),
        facts,
    )
