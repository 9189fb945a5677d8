"""Settings of the junction network: its graphs, its training, its size."""

from __future__ import annotations

from typing import Literal

from cccd.settings.section import Section, setting

__all__ = [
    "GraphSettings",
    "InferenceSettings",
    "KindWeights",
    "LossSettings",
    "NetworkSettings",
    "OptimiserSettings",
    "PaperSettings",
]


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


def _weight(default: float, what: str) -> float:
    return setting(
        default, f"weight of {what}", why="Kinds that are hard count more.", unit="ratio", expert=True, ge=0
    )


class KindWeights(Section):
    """How often each kind of boundary map is drawn for training."""

    clean: float = _weight(1.0, "maps without damage")
    spurs: float = _weight(1.0, "maps with short lines off the border")
    bridges: float = _weight(2.0, "maps with lines across")
    pinch: float = _weight(1.0, "maps with links where the border comes close to itself")
    blocks: float = _weight(1.0, "maps with blocks of 2x2 pixels")
    gaps: float = _weight(3.0, "maps with pixels missing")
    noise: float = _weight(2.0, "maps with single pixels and straight lines")
    double: float = _weight(3.0, "maps with stretches of a second border")
    thick: float = _weight(4.0, "maps with thick stretches")
    mixed: float = _weight(8.0, "maps with six of these at once")
    everything: float = _weight(2.0, "maps with any of these at once")
    canny: float = _weight(9.0, "edges of grey images in a band along the border")
    canny_whole: float = _weight(0.5, "edges of whole grey images")


