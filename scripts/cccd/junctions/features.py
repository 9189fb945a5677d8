"""What the network reads at nodes, links and triangles: occupancy, geometry, regions and grey values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cccd.junctions.branches import BRANCH_MEASURES, find_branches
from cccd.junctions.complexes import REGION_GAPS_PX, Complex, fragments

__all__ = ["LINK_FEATURES", "NODE_FEATURES", "TRIANGLE_FEATURES", "Features", "measure", "normalised_grey"]

# Occupancy around a node: half width in samples, step in pixels (and the box that is averaged).
_SCALES = ((4, 1), (3, 3), (3, 9))
_GREY_STEPS = 2  # half width of the 5x5 grey patch, in samples two pixels apart
_OCCUPANCY = sum((2 * half + 1) ** 2 for half, _ in _SCALES)
_GREY = (2 * _GREY_STEPS + 1) ** 2

# Scales of `REGION_GAPS_PX` whose regions have their grey values measured.
_TONED = (0, 2)

# Blurs of the equalised grey in pixels, and how far to either side of a link each is read.
_BLURS = ((1.0, 1.5), (2.5, 3.5))

# Around slices on one raster: more than the farthest sample of a patch and half its box.
_APART_PX = 40

# Bins of grey values that are ranked.
_BINS = 1024

#: Grey values that the network compares with the organ's: one per blur.
TONES = len(_BLURS)
NODE_FEATURES = _OCCUPANCY + _GREY + 2
TRIANGLE_FEATURES = 8 + 4 * len(REGION_GAPS_PX) + TONES + 1 + 2 * len(_TONED)
LINK_FEATURES = 12 + 2 * len(REGION_GAPS_PX) + 3 + 2 * TONES + 4 + 4 * BRANCH_MEASURES + 4


@dataclass
class Features:
    """Inputs of the network for a `Complex`.

    Attributes
    ----------
    nodes : (V, NODE_FEATURES) uint8
        Occupancy and grey patches, 255 standing for 1; zero at ring nodes.
    links : (L, LINK_FEATURES) float32
    triangles : (T, TRIANGLE_FEATURES) float32
    tones : (T, TONES) float32
        Equalised grey values, 0 where there is no image.
    branches : (2, V) int64
        Branch, and stroke, that each node is part of; what is no pixel of the map stands alone.
    """

    nodes: np.ndarray
    links: np.ndarray
    triangles: np.ndarray
    tones: np.ndarray
    branches: np.ndarray


@dataclass
class Grey:
    """A grey slice around a map's pixels.

    Attributes
    ----------
    scaled : (I, J) uint8
        1 % and 99 % quantiles at 0 and 255.
    blurred : (I, J) float32
        In the image's own units.
    channels : (I, J, 2 + TONES) uint8
        ``scaled``; ranks among the grey values, so that bone and air beside it leave an organ its
        contrast, one per blur; and the rank of the gradient's magnitude.
    origin : (2,) int array
        Pixel of the arrays' first elements.
    """

    scaled: np.ndarray
    blurred: np.ndarray
    channels: np.ndarray
    origin: np.ndarray


def _ranks(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Give each value (I, J) its rank among all, 0 to 255; alike ones rank in the middle of their own."""
    bins = np.clip((values - low) * ((_BINS - 1) / max(high - low, 1e-6)), 0, _BINS - 1).astype(np.uint16)
    counts = np.bincount(bins.ravel(), minlength=_BINS)
    middle = np.cumsum(counts) - counts / 2
    return (middle * (255 / values.size)).astype(np.uint8)[bins]


