"""Settings of the junction network: its graphs, its training, its size."""

from __future__ import annotations

from cccd.settings.section import Section, setting

__all__ = ["GraphSettings", "NetworkSettings"]


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
        64,
        "graphs that choose the best epoch",
        why="Enough that chance alone does not choose it.",
        unit="count",
        ge=1,
        le=100000,
    )
    test: int = setting(
        64,
        "graphs on which the trained network's links are scored at the end",
        why="As many as choose the epoch.",
        unit="count",
        ge=1,
        le=100000,
    )


class NetworkSettings(Section):
    """The junction network and its training (section ``gnn``)."""

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
        1300,
        "maps drawn afresh in each epoch besides",
        why="Fresh maps cannot be learnt by heart.",
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
        why="No use to go on once nothing more is learnt.",
        unit="count",
        ge=1,
        le=10000,
    )
    batch_size: int = setting(
        12,
        "maps per step",
        why="What the shipped weights were trained with.",
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
    dropout: float = setting(
        0.0,
        "share of messages dropped in training (eq. 11); the paper has 0.5",
        why="Fresh maps leave little to be learnt by heart.",
        unit="share",
        ge=0,
        le=0.9,
    )
    width: int = setting(
        32,
        "channels of pixels and triangles; a multiple of heads",
        why="What the shipped weights have; not swept.",
        unit="count",
        ge=8,
        le=512,
    )
    link_width: int = setting(
        24,
        "channels of links",
        why="Links are three times as many as pixels, so they have fewer.",
        unit="count",
        ge=4,
        le=512,
    )
    pixel_layers: int = setting(
        2,
        "convolutions on the pixels (eq. 11)",
        why="A pixel then sees two links around it.",
        unit="count",
        ge=1,
        le=32,
    )
    rounds: int = setting(
        4,
        "exchanges among the triangles",
        why="Each lets a triangle see one more ring around it; the shipped weights have six.",
        unit="count",
        ge=1,
        le=32,
    )
    heads: int = setting(8, "gates per link", why="Four channels each.", unit="count", ge=1, le=64)
    test_maps: int = setting(
        12,
        "maps per kind of corruption on which the decoders are compared",
        why="Keeps the comparison to minutes.",
        unit="count",
        ge=1,
        le=10000,
    )