class InferenceSettings(Section):
    """From the network's logits to closed curves; training uses the same energy."""

    parts: int | None = setting(
        None,
        "pieces of an organ on a slice at most, none of which has a hole; null: as the map says",
        why="Most organs are one piece; a row's `parts` says it of one organ.",
        unit="count",
        ge=1,
        le=100,
    )
    rerank: bool = setting(
        True,
        "whether alternatives of the least cut are weighed as a whole, and what they say of errors is told",
        why="Half of the wrong maps have a right alternative, and half of these are found by it.",
        expert=True,
    )
    neighbour_nats: float = setting(
        1.0,
        "logits that a triangle gains from neighbouring slices, per standard deviation from their outline",
        why="0.5, 1 and 2 were tried on stacks of the development seed; 0 decides every slice alone.",
        unit="nat",
        expert=True,
        ge=0,
        le=100,
    )
    neighbour_reach: float = setting(
        3.0,
        "standard deviations from that outline beyond which a triangle gains no more",
        why="A slice's own map must be able to say otherwise; 2 and 5 did the same.",
        unit="1",
        expert=True,
        gt=0,
        le=100,
    )
    neighbour_spread_px: float = setting(
        1.5,
        "standard deviation of that outline where both neighbouring slices agree",
        why="1 and 2.5 did as well.",
        unit="px",
        expert=True,
        gt=0,
        le=100,
    )
    neighbour_sweeps: int = setting(
        2,
        "times that all slices are decided again beside their neighbours",
        why="A third changes next to nothing.",
        unit="count",
        expert=True,
        ge=0,
        le=20,
    )
    neighbour_score: float = setting(
        0.02,
        "what these logits, by the weights of its inside triangles, add to the score of an alternative",
        why="Of 0, 0.01, 0.02, 0.03, 0.05 and 0.1 the best on nine stacks of a development seed.",
        unit="1/nat",
        expert=True,
        ge=0,
        le=100,
    )
    border_cost: float = setting(
        1.0,
        "cost of a pixel of border per nat of doubt about its link",
        why="With area_power the best compromise of ten settings on the frozen validation graphs.",
        unit="1/px",
        expert=True,
        ge=0,
        le=100,
    )
    area_power: float = setting(
        0.75,
        "a triangle's logit counts by this power of its area",
        why="With border_cost the best compromise of ten settings on the frozen validation graphs.",
        unit="1",
        expert=True,
        ge=0,
        le=2,
    )
    doubtful_from: float = setting(
        0.1,
        "slices at least as probably wrong are listed to be looked at",
        why="One in eight of 600 development maps, which holds 21 of the 25 wrong ones.",
        unit="probability",
        ge=0,
        le=1,
    )
    smallest_loop_px: float = setting(
        6.0,
        "smaller loops, and fragments of fewer pixels, are debris",
        why="The loop of eight pixels around one encloses four; not swept.",
        unit="px",
        expert=True,
        ge=0,
        le=1000,
    )
    smallest_loop_share: float = setting(
        0.005,
        "loops smaller than this share of their slice's largest are debris",
        why="Specks beside an organ are seldom part of it; not swept.",
        unit="share",
        expert=True,
        ge=0,
        le=1,
    )
    tip_px: int = setting(
        1,
        "pixels that a map may have beyond an outline, which is then taken as it is",
        why="Of 0, 1, 2 and 5 the best on real slices and two synthetic test sets.",
        unit="px",
        expert=True,
        ge=0,
        le=100,
    )
    slices_per_batch: int = setting(
        4,
        "slices that the network reads at once",
        why="Of 1 to 24 the fastest: they share overheads, and memory is not asked for again each time.",
        unit="count",
        expert=True,
        ge=1,
        le=1024,
    )
    edge_slope: float = setting(
        1.25,
        "least slope of a further edge of the image, in medians of the slice's",
        why="Between the two of 1, 1.5 and 2.5 under which the true labels did best.",
        unit="ratio",
        expert=True,
        ge=0,
        le=100,
    )
    shortest_edge_px: int = setting(
        4,
        "shorter edges are noise",
        why="Ridges of noise are short; not swept.",
        unit="px",
        expert=True,
        ge=1,
        le=1000,
    )
    edge_half_away_px: float = setting(
        8.0,
        "an edge's slope counts half at this distance from the map",
        why="Most gaps of a map are narrower; not swept.",
        unit="px",
        expert=True,
        gt=0,
        le=1000,
    )
    most_edges: int = setting(
        60,
        "pixels of further edges at most, besides most_edges_per_pixel",
        why="Bounds the time that a textured slice takes.",
        unit="count",
        expert=True,
        ge=0,
        le=100000,
    )
    most_edges_per_pixel: float = setting(
        0.75,
        "pixels of further edges at most for each pixel of the map",
        why="Bounds the time that a textured slice takes.",
        unit="ratio",
        expert=True,
        ge=0,
        le=100,
    )


class LossSettings(Section):
    """What training minimises."""

    cut_weight: float = setting(
        4.0,
        "weight of the cut's loss beside the cross entropies",
        why="0, 1 and 3 gave 0.511, 0.526 and 0.530 correct on 570 maps; chosen beyond them.",
        unit="ratio",
        expert=True,
        ge=0,
        le=1000,
    )
    margin: float = setting(
        2.0,
        "nats by which the true labels should win, per triangle by extent",
        why="A logit of 2 is right seven times in eight; not swept.",
        unit="nat",
        expert=True,
        ge=0,
        le=100,
    )
    least_extent_px: float = setting(
        0.7,
        "root of a triangle's area that its cross entropy counts by, at least",
        why="The root of half a pixel, the triangle between three neighbours.",
        unit="px",
        expert=True,
        gt=0,
        le=100,
    )
    largest_extent_px: float = setting(
        12.0,
        "root of a triangle's area that its cross entropy counts by, at most",
        why="Or else the middle of an organ outweighs its border; not swept.",
        unit="px",
        expert=True,
        gt=0,
        le=10000,
    )


