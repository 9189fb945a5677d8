from dataclasses import replace

import numpy as np
import pytest

from cccd.geometry.opencv import border_pixels
from cccd.geometry.raster import dice
from cccd_junctions.decoding import fill_inside, find_outline
from cccd_junctions.delaunay import build_graph
from cccd_junctions.stacks import ReadSlice, label_slices, region_evidence, without_lone_parts

SHAPE = (90, 90)


def disc(radius):
    i, j = np.indices(SHAPE) - 45
    return (np.hypot(i, j) < radius).astype(np.uint8)


def doubled(radius, true, nats=0.3):
    """A map of two circles, of which the network believes the outer one by so many nats; its true mask."""
    chains = [border_pixels(disc(r))[0] for r in (radius, radius + 5)]
    line = np.column_stack([np.arange(2, 10), np.full(8, 45)])  # without it the map were a ring's outline
    graph = build_graph(np.unique(np.vstack([*chains, line]), axis=0))
    centre = np.hypot(*(graph.points[graph.triangles].mean(axis=1) - 45).T)
    within = np.where(centre < radius - 0.5, 4.0, np.where(centre < radius + 4.5, nats, -4.0))
    read = ReadSlice(graph, find_outline(graph), (within, np.zeros(len(graph.links))))
    return read, disc(radius if true == "inner" else radius + 5)


def clear(radius):
    graph = build_graph(border_pixels(disc(radius))[0])
    return ReadSlice(graph, find_outline(graph), None), disc(radius)


def agreement(stack, numbers):
    found = []
    slices = label_slices([read for read, _ in stack], np.array(numbers))
    for (read, truth), labelled in zip(stack, slices, strict=True):
        masks, origin = fill_inside(read.graph, labelled.inside)
        drawn = np.zeros(SHAPE, bool)
        drawn[tuple((np.argwhere(masks[0]) + origin).T)] = True
        found.append(float(dice(truth > 0, drawn)))
    return found


def test_of_two_lines_the_one_is_taken_that_the_neighbours_have():
    stack = [clear(26), doubled(25, "inner"), clear(24)]
    alone = agreement(stack, [0, 10, 20])
    together = agreement(stack, [3, 4, 5])
    assert alone[1] < 0.9
    assert min(together) > 0.99


@pytest.mark.parametrize("true", ["inner", "outer"])
def test_of_two_lines_the_one_is_taken_that_a_rough_region_has(true):
    """The region is off by more than a pixel, and of another shape."""
    read, truth = doubled(25, true, nats=0.3 if true == "inner" else -0.3)
    assert agreement([(read, truth)], [0])[0] < 0.9
    i, j = np.indices(SHAPE) - 45
    rough = np.hypot(1.06 * i, j / 1.06) < {"inner": 24, "outer": 31}[true]
    told = replace(read, evidence=region_evidence(read.graph, rough, 2.0))
    assert agreement([(told, truth)], [0])[0] > 0.99


def test_an_empty_region_says_nothing():
    read, _ = doubled(25, "inner")
    assert not region_evidence(read.graph, np.zeros(SHAPE, bool), 2.0).any()


def test_what_both_neighbours_are_far_apart_on_says_little():
    stack = [clear(38), doubled(25, "outer", nats=1.0), clear(15)]
    assert agreement(stack, [0, 1, 2])[1] > 0.99


@pytest.mark.parametrize("numbers", [[0, 2, 4], [0, 1, 3]])
def test_only_slices_next_to_each_other_are_neighbours(numbers):
    stack = [clear(26), doubled(25, "inner"), clear(24)]
    if numbers == [0, 2, 4]:
        assert agreement(stack, numbers) == [agreement([one], [0])[0] for one in stack]
    else:  # one neighbour says something, too
        assert agreement(stack, numbers)[1] > 0.99


def test_a_part_that_stands_on_both_sides_is_there_in_between():
    read, truth = clear(20)
    line = np.column_stack([np.arange(4, 12), np.full(8, 45)])
    graph = build_graph(np.vstack([border_pixels(truth)[0][8:], line]))  # open, and with what is none of it
    logits = np.full(len(graph.triangles), -0.8), np.full(len(graph.links), -1.0)
    doubted = ReadSlice(graph, find_outline(graph), logits)
    stack = [(read, truth), (doubted, truth), (read, truth)]
    assert agreement(stack, [0, 10, 20])[1] == 0
    assert agreement(stack, [0, 1, 2])[1] > 0.95


def test_a_stack_may_be_turned_upside_down_and_have_one_slice():
    stack = [doubled(25, "inner"), doubled(25, "inner"), clear(24), clear(24)]
    backwards = agreement(stack[::-1], [0, 1, 2, 3])[::-1]
    assert agreement(stack, [0, 1, 2, 3]) == backwards
    assert agreement(stack[:1], [7]) == agreement([stack[0]], [0])


@pytest.mark.parametrize(
    ("slices", "reach", "pixel_mm", "kept"),
    [
        pytest.param([2], 9, 1.0, False, id="one slice alone"),
        pytest.param([2, 3], 9, 1.0, True, id="two slices"),
        pytest.param([2], 3, 1.0, True, id="near the region"),
        pytest.param([2], 3, 2.0, False, id="of larger pixels not near"),
        pytest.param([0], 9, 1.0, False, id="the first slice"),
    ],
)
def test_what_one_slice_has_alone_far_from_the_region_is_left_out(slices, reach, pixel_mm, kept):
    organ = np.zeros((5, 30, 30), bool)
    organ[:, 8:16, 8:16] = True
    masks = organ.copy()
    masks[slices, 10, 16 : 16 + reach] = True
    region = np.pad(organ[0, 9:15, 9:15], 9)  # one pixel less to all sides, and on a smaller raster
    found = without_lone_parts(
        masks[:, 4:, 4:], np.array([4, 4]), 5 * [region], np.array([7, 8, 9, 10, 11]), pixel_mm
    )
    assert (found == (masks if kept else organ)[:, 4:, 4:]).all()
    alone = without_lone_parts(masks, np.zeros(2, int), 5 * [None], np.arange(5), pixel_mm)
    assert (alone == masks).all()