def normalised_grey(image: np.ndarray, pixels: np.ndarray) -> Grey:
    """Normalise a grey slice (I, J) around the pixels (N, 2)."""
    low = np.clip(pixels.min(axis=0) - 12, 0, np.array(image.shape) - 1)
    high = np.maximum(pixels.max(axis=0) + 13, low + 1)
    around = np.ascontiguousarray(image[low[0] : high[0], low[1] : high[1]], np.float32)
    darkest, dark, bright, brightest = np.percentile(around, (0.2, 1, 99, 99.8))
    scaled = np.clip((around - dark) * (255 / max(bright - dark, 1e-6)), 0, 255).astype(np.uint8)
    scaled = cv2.GaussianBlur(scaled, (0, 0), 0.8)
    blurred = cv2.GaussianBlur(around, (0, 0), _BLURS[0][0])
    ranks = _ranks(blurred, darkest, brightest)
    rest = np.sqrt(_BLURS[1][0] ** 2 - _BLURS[0][0] ** 2)
    slope = cv2.magnitude(*(cv2.Sobel(blurred, cv2.CV_32F, *order) for order in ((1, 0), (0, 1))))
    steep = _ranks(slope, 0.0, 2 * float(brightest - darkest))
    channels = np.dstack([scaled, ranks, cv2.GaussianBlur(ranks, (0, 0), rest), steep])
    return Grey(scaled, blurred, channels, low)


def _patches(raster: np.ndarray, at: np.ndarray, half: int, step: int) -> np.ndarray:
    """Take samples (N, (2 half + 1)^2) of a raster around places (N, 2), zero beyond its border."""
    margin = half * step
    padded = np.pad(raster, margin)
    steps = np.arange(-half, half + 1) * step
    window = (steps[:, None] * padded.shape[1] + steps).ravel()
    centre = (at[:, 0] + margin) * padded.shape[1] + at[:, 1] + margin
    return padded.ravel()[centre[:, None] + window]


def _side_by_side(graph: Complex) -> np.ndarray:
    """Places (N, 2) of all nodes but the rings' on one raster, so far apart that no slice sees another."""
    inner = ~graph.ring
    pixels = graph.points[inner].astype(np.int64)
    slices = np.repeat(np.arange(len(graph.node_offsets) - 1), np.diff(graph.node_offsets))[inner]
    first = np.searchsorted(slices, np.arange(slices[-1] + 1))
    low, high = np.minimum.reduceat(pixels, first) - _APART_PX, np.maximum.reduceat(pixels, first)
    width = high[:, 1] - low[:, 1]
    low[:, 1] -= np.cumsum(width) - width
    return pixels - low[slices]


def _seen(graph: Complex, greys: Sequence[Grey | None], kind: str) -> Iterator[tuple[Grey, slice]]:
    """Grey slices there are, and where their nodes, links or triangles stand."""
    offsets = getattr(graph, f"{kind}_offsets")
    for n, grey in enumerate(greys):
        if grey is not None:
            yield grey, slice(offsets[n], offsets[n + 1])


def _node_features(graph: Complex, places: np.ndarray, greys: Sequence[Grey | None]) -> np.ndarray:
    inner = ~graph.ring
    drawn = graph.drawn[inner]
    raster = np.zeros(places.max(axis=0) + _APART_PX, np.uint8)
    raster[tuple(places[drawn].T)] = 255
    columns = []
    for half, step in _SCALES:
        # the mean over a box says how much of it is occupied; coarse boxes hold little, hence the gain
        seen = raster if step == 1 else cv2.blur(raster, (step, step), borderType=cv2.BORDER_CONSTANT)
        columns.append(_patches(cv2.multiply(seen, 1 if step == 1 else min(step, 4)), places, half, step))
    nodes = np.zeros((len(graph.points), NODE_FEATURES), np.uint8)
    nodes[inner, :_OCCUPANCY] = np.hstack(columns)
    for grey, own in _seen(graph, greys, "node"):
        at = graph.points[own][inner[own]].astype(np.int64) - grey.origin
        nodes[own][inner[own], _OCCUPANCY:-2] = _patches(grey.scaled, at, _GREY_STEPS, 2)
        nodes[own][inner[own], -2] = 255
    nodes[inner, -1] = np.where(drawn, 0, 255)
    return nodes


def _sample(grey: Grey, points: np.ndarray) -> np.ndarray:
    """Channels (..., 2 + TONES) in 0..1 at the pixels nearest to points (..., 2), the border's beyond it."""
    at = np.rint(points - grey.origin).astype(np.int64)
    rows, columns, channels = grey.channels.shape
    flat = np.clip(at[..., 0], 0, rows - 1) * columns + np.clip(at[..., 1], 0, columns - 1)
    return grey.channels.reshape(-1, channels)[flat].astype(np.float32) / 255


