"""What the network reads at nodes, links and triangles: occupancy, geometry, regions and intensities.

The columns of the three tables are `NODES`, `LINKS` and `TRIANGLES`; the shipped weights were trained on
exactly these, so the constants here are part of their definition and no settings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cccd.geometry.arrays import AnyArray, ByteArray, FloatArray, IntArray, SingleArray
from cccd.tolerances import LEAST_PX
from cccd_junctions.branches import SHAPE_COLUMNS, find_branches
from cccd_junctions.columns import FeatureSchema
from cccd_junctions.delaunay import REGION_GAPS_PX, DelaunayGraph
from cccd_junctions.intensity import BLURS, IntensitySlice, sample_channels

# Occupancy around a node: half width in samples, step in pixels (and the box that is averaged).
_SCALES = ((4, 1), (3, 3), (3, 9))

# Half width of the 5x5 intensity patch, in samples, and their step in pixels.
_PATCH = (2, 2)

# Scales of `REGION_GAPS_PX` whose regions have their intensities measured.
_REGIONAL = (0, 2)

# Around a slice on its raster: more than the farthest sample of a patch and half its box.
_MARGIN_PX = 40


def _samples(half: int) -> int:
    """How many samples a patch has."""
    return (2 * half + 1) ** 2


# How many columns there are of what is measured for every length of walls.
_EACH = len(REGION_GAPS_PX)

#: What the network reads at a node, in steps of 1/255.
NODES = FeatureSchema(
    **{f"occupancy_{step}px": _samples(half) for half, step in _SCALES},  # share of boxes so wide
    intensity=_samples(_PATCH[0]),  # scaled, quantile: around the node
    has_image=1,
    unobserved=1,  # an edge of the image, no pixel of the boundary map
)

#: What the network reads at a triangle. Samples are four; walls are as long as each of `REGION_GAPS_PX`.
TRIANGLES = FeatureSchema(
    area=1,  # log(1 + px^2)
    longest_side=1,  # log px
    shortest_side=1,  # log px
    compactness=1,  # area by the longest side's square
    outer=1,  # it touches a ghost point
    intensity_mean=1,  # scaled, quantile - 0.5: of its samples
    intensity_spread=1,  # scaled, quantile: standard deviation of its samples
    has_image=1,
    enclosed=_EACH,  # walls lie between it and the outside
    depth=_EACH,  # number of such walls / 3, 6 walls at most
    region_area=_EACH,  # log(1 + px^2) / 4, of what such walls enclose with it
    region_share=_EACH,  # log / 4, of that area (and 1 px^2) by the slice's
    equalised_mean=len(BLURS),  # rank - 0.5: of its samples
    equalised_spread=1,  # rank: standard deviation of its samples
    **{f"region_{g}_equalised_{kind}": 1 for g in _REGIONAL for kind in ("mean", "spread")},  # rank
)

#: What the network reads at a link, between two triangles and two ends.
LINKS = FeatureSchema(
    length=1,  # log px
    short=1,  # it joins 8-neighbours
    direction_2=2,  # cosine and sine of twice the angle of its direction
    direction_4=2,  # of four times the angle
    triangle_area=2,  # log(1 + px^2), the smaller and the larger
    intensity_difference=1,  # scaled, quantile: between its triangles
    intensity_step=1,  # scaled, quantile: across its middle
    has_image=1,
    outer=1,  # one of its triangles touches a ghost point
    same_region=_EACH,  # of its triangles
    depth_difference=_EACH,  # walls, 2 at most
    fragment_size=2,  # log pixels / 4 of the 8-connected fragments it joins, the smaller and the larger
    same_fragment=1,
    **{f"equalised_step_{n}": 2 for n in range(len(BLURS))},  # rank: across it at three places, mean, least
    slope=2,  # rank of the gradient's magnitude at three places along it, mean and least
    equalised_difference=1,  # rank: between its triangles, least blur
    unobserved_ends=1,  # ends that are no pixel of the boundary map
    **{f"{part}_{of}": SHAPE_COLUMNS.width for part in ("sum", "difference") for of in ("branch", "group")},
    same_branch=1,
    same_group=1,
    continuation=2,  # cosines: how well both ends' branches point along it, the worse and the better
)

#: Intensities of a triangle that the network compares with the organ's: one per blur.
INTENSITIES = TRIANGLES["equalised_mean"]


@dataclass(frozen=True, eq=False)
class GraphFeatures:
    """Inputs of the network for a `DelaunayGraph`.

    Attributes
    ----------
    nodes : (V, NODES.width) uint8
        255 stands for 1; zero at ghost points.
    links : (L, LINKS.width) float32
    triangles : (T, TRIANGLES.width) float32
    branch, group : (V,) int64
        Branch, and good-continuation group, that each node is part of; what is no pixel of the map stands
        alone.
    """

    nodes: ByteArray
    links: SingleArray
    triangles: SingleArray
    branch: IntArray
    group: IntArray


def measure_features(graph: DelaunayGraph, intensity: IntensitySlice | None) -> GraphFeatures:
    """Measure the features of a slice.

    Parameters
    ----------
    graph : DelaunayGraph
    intensity : IntensitySlice or None
        From `cccd_junctions.intensity.normalised_intensity`.
    """
    places = _raster_places(graph)
    inside = _triangle_intensities(graph, intensity)
    branch, group, continuation = _link_branches(graph, places)
    triangles = TRIANGLES.assemble(
        {
            **_triangle_shapes(graph),
            "has_image": np.full(len(graph.triangles), intensity is not None),
            **inside,
            **_triangle_regions(graph),
            **_regional_intensities(graph, inside),
        },
        np.float32,
    )
    links = LINKS.assemble(
        {
            **_link_shapes(graph),
            "has_image": np.full(len(graph.links), intensity is not None),
            **_link_sides(graph, inside),
            **_link_intensities(graph, intensity),
            **_link_fragments(graph),
            **continuation,
        },
        np.float32,
    )
    return GraphFeatures(_node_features(graph, places, intensity), links, triangles, branch, group)


def _patches(raster: ByteArray, at: IntArray, half: int, step: int) -> ByteArray:
    """Take samples (N, (2 half + 1)^2) of a raster around places (N, 2), all within it."""
    reach = half * step
    around = sliding_window_view(raster, (2 * reach + 1, 2 * reach + 1))[:, :, ::step, ::step]
    return around[tuple((at - reach).T)].reshape(len(at), -1)


def _raster_places(graph: DelaunayGraph) -> IntArray:
    """Places (N, 2) of all nodes but ghost points on a raster with a margin."""
    pixels = graph.points[~graph.ghost].astype(np.int64)
    return pixels - pixels.min(axis=0) + _MARGIN_PX


def _node_features(graph: DelaunayGraph, places: IntArray, intensity: IntensitySlice | None) -> ByteArray:
    inner = ~graph.ghost
    observed = graph.observed[inner]
    raster = np.zeros(places.max(axis=0) + _MARGIN_PX, np.uint8)
    raster[tuple(places[observed].T)] = 255
    columns: dict[str, AnyArray] = {}
    for half, step in _SCALES:
        # the mean over a box says how much of it is occupied; coarse boxes hold little, hence the gain
        seen = raster if step == 1 else cv2.blur(raster, (step, step), borderType=cv2.BORDER_CONSTANT)
        samples = _patches(cast(ByteArray, seen), places, half, step)
        columns[f"occupancy_{step}px"] = np.minimum(samples * np.uint16(min(step, 4)), 255)
    patches = np.zeros((len(places), NODES["intensity"].stop - NODES["intensity"].start), np.uint8)
    if intensity is not None:
        margin = _PATCH[0] * _PATCH[1]
        at = graph.points[inner].astype(np.int64) - intensity.origin + margin
        patches = _patches(np.pad(intensity.scaled, margin), at, *_PATCH)
    columns["intensity"] = patches
    columns["has_image"] = np.full(len(places), 0 if intensity is None else 255)
    columns["unobserved"] = np.where(observed, 0, 255)
    nodes = np.zeros((len(graph.points), NODES.width), np.uint8)
    nodes[inner] = NODES.assemble(columns, np.uint8)
    return nodes


def _triangle_shapes(graph: DelaunayGraph) -> dict[str, AnyArray]:
    one, other, third = (graph.points[graph.triangles[:, n]] for n in range(3))
    a, b, c = (np.hypot(*step.T) for step in (one - other, other - third, third - one))
    longest = np.maximum(np.maximum(a, b), c)
    return {
        "area": np.log1p(graph.areas),
        "longest_side": np.log(longest),
        "shortest_side": np.log(np.minimum(np.minimum(a, b), c)),
        "compactness": graph.areas / longest**2,
        "outer": graph.outer,
    }


def _triangle_regions(graph: DelaunayGraph) -> dict[str, AnyArray]:
    """Measure, at each scale of `REGION_GAPS_PX`, how deep a triangle lies and how large its region is."""
    depth = graph.depths.astype(np.float32)
    inner_area = np.where(graph.outer, 0, graph.areas)
    area = np.empty(graph.regions.shape, np.float32)
    for g, region in enumerate(graph.regions.T):
        area[:, g] = np.bincount(region, inner_area)[region]
    slice_area = np.maximum(inner_area.sum(), 1)
    return {
        "enclosed": np.minimum(depth, 1),
        "depth": np.minimum(depth, 6) / 3,
        "region_area": np.log1p(area) / 4,
        "region_share": np.log((area + 1) / slice_area) / 4,
    }


def _triangle_intensities(graph: DelaunayGraph, intensity: IntensitySlice | None) -> dict[str, AnyArray]:
    """Mean and spread of four samples of each triangle; zeros where there is no image."""
    mean, spread = (np.zeros((len(graph.triangles), 2 + len(BLURS))) for _ in range(2))
    if intensity is not None:
        corners = graph.points[graph.triangles]
        centre = corners.mean(axis=1, keepdims=True)
        places = np.concatenate([centre, (corners + centre) / 2], axis=1).swapaxes(0, 1)
        samples = sample_channels(intensity, places)  # sums along the first axis are the fastest
        mean[:], spread[:] = samples.mean(axis=0) - 0.5, samples.std(axis=0)
    return {
        "intensity_mean": mean[:, 0],
        "intensity_spread": spread[:, 0],
        "equalised_mean": mean[:, 1:-1],
        "equalised_spread": spread[:, 1],
    }


def _regional_intensities(graph: DelaunayGraph, inside: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Mean and spread of the least blurred equalised intensity over each triangle's region."""
    value, spread = inside["equalised_mean"][:, 0], inside["equalised_spread"]
    weight = np.where(graph.outer, LEAST_PX, graph.areas + LEAST_PX)
    columns: dict[str, AnyArray] = {}
    for g in _REGIONAL:
        region = graph.regions[:, g]
        total = np.bincount(region, weight)
        mean = np.bincount(region, weight * value) / total
        square = np.bincount(region, weight * (value**2 + spread**2)) / total
        columns[f"region_{g}_equalised_mean"] = mean[region]
        deviation = np.sqrt(np.maximum(square - mean**2, 0))
        columns[f"region_{g}_equalised_spread"] = deviation[region]
    return columns


