"""What a trained network expects: its sizes, its labels, and the grid and grey values of its scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import nibabel as nib
import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, FloatArray, SingleArray
from cccd.inputs.grid import Volume, find_slice_axis

#: Air in HU, or nearly: grey values that no MR image has.
_AIR_HU = -300.0

#: Relative difference of spacings above which a scan is reported as unlike those of the training.
_UNLIKE = 0.5

#: Percentiles of grey values by which a scan is compared with those of the training.
_PERCENTILES = (10, 50, 90)

#: How far outside the training's range a percentile may lie, in widths of the range, and at the least in the
#: network's units: few training scans do not show all that a scanner does.
_BEYOND, _LEAST_BEYOND = 1.0, 0.25


@dataclass(frozen=True)
class Intensity:
    """How grey values become the network's.

    Attributes
    ----------
    modality : str
        ``CT`` (grey values have a meaning: one scale for all scans) or ``MR`` (each scan has its own scale).
    low, high, mean, std : float
        CT: bounds, mean and standard deviation in HU. Unused for MR.
    """

    modality: str
    low: float = 0.0
    high: float = 0.0
    mean: float = 0.0
    std: float = 1.0

    def __call__(self, image: AnyArray) -> SingleArray:
        """Return float32 grey values of mean near 0 and standard deviation near 1.

        Examples
        --------
        >>> greys = Intensity("MR")(np.arange(5.0).reshape(5, 1, 1))
        >>> print(greys.ravel().round(1))
        [-1.4 -0.7  0.   0.7  1.4]
        """
        values = np.asarray(image, np.float32)
        if self.modality == "CT":
            return ((np.clip(values, self.low, self.high) - self.mean) / self.std).astype(np.float32)
        low, high = np.percentile(values, [0.5, 99.5])
        values = np.clip(values, low, high)
        return ((values - values.mean()) / max(float(values.std()), 1e-6)).astype(np.float32)

    def percentiles(self, image: AnyArray) -> FloatArray:
        """Percentiles 10, 50 and 90 of a scan's grey values as the network sees them."""
        return np.asarray(np.percentile(self(image), _PERCENTILES), np.float64)


@dataclass(frozen=True)
class Plan:
    """All that is needed to use a network's weights on a new scan.

    Attributes
    ----------
    network : str
        Its name in `cccd_segmentation.networks.networks`.
    width, sizes
        What it is built with.
    labels : tuple of int
        Values that its classes after the background get in a mask.
    orientation : str
        Axis codes of its volumes, the slices' axis last: ``RAS``.
    spacing : tuple of float
        Of its volumes, mm.
    intensity : Intensity
    patch : tuple of int
        Voxels of a window.
    flip_axes : tuple of int
        Axes over whose flips logits are averaged.
    organ : str
        What it was trained to find.
    source : str
        Sources of its training scans, as the cohort sheet names them: ``phantom``.
    greys : tuple of (float, float)
        Least and greatest of each of the percentiles that `Intensity.percentiles` has of its training scans.
    seed : int
    """

    network: str
    width: int
    sizes: dict[str, Any]
    labels: tuple[int, ...]
    orientation: str
    spacing: tuple[float, float, float]
    intensity: Intensity
    patch: tuple[int, int, int]
    flip_axes: tuple[int, ...] = ()
    organ: str = ""
    source: str = ""
    greys: tuple[tuple[float, float], ...] = ()
    seed: int = 0

    @property
    def classes(self) -> int:
        """Number of labels, the background among them."""
        return 1 + len(self.labels)

    def as_plain(self) -> dict[str, Any]:
        """Return plain values, as a model's file keeps them."""
        return asdict(self)

    @classmethod
    def of_plain(cls, values: dict[str, Any]) -> Plan:
        """Return the plan that `as_plain` gave."""
        tuples = {key: tuple(values[key]) for key in ("labels", "spacing", "patch", "flip_axes")}
        return cls(**{**values, **tuples, "intensity": Intensity(**values["intensity"])})

    def differences(self, image: Volume) -> list[str]:
        """Say in what a scan is unlike those of the training: modality, spacing, grey values; both each."""
        notes: list[str] = []
        modality = "CT" if looks_like_ct(image.data) else "MR"
        if modality != self.intensity.modality:
            trained = self.intensity.modality
            notes.append(
                f"{image.location} looks like {modality}, and the segmenter was trained on {trained}"
            )
        found = spacing_of(image.affine, self.orientation)
        if np.abs(np.log(np.divide(found, self.spacing))).max() > np.log1p(_UNLIKE):
            ours, theirs = (" x ".join(f"{mm:.3g}" for mm in size) for size in (found, self.spacing))
            notes.append(
                f"{image.location} has voxels of {ours} mm, and the segmenter was trained on {theirs} mm"
            )
        if modality == self.intensity.modality:
            notes += self._other_greys(image)
        if "phantom" in self.source.split():
            notes.append(
                f"the segmenter was trained on phantoms: what it finds in {image.location} is doubtful"
            )
        return notes

    def _other_greys(self, image: Volume) -> list[str]:
        """Name the percentile of a scan's grey values that lies furthest outside the training scans'."""
        if not self.greys:
            return []
        low, high = np.array(self.greys).T
        room = np.maximum(_BEYOND * (high - low), _LEAST_BEYOND)
        found = self.intensity.percentiles(image.data)
        outside = np.maximum(low - found, found - high) / room
        worst = int(outside.argmax())
        if outside[worst] <= 1:
            return []
        return [
            f"{image.location} has other grey values than the segmenter was trained on: after scaling, "
            f"percentile {_PERCENTILES[worst]} is {found[worst]:.2f}; in the training it was "
            f"{low[worst]:.2f} to {high[worst]:.2f}"
        ]


