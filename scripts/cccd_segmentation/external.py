"""Segmenters that users may have installed beside: called by their own commands."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import nibabel as nib
import numpy as np

from cccd.errors import InputError, choices, nearest
from cccd.geometry.arrays import AnyArray, BoolArray
from cccd.inputs.grid import Volume, on_grid
from cccd.inputs.nifti_export import write_nifti
from cccd.inputs.readers import read_volume
from cccd_networks.devices import DEVICE
from cccd_segmentation.settings import is_installed_segmenter

_SIDES = ("left", "right")
_PAIRED = (
    "kidney", "adrenal_gland", "kidney_cyst", "iliac_artery", "iliac_vena", "humerus", "scapula", "clavicula",
    "femur", "hip", "gluteus_maximus", "gluteus_medius", "gluteus_minimus", "autochthon", "iliopsoas",
    "subclavian_artery", "common_carotid_artery", "brachiocephalic_vein",
)  # fmt: skip
_SPINE = (("C", 7), ("T", 12), ("L", 5), ("S", 1))

#: The organs of TotalSegmentator 2, task ``total``, by the names of its table.
TOTALSEGMENTATOR = (
    "spleen", "gallbladder", "liver", "stomach", "pancreas", "esophagus", "trachea", "thyroid_gland",
    "small_bowel", "duodenum", "colon", "urinary_bladder", "prostate", "sacrum", "heart", "aorta",
    "pulmonary_vein", "brachiocephalic_trunk", "atrial_appendage_left", "superior_vena_cava",
    "inferior_vena_cava", "portal_vein_and_splenic_vein", "spinal_cord", "brain", "skull", "sternum",
    "costal_cartilages", "lung_upper_lobe_left", "lung_lower_lobe_left", "lung_upper_lobe_right",
    "lung_middle_lobe_right", "lung_lower_lobe_right",
    *(f"{name}_{side}" for name in _PAIRED for side in _SIDES),
    *(f"vertebrae_{part}{number}" for part, count in _SPINE for number in range(1, count + 1)),
    *(f"rib_{side}_{number}" for side in _SIDES for number in range(1, 13)),
)  # fmt: skip


def total_names(organ: str) -> tuple[str, ...]:
    """Names of TotalSegmentator's table that make up an organ: a pair, a lung's lobes, one name.

    Raises
    ------
    InputError
        It has no such organ.

    Examples
    --------
    >>> total_names("liver"), total_names("kidneys")
    (('liver',), ('kidney_left', 'kidney_right'))
    >>> len(total_names("lungs")), len(TOTALSEGMENTATOR)
    (5, 117)
    """
    name = organ.lower().replace(" ", "_")
    known = {each.lower(): each for each in TOTALSEGMENTATOR}
    if name in known:
        return (known[name],)
    one = name.removesuffix("s")
    if one in _PAIRED:
        return tuple(f"{one}_{side}" for side in _SIDES)
    parts = tuple(each for each in TOTALSEGMENTATOR if each.startswith(f"{one}_"))
    if one in ("lung", "rib") or name == "vertebrae":
        return parts
    raise InputError("organ", f"TotalSegmentator has no {organ}", nearest(organ, TOTALSEGMENTATOR))


def run_external(name: str, image: Volume, organ: str) -> AnyArray:
    """Run an installed segmenter on a scan.

    Parameters
    ----------
    name : str
        ``totalsegmentator``, or ``nnunetv2:`` and a trained model's folder or a data set in
        ``$nnUNet_results``.
    image : Volume
    organ : str
        In the segmenter's words: TotalSegmentator's ``liver``, ``kidney_left``, ..., or a label of the
        model's ``dataset.json``.

    Returns
    -------
    (a, b, c) uint8
        1 in the organ, on the scan's grid.

    Raises
    ------
    InputError
        It is not installed, or ended with an error, or knows no such organ.
    """
    if not is_installed_segmenter(name):
        raise InputError("config key segmenter", f"{name} is no segmenter with a command", "see the docs")
    with tempfile.TemporaryDirectory() as folder:
        if name == "totalsegmentator":
            inside, affine = _run_totalsegmentator(Path(folder), image, organ)
        else:
            inside, affine = _run_nnunet(Path(folder), image, organ, name.partition(":")[2])
    moved = on_grid(Volume(inside.astype(np.uint8), affine, name), image.affine, image.shape, fill=0)
    if moved is None:
        raise InputError(image.location, f"{name}'s mask has another grid", "report this")
    return (moved.data > 0).astype(np.uint8)


def _run_totalsegmentator(folder: Path, image: Volume, organ: str) -> tuple[BoolArray, AnyArray]:
    names = total_names(organ)
    scan, found = folder / "scan.nii.gz", folder / "found"
    program = _program("TotalSegmentator", "pip install TotalSegmentator")
    write_nifti(scan, np.rint(image.data).astype(np.int16), image.affine)
    arguments = ["-i", scan, "-o", found, "--roi_subset", *names]
    masks = [found / f"{each}.nii.gz" for each in names]
    _call([program, *map(str, arguments)], image, organ, masks)
    volumes = [read_volume(mask) for mask in masks]
    return np.any([volume.data > 0 for volume in volumes], axis=0), volumes[0].affine


def _run_nnunet(folder: Path, image: Volume, organ: str, model: str) -> tuple[BoolArray, AnyArray]:
    program = _program("nnUNetv2_predict_from_modelfolder", "pip install nnunetv2")
    trained = _model_folder(model)
    wanted = _labels_of_dataset(trained / "dataset.json", organ)
    given, found = folder / "given", folder / "found"
    given.mkdir()
    nib.save(nib.Nifti1Image(np.asarray(image.data, np.float32), image.affine), given / "scan_0000.nii.gz")
    folds = sorted(path.name.removeprefix("fold_") for path in trained.glob("fold_*"))
    device = "cuda" if shutil.which("nvidia-smi") and os.environ.get(DEVICE) != "cpu" else "cpu"
    arguments = ["-i", given, "-o", found, "-m", trained, "-f", *folds, "-device", device]
    mask = found / "scan.nii.gz"
    _call([program, *map(str, arguments)], image, organ, [mask])
    volume = read_volume(mask)
    return np.isin(np.rint(volume.data), wanted), volume.affine


def _program(command: str, installation: str) -> str:
    program = shutil.which(command)
    if program is None:
        raise InputError("config key segmenter", f"{command} is not installed", installation)
    return program


def _call(command: Sequence[str], image: Volume, organ: str, made: Sequence[Path]) -> None:
    """Run a command that is to leave files; its last line is the error where it does not."""
    run = subprocess.run(list(command), capture_output=True, text=True, check=False)
    if run.returncode or not all(path.is_file() for path in made):
        said = next((line for line in reversed(run.stderr.splitlines()) if line.strip()), "no word")
        name = Path(command[0]).name
        raise InputError(
            image.location, f"{name} found no {organ} ({said.strip()})", "run it by hand to see more"
        )


def _model_folder(model: str) -> Path:
    """Folder of a trained nnU-Net: given, or the first of a data set in ``$nnUNet_results``, 3D before 2D."""
    here = [Path(model)] if model else []
    results = os.environ.get("nnUNet_results")  # noqa: SIM112 - its own spelling
    there = sorted(Path(results, model).glob("*__*"), reverse=True) if results and model else []
    for folder in (*here, *(path for path in there if path.name.endswith("3d_fullres")), *there):
        if (folder / "dataset.json").is_file() and any(folder.glob("fold_*")):
            return folder
    raise InputError(
        "config key segmenter",
        f"there is no trained nnU-Net {model or 'named'}",
        "give nnunetv2:FOLDER with its dataset.json and fold_0, or nnunetv2:Dataset... in $nnUNet_results",
    )


def _labels_of_dataset(listing: Path, organ: str) -> list[int]:
    """Label values of an organ in a model's ``dataset.json``."""
    try:
        plan = json.loads(listing.read_text(encoding="utf-8"))
        labels = {str(name).lower(): np.atleast_1d(value).tolist() for name, value in plan["labels"].items()}
        channels = len(plan.get("channel_names", [0]))
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(str(listing), f"no list of labels ({type(error).__name__})", "restore it") from None
    if channels > 1:
        raise InputError(str(listing), f"it needs {channels} images of each patient", "use a model of one")
    known = [name for name in labels if name != "background"]
    if organ.lower() not in known:
        raise InputError(str(listing), f"it has no label {organ!r}", choices(known))
    return [int(value) for value in labels[organ.lower()]]
