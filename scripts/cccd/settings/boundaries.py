"""Settings of the boundaries: from slices to boundary pixels."""

from __future__ import annotations

from typing import Literal

from cccd.settings.section import Section, setting


class BoundarySettings(Section):
    """How boundary pixels are found (section ``boundaries``; section 4.3 of the paper)."""

    source: Literal["auto", "mask", "image"] = setting(
        "auto",
        "mask, image, or auto: the mask when there is one",
        why="A mask is exact where an image's edges are not.",
    )
    blur_px: float = setting(
        1.5,
        "Gaussian blur of the grey image before its edges are sought; a mask is not blurred",
        why="Smooths the noise that Canny would take for edges; a mask has none.",
        unit="px",
        ge=0,
        le=20,
    )
    dilations: int = setting(
        3,
        "5x5 dilations and erosions of the rough region: their XOR is the band searched",
        why="Each widens the band by two pixels on either side of the region's border.",
        unit="count",
        ge=1,
        le=20,
    )
    edge_quantile: float = setting(
        0.8,
        "Canny's upper threshold: this quantile of the band's gradients",
        why="Leaves the steepest fifth to start edges from.",
        unit="share",
        ge=0,
        le=1,
    )
