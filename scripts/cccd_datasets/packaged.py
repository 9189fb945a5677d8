"""Scans that come with a package."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from cccd.errors import InputError, nearest
from cccd.geometry.arrays import AnyArray
from cccd.inputs.grid import Volume, check_affine
from cccd.inputs.readers import read_volume

if TYPE_CHECKING:
    import pyvista
    from nibabel.spatialimages import SpatialImage

#: Labels of the chest CT's segmentation, by organ.
_CHEST = {"lungs": (5, 6), "right_lung": (5,), "left_lung": (6,)}


def read_mni152(organ: str, location: str) -> tuple[Volume, Volume, dict[str, Any]]:
    """Read the MNI ICBM 152 brain template at 1 mm from nilearn's wheel.

    Parameters
    ----------
    organ, location : str
        The row's organ, and what messages name.

    Returns
    -------
    image, mask : Volume
        Grey values (float32) and brain (bool).
    provenance : dict
        Version, template and SHA-256.

    Raises
    ------
    InputError
        ``organ`` is not ``brain``.
    """
    if organ != "brain":
        raise InputError(location, f"source mni152 has no organ {organ!r}", "set organ to brain")
    from nilearn import datasets  # slow to import, and only this source needs it

    # nilearn declares a union of everything that its loaders return
    image = cast("SpatialImage", datasets.load_mni152_template(resolution=1))
    mask = cast("SpatialImage", datasets.load_mni152_brain_mask(resolution=1))
    grey, inside = np.asarray(image.dataobj, np.float32), np.asarray(mask.dataobj) > 0
    facts = {
        "nilearn": version("nilearn"),
        "template": "MNI ICBM 152 symmetric 2009a, 1 mm",
        "sha256": hashlib.sha256(grey.tobytes() + inside.tobytes()).hexdigest(),  # image, then mask
    }
    return (
        Volume(grey, check_affine(image.affine, location), "mni152"),
        Volume(inside, check_affine(mask.affine, location), "mni152"),
        facts,
    )


def read_chest_ct(organ: str, location: str) -> tuple[Volume, Volume, dict[str, Any]]:
    """Read the CT of a chest that slicerio's wheel has among its data, and lungs of its segmentation.

    The scan is a person's: 128 x 128 x 34 voxels of 3.05 x 3.05 x 10 mm. The segmentation leaves the large
    vessels out.

    Parameters
    ----------
    organ, location : str
        ``lungs``, ``right_lung`` or ``left_lung``, and what messages name.

    Returns
    -------
    image, mask : Volume
        HU (float32) and organ (bool).
    provenance : dict
        Version and SHA-256.

    Raises
    ------
    InputError
        slicerio is not installed, or no such organ.
    """
    if organ not in _CHEST:
        raise InputError(location, f"source chest_ct has no organ {organ!r}", nearest(organ, list(_CHEST)))
    found = find_spec("slicerio")  # not imported: only its files are of use
    if found is None or found.origin is None:
        raise InputError(
            location, "source chest_ct is a scan of the package slicerio", "pip install slicerio"
        )
    folder = Path(found.origin).parent / "data"
    image, labels = read_volume(folder / "CTChest4.nrrd"), read_volume(folder / "Segmentation.seg.nrrd")
    grey, inside = image.data.astype(np.float32), np.isin(labels.data, _CHEST[organ])
    facts = {
        "slicerio": version("slicerio"),
        "scan": "CTChest4, 3.05 x 3.05 x 10 mm",
        "sha256": hashlib.sha256(grey.tobytes() + inside.tobytes()).hexdigest(),  # image, then mask
    }
    return Volume(grey, image.affine, "chest_ct"), Volume(inside, labels.affine, "chest_ct"), facts


def read_whole_body_ct(organ: str, location: str) -> tuple[Volume, Volume, dict[str, Any]]:
    """Read the male whole-body CT of PyVista's examples (TotalSegmentator s1397, CC BY 4.0) and one organ.

    PyVista downloads it once into its own cache and tries three times. The first download's SHA-256 is kept
    beside it; every later read is compared with it.

    Parameters
    ----------
    organ, location : str
        The row's organ, and what messages name.

    Returns
    -------
    image, mask : Volume
        HU (float32) and organ (bool).
    provenance : dict
        PyVista's version and SHA-256 of the voxels.

    Raises
    ------
    InputError
        No network at the first use, changed data, or no such organ (lists those there are).
    """
    file, dataset = _download_whole_body_ct(location)
    scan = cast("pyvista.ImageData", dataset["ct"])
    organs = cast("pyvista.MultiBlock", dataset["segmentations"])
    if organ not in organs.keys():  # noqa: SIM118 (a MultiBlock iterates over blocks)
        raise InputError(
            location, f"source whole_body_ct has no organ {organ!r}", nearest(organ, organs.keys())
        )
    affine = np.eye(4)
    affine[:3, :3] = np.asarray(scan.direction_matrix) * scan.spacing
    affine[:3, 3] = scan.origin
    affine = check_affine(affine, location)
    grey, inside = _voxels(scan), _voxels(cast("pyvista.ImageData", organs[organ])) > 0
    digest = hashlib.sha256(np.ascontiguousarray(grey).data).hexdigest()
    _compare_checksum(file, digest, location)
    facts = {"pyvista": version("pyvista"), "files": {"whole_body_ct_male": digest}}
    return (
        Volume(grey.astype(np.float32), affine, "whole_body_ct"),
        Volume(inside, affine, "whole_body_ct"),
        facts,
    )


def _download_whole_body_ct(location: str) -> tuple[Path, pyvista.MultiBlock]:
    """Download, or find in the cache, the whole-body CT: its file and what it holds."""
    from pyvista import examples  # slow to import, and only this source needs it

    try:
        file = Path(examples.download_whole_body_ct_male(load=False))
        return file, cast("pyvista.MultiBlock", examples.download_whole_body_ct_male())
    except (OSError, RuntimeError, ValueError) as error:  # requests' errors are OSErrors
        reason = type(error).__name__
        raise InputError(
            location,
            f"the whole-body CT cannot be downloaded ({reason})",
            "connect to the network once, or delete PyVista's cache when it is damaged",
        ) from None


def _voxels(block: pyvista.ImageData) -> AnyArray:
    """Scalars (a, b, c) of a grid."""
    return np.asarray(block.active_scalars).reshape(block.dimensions, order="F")


def _compare_checksum(file: Path, digest: str, location: str) -> None:
    """Compare with the checksum kept beside a file, or keep it there at the first use."""
    kept = file.with_name(f"{file.name}.cccd.sha256")
    if kept.is_file():
        if kept.read_text().strip() != digest:
            raise InputError(
                location,
                "the downloaded whole-body CT has changed since its first use",
                f"delete {file.parent}",
            )
        return
    try:
        kept.write_text(f"{digest}\n")
    except OSError:  # a read-only cache belongs to someone else
        return
