"""Settings of the junction network where it orders; `cccd_networks.settings` adds those of its training."""

from __future__ import annotations

from cccd.settings.section import Section, setting


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
