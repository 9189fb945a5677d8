"""Settings of the segmentation networks: which one, what it is trained on, how."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cccd.settings import Section, setting

#: Segmenters that are called by their own commands, where they are installed.
INSTALLED_SEGMENTERS = ("totalsegmentator", "nnunetv2:FOLDER")


def is_installed_segmenter(name: str) -> bool:
    """Whether a segmenter is called by its own command.

    >>> is_installed_segmenter("nnunetv2:models/heart"), is_installed_segmenter("nnunet")
    (True, False)
    """
    return name == "totalsegmentator" or name.startswith("nnunetv2:")


_Patch = Annotated[int, Field(ge=32, le=512)]
_Spacing = Annotated[float, Field(ge=0.1, le=20)]


class SegmentationSettings(Section):
    """The segmentation networks and their training (section ``segmentation``)."""

    labels: tuple[Annotated[int, Field(ge=1, le=65535)], ...] = setting(
        (),
        "label values to distinguish; none: one organ, of the labels that a row names",
        why="The hippocampus has two parts.",
        unit="label",
    )
    spacing_mm: tuple[_Spacing, _Spacing, _Spacing] | None = setting(
        None,
        "voxel size that networks see, the last between slices; null: the training's median",
        why="Coarser voxels train faster; the mask comes back on the scan's own grid.",
        unit="mm",
    )
    patch: tuple[_Patch, _Patch, _Patch] = setting(
        (32, 48, 32),
        "voxels of a patch and of a sliding window; multiples of 16, slices last",
        why="Holds a hippocampus, and trains in minutes on a CPU.",
        unit="voxels",
    )
    flip_axes: tuple[Annotated[int, Field(ge=0, le=2)], ...] = setting(
        (),
        "axes (0 left-right, 1 back-front, 2 feet-head) along which scans are flipped",
        why="Only for organs whose mirror image is as likely, such as hippocampi. Predictions of both are "
        "averaged.",
        unit="axis",
    )
    test_share: float = setting(
        0.2,
        "share of the training patients that score the network and train nothing",
        why="A fifth is the usual share.",
        unit="share",
        gt=0,
        lt=1,
    )
    epochs: int = setting(
        20,
        "passes over the training scans",
        why="Minutes on a CPU; more gain little at the shipped widths.",
        unit="count",
        ge=1,
        le=100000,
    )
    batch_size: int = setting(
        2, "patches per step", why="What nnU-Net uses for large patches.", unit="count", ge=1, le=256
    )
    learning_rate: float = setting(
        0.003,
        "learning rate at its peak (AdamW, one cycle)",
        why="Of 0.001 to 0.01 none was clearly better in short runs.",
        unit="1",
        ge=1e-6,
        le=0.1,
    )
    width: int | None = setting(
        None,
        "channels of the first level (H-DenseUNet: growth rate); null: as shipped",
        why="Published widths need a GPU; docs/segmentation.md counts both and measures the shipped ones.",
        unit="count",
        ge=2,
        le=512,
    )
    precision: Literal["float32", "bfloat16"] = setting(
        "float32",
        "numbers that a training computes with",
        why="bfloat16 takes .6 to .9 of the time on CPUs that multiply it. But torch 2.13 then reads "
        "uninitialised memory where a volume is 2 voxels wide: weights differ from run to run, or are lost.",
    )


#: The section ``segmentation``: its model and its default.
SECTION = (
    SegmentationSettings,
    setting(SegmentationSettings(), "networks that find organs in scans", why="Table 3's, and nnU-Net's."),
)
