"""A scan's labels by a trained network or by a segmenter that is installed beside."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cccd.errors import InputError, choices
from cccd.extras import needing
from cccd.geometry.arrays import AnyArray, SingleArray
from cccd.inputs.grid import Volume
from cccd.inputs.nifti_export import write_nifti
from cccd.project import PROJECT
from cccd.store import atomic_path, write_json
from cccd_networks.model_header import read_segmenter_plan
from cccd_segmentation.external import run_external
from cccd_segmentation.settings import INSTALLED_SEGMENTERS, is_installed_segmenter

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Segmentation:
    """What a segmenter found.

    Attributes
    ----------
    image : Volume
        The scan.
    labels : (a, b, c) uint8 or uint16
        On its grid, 0 outside.
    inside : (a, b, c) float32
        Probability of any label; of a segmenter that gives none, 0 or 1.
    segmenter : str
        What found it.
    warnings : list of str
        In what the scan is unlike those of the training.
    """

    image: Volume
    labels: AnyArray
    inside: SingleArray
    segmenter: str
    warnings: list[str]


def find_segmenter(name: str) -> tuple[str, str]:
    """Find what ``cccd segment`` shall use: its weights' file or its name, and the organ that it knows.

    Raises
    ------
    InputError
        Neither a file, nor shipped, nor a segmenter that can be called.
    """
    if is_installed_segmenter(name):
        return name, ""
    shipped = PROJECT / "workflow" / "models" / "segmenters"
    path = next((path for path in (Path(name), shipped / name / "nnunet.pt") if path.is_file()), None)
    if path is None:
        known = [folder.name for folder in sorted(shipped.glob("*/"))] + list(INSTALLED_SEGMENTERS)
        raise InputError(
            "--segmenter", f"there is no file {name} and none of that name is shipped", choices(known)
        )
    return str(path), str(read_segmenter_plan(path)["organ"])


def segment(image: Volume, segmenter: str | Path | Sequence[str], organ: str) -> Segmentation:
    """Find an organ in a scan.

    Parameters
    ----------
    image : Volume
        The whole scan.
    segmenter : path or str
        A file of weights, or what `cccd_segmentation.external.run_external` knows.
    organ : str
        What to look for, for those who know several; else what messages name.

    Raises
    ------
    InputError
        Weights of something else, a segmenter that is not installed, or nothing found.
    """
    name = str(segmenter if isinstance(segmenter, (str, Path)) else segmenter[0])
    if is_installed_segmenter(name):
        labels = run_external(name, image, organ)
        found = Segmentation(image, labels, (labels > 0).astype(np.float32), name, [])
    else:
        found = _by_network(image, name, organ)
    if not found.labels.any():
        hint = "; ".join(found.warnings) or "give a scan that holds it, or a mask"
        raise InputError(image.location, f"{Path(name).name} found no {organ}", hint)
    return found


@needing("segmenting by a network", "segment")
def _by_network(image: Volume, path: str, organ: str) -> Segmentation:
    from cccd_segmentation.inference import labels_of, probabilities
    from cccd_segmentation.model import load_segmenter

    model, plan = load_segmenter(path)
    notes = plan.differences(image)
    if plan.organ and organ not in plan.organ.split():
        notes.append(f"the segmenter was trained to find {plan.organ}, not {organ}")
    for note in notes:  # before the network runs, which takes minutes on a large scan
        logger.warning("%s", note)
    chances = probabilities(model, image, plan)
    labels = labels_of(chances, plan)
    narrow = labels.astype(np.uint8) if labels.max(initial=0) < 256 else labels
    return Segmentation(image, narrow, 1 - chances[0], f"{plan.network}, {Path(path).name}", notes)


def write_labels(path: str | Path, found: Segmentation) -> None:
    """Write labels as NIfTI on the scan's own grid."""
    with atomic_path(path) as temporary:
        write_nifti(temporary, found.labels, found.image.affine)


def write_segmentation(found: Segmentation, labels: str, probabilities: str, report: str) -> None:
    """Write labels and probabilities as NIfTI on the scan's grid, and what was noticed as JSON."""
    write_labels(labels, found)
    # percent: a byte a voxel, and more than a surface can tell
    with atomic_path(probabilities) as temporary:
        write_nifti(temporary, np.rint(100 * found.inside).astype(np.uint8), found.image.affine)
    facts = {
        "segmenter": found.segmenter,
        "labels": {str(value): int((found.labels == value).sum()) for value in np.unique(found.labels)[1:]},
        "warnings": found.warnings,
    }
    write_json(report, facts)