def looks_like_ct(image: AnyArray) -> bool:
    """Whether grey values reach down to air in HU, as those of no MR image do.

    Examples
    --------
    >>> looks_like_ct(np.array([-1000.0, 40.0])), looks_like_ct(np.array([0.0, 900.0]))
    (True, False)
    """
    return bool(np.asarray(image).min() < _AIR_HU)


def make_intensity(images: Sequence[AnyArray], organs: Sequence[AnyArray]) -> Intensity:
    """Choose how grey values are scaled: by the organ's in all training scans (CT), or scan by scan (MR).

    Raises
    ------
    InputError
        Some scans look like CT and others do not.
    """
    ct = [looks_like_ct(image) for image in images]
    if any(ct) != all(ct):
        raise InputError(
            "training sheet",
            f"{sum(ct)} of {len(ct)} scans look like CT and the others like MR",
            "train a network on scans of one modality",
        )
    if not any(ct):
        return Intensity("MR")
    inside = np.concatenate([image[organ > 0] for image, organ in zip(images, organs, strict=True)])
    low, high = np.percentile(inside, [0.5, 99.5])
    # the organ's surroundings count as well: they are what it is distinguished from
    low, high = float(low - 2 * (high - low)), float(high + 2 * (high - low))
    low, high = max(low, float(inside.mean()) - 400.0), min(high, float(inside.mean()) + 400.0)
    return Intensity("CT", low, high, float(inside.mean()), max(float(inside.std()), (high - low) / 6))


def orientation_of(affine: FloatArray) -> str:
    """Axis codes that bring a scan's slices to the last axis: ``RAS`` for axial ones.

    Examples
    --------
    >>> orientation_of(np.diag([-1.0, -1.0, 5.0, 1.0])), orientation_of(np.diag([5.0, 1.0, 1.0, 1.0]))
    ('RAS', 'ASR')
    """
    codes = nib.orientations.aff2axcodes(affine)
    across = {"L": "R", "P": "A", "I": "S"}
    code = str(codes[find_slice_axis(affine)])
    slices = across.get(code, code)
    return "".join(code for code in "RAS" if code != slices) + slices


def spacing_of(affine: FloatArray, orientation: str) -> tuple[float, float, float]:
    """Spacing in mm along the axes of an orientation."""
    current = nib.orientations.io_orientation(affine)
    wanted = nib.orientations.axcodes2ornt(tuple(orientation))
    lengths = np.linalg.norm(affine[:3, :3], axis=0)
    by_world = {int(world): float(length) for (world, _), length in zip(current, lengths, strict=True)}
    first, second, third = (by_world[int(world)] for world, _ in wanted)
    return first, second, third