def _steps(graph: DelaunayGraph) -> FloatArray:
    """Return the vectors (L, 2) from each link's first node to its second."""
    return graph.points[graph.links[:, 1]] - graph.points[graph.links[:, 0]]


def _link_shapes(graph: DelaunayGraph) -> dict[str, AnyArray]:
    step = _steps(graph)
    angle = np.arctan2(step[:, 0], step[:, 1])
    return {
        "length": np.log(graph.link_lengths),
        "short": graph.link_lengths <= REGION_GAPS_PX[0],
        "direction_2": np.column_stack([np.cos(2 * angle), np.sin(2 * angle)]),
        "direction_4": np.column_stack([np.cos(4 * angle), np.sin(4 * angle)]),
        "unobserved_ends": 2.0 - graph.observed[graph.links[:, 0]] - graph.observed[graph.links[:, 1]],
    }


def _link_sides(graph: DelaunayGraph, inside: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Compare the two triangles that share a link."""
    left, right = graph.link_triangles.T
    area = np.log1p(graph.areas)
    depth = graph.depths.astype(np.float32)
    intensity, equalised = inside["intensity_mean"], inside["equalised_mean"][:, 0]
    return {
        "triangle_area": np.column_stack(
            [np.minimum(area[left], area[right]), np.maximum(area[left], area[right])]
        ),
        "intensity_difference": np.abs(intensity[left] - intensity[right]),
        "equalised_difference": np.abs(equalised[left] - equalised[right]),
        "outer": graph.outer[left] | graph.outer[right],
        "same_region": graph.regions[left] == graph.regions[right],
        "depth_difference": np.minimum(np.abs(depth[left] - depth[right]), 2),
    }


def _link_intensities(graph: DelaunayGraph, intensity: IntensitySlice | None) -> dict[str, AnyArray]:
    """Intensity across and along links, at three places of each; zeros where there is no image."""
    count = len(graph.links)
    middle = np.zeros(count)
    across, slope = np.zeros((len(BLURS), count, 2)), np.zeros((count, 2))
    if intensity is not None:
        step = _steps(graph)
        normal = np.column_stack([-step[:, 1], step[:, 0]]) / graph.link_lengths[:, None]
        start = graph.points[graph.links[:, 0]]
        places = start + step * np.array([1 / 6, 1 / 2, 5 / 6])[:, None, None]
        for n, (_, reach) in enumerate(BLURS):
            beside = reach * normal
            change = sample_channels(intensity, places + beside) - sample_channels(intensity, places - beside)
            across[n] = _mean_and_least(change[..., n + 1])
            if n == 0:
                middle = np.abs(change[1, :, 0])
        slope = _mean_and_least(sample_channels(intensity, places)[..., -1])
    named = {f"equalised_step_{n}": column for n, column in enumerate(across)}
    return {"intensity_step": middle, "slope": slope, **named}


def _mean_and_least(steps: SingleArray) -> SingleArray:
    """Size of the mean, and the least size (L, 2), of three steps (3, L)."""
    first, second, third = steps
    least = np.minimum(np.minimum(np.abs(first), np.abs(second)), np.abs(third))
    return np.column_stack([np.abs(first + second + third) / 3, least])


def _link_fragments(graph: DelaunayGraph) -> dict[str, AnyArray]:
    """Pixels in the 8-connected fragments that links join, and whether they are one."""
    fragment = graph.fragments
    ends = (np.log(np.bincount(fragment)[fragment]) / 4)[graph.links]
    return {
        "fragment_size": np.column_stack([np.minimum(*ends.T), np.maximum(*ends.T)]),
        "same_fragment": fragment[graph.links[:, 0]] == fragment[graph.links[:, 1]],
    }


def _link_branches(graph: DelaunayGraph, places: IntArray) -> tuple[IntArray, IntArray, dict[str, AnyArray]]:
    """Branch and group (V,) of all nodes, and what they say of the links between them."""
    observed, length = graph.observed, graph.link_lengths
    number = np.cumsum(observed) - 1  # among the maps' pixels
    a, b = graph.links.T
    short = length <= REGION_GAPS_PX[0]
    within = observed[a] & observed[b]
    gaps = within & ~short & (length <= REGION_GAPS_PX[-1])
    pixels = places[observed[~graph.ghost]]
    found = find_branches(pixels, number[graph.links[within & short]], number[graph.links[gaps]])

    columns: dict[str, AnyArray] = {}
    labels: list[IntArray] = []
    shapes = {"branch": (found.branch, found.branch_shape), "group": (found.group, found.group_shape)}
    for name, (part, shape) in shapes.items():
        label = np.arange(len(observed)) + len(pixels)
        label[observed] = part
        labels.append(label)
        columns[f"same_{name}"] = label[a] == label[b]
        measured = np.zeros((len(observed), SHAPE_COLUMNS.width))
        measured[observed] = shape
        one, other = measured[a], measured[b]
        columns[f"sum_{name}"], columns[f"difference_{name}"] = one + other, np.abs(one - other)
    outward = np.zeros((2, len(observed)))
    outward[:, observed] = found.outward.T
    i, j = _steps(graph).T / length
    one, other = (outward[0, end] * i + outward[1, end] * j for end in (a, b))
    other = -other
    columns["continuation"] = np.column_stack([np.minimum(one, other), np.maximum(one, other)])
    return labels[0], labels[1], columns