def _triangle_greys(
    graph: Complex, greys: Sequence[Grey | None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Grey values of triangles; zeros where there is no image.

    Returns
    -------
    tone : (T, 2) array
        Mean and spread as scaled.
    tones : (T, TONES) array
        Means as equalised.
    shades : (T, 1 + 2 len(_TONED)) array
        Spread as equalised, and mean and spread of each region that the triangle is part of.
    """
    mean, spread = (np.zeros((len(graph.triangles), 2 + TONES)) for _ in range(2))
    for grey, own in _seen(graph, greys, "triangle"):
        corners = graph.points[graph.triangles[own]]
        centre = corners.mean(axis=1, keepdims=True)
        samples = _sample(grey, np.concatenate([centre, (corners + centre) / 2], axis=1))
        mean[own], spread[own] = samples.mean(axis=1) - 0.5, samples.std(axis=1)
    tone, spread_of_tone = mean[:, 1], spread[:, 1]
    weight = np.where(graph.outer, 1e-6, graph.areas + 1e-6)
    regional = []
    for g in _TONED:
        region = graph.regions[:, g]
        total = np.bincount(region, weight)
        average = np.bincount(region, weight * tone) / total
        square = np.bincount(region, weight * (tone**2 + spread_of_tone**2)) / total
        regional += [average[region], np.sqrt(np.maximum(square - average**2, 0))[region]]
    shades = np.column_stack([spread_of_tone, *regional])
    return np.column_stack([mean[:, 0], spread[:, 0]]), mean[:, 1 : 1 + TONES], shades


def _link_greys(graph: Complex, greys: Sequence[Grey | None]) -> np.ndarray:
    """Grey values across and along links (L, 3 + 2 TONES); zeros where there is no image.

    The step of the scaled grey across a link's middle; then of three places along the link the size of the
    mean step and the least step, per blur, and mean and least rank of the slope.
    """
    found = np.zeros((len(graph.links), 3 + 2 * TONES))
    for grey, own in _seen(graph, greys, "link"):
        a, b = (graph.points[graph.links[own, end]] for end in (0, 1))
        step = b - a
        normal = np.column_stack([-step[:, 1], step[:, 0]]) / np.hypot(step[:, 0], step[:, 1])[:, None]
        places = a[:, None] + step[:, None] * np.array([1 / 6, 1 / 2, 5 / 6])[:, None]
        columns = []
        for channel, (_, reach) in enumerate(_BLURS, 1):
            beside = reach * normal[:, None]
            across = _sample(grey, places + beside) - _sample(grey, places - beside)
            if channel == 1:
                columns.append(np.abs(across[:, 1, 0]))
            columns += _mean_and_least(across[..., channel])
        found[own] = np.column_stack([*columns, *_mean_and_least(_sample(grey, places)[..., -1])])
    return found


def _mean_and_least(steps: np.ndarray) -> list[np.ndarray]:
    """Size of the mean and least size of three steps (L, 3)."""
    first, second, third = steps.T
    least = np.minimum(np.minimum(np.abs(first), np.abs(second)), np.abs(third))
    return [np.abs(first + second + third) / 3, least]


def _fragment_sizes(graph: Complex) -> np.ndarray:
    """Pixels in the 8-connected fragments that links join: fewer, more, and whether they are one (L, 3)."""
    fragment = fragments(graph)
    size = np.log(np.bincount(fragment)[fragment]) / 4
    ends = size[graph.links]
    same = fragment[graph.links[:, 0]] == fragment[graph.links[:, 1]]
    return np.column_stack([ends.min(axis=1), ends.max(axis=1), same])


def _link_branches(
    graph: Complex, places: np.ndarray, step: np.ndarray, length: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Branches and strokes (2, V) of all nodes, and what they say of the links between them.

    Sums and differences of the measures of branches and strokes at both ends, whether they are one, and how
    well each branch points along the link: the worse end first.
    """
    drawn = graph.drawn
    number = np.cumsum(drawn) - 1  # among the maps' pixels
    a, b = graph.links.T
    pixels = places[drawn[~graph.ring]]
    short = length <= REGION_GAPS_PX[0]
    within = drawn[a] & drawn[b]
    found = find_branches(
        pixels,
        number[graph.links[within & short]],
        number[graph.links[within & ~short & (length <= REGION_GAPS_PX[-1])]],
    )
    measures = np.zeros((len(drawn), 2 * BRANCH_MEASURES))
    pointing = np.zeros((len(drawn), 2))
    measures[drawn], pointing[drawn] = found.measures, found.outward
    labels = np.tile(np.arange(len(drawn)) + len(pixels), (2, 1))
    labels[:, drawn] = found.labels
    direction = step / length[:, None]
    one = np.einsum("lc,lc->l", pointing[a], direction)
    other = np.einsum("lc,lc->l", pointing[b], -direction)
    columns = [
        measures[a] + measures[b],
        np.abs(measures[a] - measures[b]),
        (labels[:, a] == labels[:, b]).T,
        np.minimum(one, other),
        np.maximum(one, other),
    ]
    return labels, np.column_stack(columns)


def _longest_and_shortest(graph: Complex) -> tuple[np.ndarray, np.ndarray]:
    """Find the lengths (T,) of the longest and the shortest side of each triangle."""
    one, other, third = (graph.points[graph.triangles[:, n]] for n in range(3))
    a, b, c = (np.hypot(*step.T) for step in (one - other, other - third, third - one))
    return np.maximum(np.maximum(a, b), c), np.minimum(np.minimum(a, b), c)


def measure(graph: Complex, greys: Sequence[Grey | None]) -> Features:
    """Measure the features of a batch of slices.

    Parameters
    ----------
    graph : Complex
    greys : sequence of Grey or None
        From `normalised_grey`, for every slice.
    """
    a, b = (graph.points[graph.links[:, end]] for end in (0, 1))
    step = b - a
    length = np.hypot(step[:, 0], step[:, 1])
    angle = np.arctan2(step[:, 0], step[:, 1])
    area, outer = graph.areas, graph.outer
    longest, shortest = _longest_and_shortest(graph)
    scales = len(REGION_GAPS_PX)
    inner_area = np.where(outer, 0, area)
    region_area = np.empty((len(area), scales), np.float32)
    for g in range(scales):
        region_area[:, g] = np.bincount(graph.regions[:, g], inner_area)[graph.regions[:, g]]
    hull_area = np.maximum(np.add.reduceat(inner_area, graph.triangle_offsets[:-1]), 1)
    hull_area = np.repeat(hull_area, np.diff(graph.triangle_offsets))[:, None]
    has_grey = np.array([grey is not None for grey in greys])
    left, right = graph.sides.T
    log_area = np.log1p(area)
    tone, tones, shades = _triangle_greys(graph, greys)
    link_greys = _link_greys(graph, greys)
    depth = graph.depths.astype(np.float32)
    places = _side_by_side(graph)
    branches, link_branches = _link_branches(graph, places, step, length)
    triangles = np.column_stack(
        [
            log_area,
            np.log(longest),
            np.log(shortest),
            area / longest**2,
            outer,
            tone,
            np.repeat(has_grey, np.diff(graph.triangle_offsets)),
            np.minimum(depth, 1),
            np.minimum(depth, 6) / 3,
            np.log1p(region_area) / 4,
            np.log((region_area + 1) / hull_area) / 4,
            tones,
            shades,
        ]
    )
    links = np.column_stack(
        [
            np.log(length),
            length <= REGION_GAPS_PX[0],
            np.cos(2 * angle),
            np.sin(2 * angle),
            np.cos(4 * angle),
            np.sin(4 * angle),
            np.minimum(log_area[left], log_area[right]),
            np.maximum(log_area[left], log_area[right]),
            np.abs(tone[left, 0] - tone[right, 0]),
            link_greys[:, 0],
            np.repeat(has_grey, np.diff(graph.link_offsets)),
            outer[left] | outer[right],
            graph.regions[left] == graph.regions[right],
            np.minimum(np.abs(depth[left] - depth[right]), 2),
            _fragment_sizes(graph),
            link_greys[:, 1:],
            np.abs(tones[left, 0] - tones[right, 0]),
            2.0 - graph.drawn[graph.links[:, 0]] - graph.drawn[graph.links[:, 1]],
            link_branches,
        ]
    )
    return Features(
        _node_features(graph, places, greys),
        links.astype(np.float32),
        triangles.astype(np.float32),
        tones.astype(np.float32),
        branches,
    )
