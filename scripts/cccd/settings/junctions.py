"""Settings of what leads to ordered curves: boundary pixels of slices, and the network that orders them.

`cccd_networks.settings` adds those of its training.
"""

from __future__ import annotations

from typing import Literal

from cccd.settings import Section, setting


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


class InferenceSettings(Section):
    """From the network's logits to closed curves."""

    parts: int | None = setting(
        None,
        "most pieces of an organ on a slice, none with a hole; null: as the map says",
        why="Most organs are one piece; a row's `parts` sets it for one organ.",
        unit="count",
        ge=1,
        le=100,
    )
    unlisted_wrong: float = setting(
        0.2,
        "share of the slices that are not listed for a look that may be wrong, at most",
        why="On the mean of kinds of damage that training never saw; on its own kinds it is .03. At .1 three "
        "times as many slices of a real scan are listed, below .075 all of them; docs/bands.md has figures.",
        unit="share",
        ge=0,
        le=0.3,
    )


class JunctionSettings(Section):
    """The junction network (section ``gnn``)."""

    inference: InferenceSettings = setting(
        InferenceSettings(), "from logits to closed curves", why="Read where the network orders."
    )
