"""Training data of the segmentation networks: labelled scans on the working grid, held in memory, varied."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from monai.data.meta_tensor import MetaTensor
from monai.transforms.compose import Compose
from monai.transforms.croppad.dictionary import RandCropByPosNegLabeld, SpatialPadd
from monai.transforms.intensity.dictionary import (
    RandAdjustContrastd,
    RandGaussianNoised,
    RandScaleIntensityd,
    RandShiftIntensityd,
)
from monai.transforms.spatial.dictionary import RandAffined, RandFlipd
from torch import Tensor

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray
from cccd.inputs.grid import Volume
from cccd_segmentation.grids import WorkingGrid
from cccd_segmentation.plan import Plan, make_intensity, orientation_of, spacing_of
from cccd_segmentation.settings import SegmentationSettings

#: Fewer patients cannot be split.
_FEWEST = 2

# How patches are varied: largest rotation about each axis, as patients lie so much askew; largest change of
# size along each axis, of the order of the difference between adults; largest change of contrast, and of
# brightness in standard deviations, as scanners differ; and the standard deviation of added noise, in those
# of the image. None was swept.
_ROTATION_DEG = 12.0
_SCALING = 0.15
_INTENSITY = 0.15
_NOISE = 0.1


@dataclass(frozen=True)
class LabelledScan:
    """A scan with its labels, as they were read.

    Attributes
    ----------
    patient : str
        Whose it is.
    image : Volume
        Grey values.
    labels : (a, b, c) uint8
        0 outside, 1, 2, ... the classes; on the image's grid.
    source : str
        As the cohort sheet names it: ``files``, ``phantom``.
    """

    patient: str
    image: Volume
    labels: AnyArray
    source: str = ""


@dataclass(frozen=True)
class Example:
    """A scan as a network sees it: ``image`` (1, h, w, d) float32 and ``labels`` (1, h, w, d) uint8."""

    patient: str
    image: Tensor
    labels: Tensor


def split_patients(
    scans: Sequence[LabelledScan], test_share: float, seed: int
) -> tuple[list[LabelledScan], list[LabelledScan]]:
    """Split scans into those that train and those held out, never one patient into both.

    Scans with equal voxels count as one patient's, whatever their names.

    Raises
    ------
    InputError
        Fewer than two patients.

    Examples
    --------
    >>> def scan(patient, grey):
    ...     return LabelledScan(patient, Volume(np.full((2, 2, 2), grey), np.eye(4), ""), np.zeros((2, 2, 2)))
    >>> train, test = split_patients([scan("a", 1), scan("b", 2), scan("c", 1), scan("d", 3)], 0.5, seed=1)
    >>> {"a", "c"} <= {s.patient for s in train} or {"a", "c"} <= {s.patient for s in test}
    True
    """
    voxels = [hashlib.sha256(np.ascontiguousarray(scan.image.data).data).hexdigest() for scan in scans]
    group = {scan.patient: scan.patient for scan in scans}
    first: dict[str, str] = {}
    for scan, digest in zip(scans, voxels, strict=True):
        one, other = group[scan.patient], group[first.setdefault(digest, scan.patient)]
        group = {patient: one if name == other else name for patient, name in group.items()}
    patients = sorted(set(group.values()))
    if len(patients) < _FEWEST:
        raise InputError(
            "training sheet", f"it has {len(patients)} patient", "give two or more: one is held out to score"
        )
    order = np.random.default_rng(seed).permutation(len(patients))
    count = min(max(1, round(test_share * len(patients))), len(patients) - 1)
    held = {patients[index] for index in order[:count]}
    return (
        [scan for scan in scans if group[scan.patient] not in held],
        [scan for scan in scans if group[scan.patient] in held],
    )


def make_plan(
    scans: Sequence[LabelledScan],
    network: str,
    width: int,
    sizes: dict[str, object],
    settings: SegmentationSettings,
    organ: str,
    seed: int,
) -> Plan:
    """Decide how a network will see scans, from those that train it."""
    orientation = orientation_of(scans[0].image.affine)
    spacings = np.array([spacing_of(scan.image.affine, orientation) for scan in scans])
    first, second, third = settings.spacing_mm or np.median(spacings, axis=0).tolist()
    intensity = make_intensity([scan.image.data for scan in scans], [scan.labels for scan in scans])
    greys = np.round([intensity.percentiles(scan.image.data) for scan in scans], 4)
    return Plan(
        network=network,
        width=width,
        sizes=dict(sizes),
        labels=settings.labels or (1,),
        orientation=orientation,
        spacing=(first, second, third),
        intensity=intensity,
        patch=settings.patch,
        flip_axes=settings.flip_axes,
        organ=organ,
        source=" ".join(sorted({scan.source for scan in scans})),
        greys=tuple(zip(greys.min(axis=0).tolist(), greys.max(axis=0).tolist(), strict=True)),
        seed=seed,
    )


def prepare(scan: LabelledScan, plan: Plan) -> Example:
    """Move a labelled scan to the working grid and scale its grey values."""
    grid = WorkingGrid.of(scan.image.affine, plan)
    image = grid.forward(plan.intensity(scan.image.data))
    # each label by its own share of a voxel: the nearest voxel's label would jag thin parts
    shares = torch.cat([grid.forward(scan.labels == value) for value in range(1, plan.classes)])
    outside = 1 - shares.sum(0, keepdim=True)
    labels = torch.cat([outside, shares]).argmax(0, keepdim=True).to(torch.uint8)
    return Example(scan.patient, image, labels)


def _augmentation(plan: Plan) -> Compose:
    """Make a patch of an example: cropped around what it has, turned, stretched, flipped, greys varied."""
    both, grey = ("image", "labels"), ("image",)
    turn = np.radians(_ROTATION_DEG)
    return Compose(
        [
            SpatialPadd(both, plan.patch, mode="edge"),
            RandCropByPosNegLabeld(both, "labels", plan.patch, pos=2, neg=1, num_samples=1),
            RandAffined(
                both,
                prob=0.8,
                rotate_range=(turn, turn, turn),
                scale_range=(_SCALING,) * 3,
                mode=("bilinear", "nearest"),
                padding_mode="border",
            ),
            *(RandFlipd(both, prob=0.5, spatial_axis=axis) for axis in plan.flip_axes),
            RandScaleIntensityd(grey, _INTENSITY, prob=0.5),
            RandShiftIntensityd(grey, _INTENSITY, prob=0.5),
            RandAdjustContrastd(grey, prob=0.2, gamma=(0.7, 1.4), retain_stats=True),
            RandGaussianNoised(grey, prob=0.2, std=_NOISE),
        ]
    )


def batches(
    examples: Sequence[Example], plan: Plan, settings: SegmentationSettings, epoch: int, seed: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """Draw an epoch's patches, each example once: images (b, 1, h, w, d) float32, labels the same in int64.

    They depend on ``seed`` and ``epoch`` alone, so that a resumed training sees the same.
    """
    rng = np.random.default_rng([seed, epoch])
    augmentation = _augmentation(plan)
    augmentation.set_random_state(seed=int(rng.integers(2**31)))
    order = rng.permutation(len(examples))
    for start in range(0, len(order), settings.batch_size):
        chosen = [examples[index] for index in order[start : start + settings.batch_size]]
        drawn = [_draw(augmentation, one) for one in chosen]
        images, labels = (torch.stack([pair[part] for pair in drawn]) for part in (0, 1))
        yield images.float(), labels.long()


def _draw(augmentation: Compose, example: Example) -> tuple[Tensor, Tensor]:
    """One patch of an example: image and labels (1, h, w, d)."""
    (patch,) = cast(
        "list[dict[str, MetaTensor]]", augmentation({"image": example.image, "labels": example.labels})
    )
    return patch["image"].as_tensor(), patch["labels"].as_tensor()