class OptimiserSettings(Section):
    """How weights are moved: AdamW in one cycle of the learning rate."""

    weight_decay: float = setting(
        1e-4,
        "decoupled weight decay (Loshchilov and Hutter 2019)",
        why="Small, as fresh maps leave little to be learnt by heart; not swept.",
        unit="1",
        expert=True,
        ge=0,
        le=1,
    )
    rising: float = setting(
        0.1,
        "share of the steps in which the learning rate rises (Smith and Topin 2019)",
        why="Short runs need their falling part; not swept.",
        unit="share",
        expert=True,
        gt=0,
        lt=1,
    )
    gradient_norm: float = setting(
        1.0,
        "largest norm of a step's gradient",
        why="Single hard maps would throw the weights off; not swept.",
        unit="1",
        expert=True,
        gt=0,
        le=1000,
    )
    new_messages: float = setting(
        0.1,
        "factor of messages that the weights of gnn.start are without",
        why="What is new hardly acts at first.",
        unit="ratio",
        expert=True,
        ge=0,
        le=1,
    )


class PaperSettings(Section):
    """The paper's network: of these the paper prints the dropout alone, the rest is ours."""

    width: int = setting(
        16, "channels of a pixel", why="Not in the paper; not swept.", unit="count", ge=2, le=512
    )
    layers: int = setting(
        4,
        "convolutions of eq. (11) one after another",
        why="Not in the paper; a pixel then sees four links around it.",
        unit="count",
        ge=1,
        le=32,
    )
    dropout: float = setting(
        0.5, "share of messages dropped in training", why="The paper's number.", unit="share", ge=0, le=0.9
    )
    epochs: int = setting(
        8,
        "epochs at most",
        why="Not in the paper; its links get no better beyond five.",
        unit="count",
        ge=1,
        le=10000,
    )
    patience: int = setting(
        8,
        "epochs without a better validation before training stops",
        why="Not in the paper; all epochs are run by default.",
        unit="count",
        ge=1,
        le=10000,
    )
    batch_size: int = setting(
        10, "graphs per step", why="Not in the paper; 20 steps an epoch.", unit="count", ge=1, le=1024
    )
    learning_rate: float = setting(
        0.01,
        "learning rate at its peak (one cycle of AdamW, as for our network)",
        why="Neither the rate nor the optimiser is in the paper.",
        unit="1",
        ge=1e-6,
        le=0.1,
    )


class NetworkSettings(Section):
    """The junction network and its training (section ``gnn``)."""

    network: Literal["ours", "paper"] = setting(
        "ours",
        "ours: Delaunay graph, triangles, minimum cut; paper: its grid, eq. (11), chains followed",
        why="Ours repairs more maps; the paper's stands beside it in the junction table.",
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
        "maps drawn afresh in each epoch besides",
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
        why="No use to go on once nothing more is learnt.",
        unit="count",
        ge=1,
        le=10000,
    )
    batch_size: int = setting(
        6,
        "maps per step",
        why="In a short training more steps are worth more; the shipped weights took 12.",
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
        "message-passing layers on the pixels (eq. 11)",
        why="A pixel then sees two links around it.",
        unit="count",
        ge=1,
        le=32,
    )
    message_layers: int = setting(
        4,
        "message-passing layers on triangles and links",
        why="Each lets a triangle see one more triangle around it; the shipped weights have six.",
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
    hidden_images: float = setting(
        0.3,
        "share of training maps whose image is hidden",
        why="So that the network does without one as well; not swept.",
        unit="share",
        expert=True,
        ge=0,
        le=1,
    )
    kind_weights: KindWeights = setting(
        KindWeights(), "how often each kind of map is drawn", why="Kinds that are hard count more."
    )
    inference: InferenceSettings = setting(
        InferenceSettings(), "from logits to closed curves", why="Shared by training and ordering."
    )
    loss: LossSettings = setting(
        LossSettings(), "what training minimises", why="Cross entropies and the cut."
    )
    optimiser: OptimiserSettings = setting(
        OptimiserSettings(), "how weights are moved", why="AdamW in one cycle, as is common."
    )
