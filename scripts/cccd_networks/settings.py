"""Settings of the junction network: its graphs, its training, its size."""

from __future__ import annotations

from typing import Literal

from cccd.settings import Section, setting
from cccd.settings.junctions import JunctionSettings

# Gates per link: four channels each.
_HEADS = 8

# Message-passing layers on the pixels (eq. 11): a pixel then sees two links around it.
_PIXEL_LAYERS = 2

# Channels of a link for each of a pixel: links are three times as many, so they have fewer.
_LINK_SHARE = 0.75

# Channels of the paper's network. Spektral's default is 256; of 16, 64 and 256 in eight epochs, 64 has the
# most maps right (docs/measured/paper_network.csv).
_PAPER_CHANNELS = 64


class GraphSettings(Section):
    """How many graphs are drawn once and kept, per split."""

    training: int = setting(
        200,
        "graphs trained on in every epoch",
        why="The paper's number.",
        unit="count",
        ge=1,
        le=100000,
    )
    validation: int = setting(
        40,
        "graphs that choose the best epoch",
        why="The paper's number.",
        unit="count",
        ge=1,
        le=100000,
    )
    test: int = setting(
        50,
        "graphs on which the trained network is scored at the end",
        why="The paper's number.",
        unit="count",
        ge=1,
        le=100000,
    )


class PaperSettings(Section):
    """The training of the paper's network."""

    epochs: int = setting(
        8,
        "epochs",
        why="Not in the paper; what its sizes and learning rate were swept with.",
        unit="count",
        ge=1,
        le=10000,
    )

    @property
    def sizes(self) -> dict[str, int]:
        """What the network's weights are shaped by."""
        return {"channels": _PAPER_CHANNELS}


class NetworkSettings(JunctionSettings):
    """The junction network and its training (section ``gnn``)."""

    network: Literal["ours", "paper"] = setting(
        "ours",
        "ours: Delaunay graph, triangles, minimum cut; paper: its grid, eq. (11), chains followed",
        why="Ours repairs more maps; the junction table shows both.",
    )
    paper: PaperSettings = setting(
        PaperSettings(), "the paper's network", why="What the paper leaves open is chosen here."
    )
    pretrained: str | None = setting(
        None,
        "path of a ready model.pt to take instead of the shipped one; then nothing is trained",
        why="workflow/models/junctions.pt is shipped with the project.",
    )
    start: str | None = setting(
        None,
        "path of a model.pt, of the same widths, whose weights training starts from",
        why="For weights that are trained in stages, as the shipped ones were.",
    )
    graphs: GraphSettings = setting(
        GraphSettings(), "frozen graphs of each split", why="Drawn once, so that runs compare."
    )
    fresh_maps: int = setting(
        400,
        "further maps, new in each epoch",
        why="They cannot be learnt by heart; 1300 take 2.5 times as long, for 0.82 correct instead of 0.77.",
        unit="count",
        ge=0,
        le=1000000,
    )
    epochs: int = setting(
        5,
        "epochs at most",
        why="Keeps the default run short; the shipped weights took 175 epochs in eight stages.",
        unit="count",
        ge=1,
        le=10000,
    )
    patience: int = setting(
        3,
        "epochs without a better validation before training stops",
        why="Further epochs would learn nothing more.",
        unit="count",
        ge=1,
        le=10000,
    )
    batch_size: int = setting(
        3,
        "maps per step",
        why="In a short training more steps are worth more: of 6 and 3, three trainings each, 0.48 and 0.59 "
        "correct; the shipped weights took 12.",
        unit="count",
        ge=1,
        le=1024,
    )
    learning_rate: float = setting(
        0.003,
        "learning rate at its peak (one cycle)",
        why="The stages of the shipped weights peaked between 0.0008 and 0.003.",
        unit="1",
        ge=1e-6,
        le=0.1,
    )
    width: int = setting(
        32,
        f"channels of pixels and triangles; a multiple of {_HEADS}",
        why="What the shipped weights have; not swept.",
        unit="count",
        ge=8,
        le=512,
        multiple_of=_HEADS,
    )
    message_layers: int = setting(
        4,
        "message-passing layers on triangles and links",
        why="Each lets a triangle see one more triangle around it; the shipped weights have six.",
        unit="count",
        ge=1,
        le=32,
    )
    test_maps: int = setting(
        12,
        "maps per kind of corruption on which the decoders are compared",
        why="Keeps the comparison to minutes.",
        unit="count",
        ge=1,
        le=10000,
    )

    @property
    def sizes(self) -> dict[str, int]:
        """What the network's weights are shaped by."""
        return {
            "width": self.width,
            "link_width": int(_LINK_SHARE * self.width),
            "pixel_layers": _PIXEL_LAYERS,
            "message_layers": self.message_layers,
            "heads": _HEADS,
        }


#: The section ``gnn``: its model and its default.
SECTION = (
    NetworkSettings,
    setting(NetworkSettings(), "the network that orders boundary pixels", why="Equation 11."),
)
