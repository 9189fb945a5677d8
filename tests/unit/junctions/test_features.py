import cv2
import numpy as np
import pytest

from cccd.geometry.opencv import border_pixels
from cccd_junctions.delaunay import build_graph
from cccd_junctions.features import INTENSITIES, LINKS, NODES, TRIANGLES, measure_features
from cccd_junctions.intensity import normalised_intensity
from cccd_junctions.network import JunctionNetwork


def disc():
    mask = np.zeros((80, 80), np.uint8)
    cv2.circle(mask, (40, 40), 22, 1, -1)
    return mask


def test_no_image_reads_as_zeros():
    pixels = border_pixels(disc())[0]
    graph = build_graph(pixels)
    features = measure_features(graph, None)
    assert features.nodes.shape == (len(graph.points), NODES.width)
    assert features.links.shape == (len(graph.links), LINKS.width)
    assert features.triangles.shape == (len(graph.triangles), TRIANGLES.width)
    assert not features.triangles[:, INTENSITIES].any()


def test_bone_and_air_leave_an_organ_its_contrast():
    mask = disc()
    image = np.where(mask, 60.0, 20.0) + np.random.default_rng(0).normal(0, 4, mask.shape)
    beside = image.copy()
    beside[:12], beside[-12:] = 1500, -1000
    pixels = border_pixels(mask)[0]
    for shown in (image, beside):
        ranks = normalised_intensity(shown, pixels).channels[..., 1].astype(float)
        assert ranks[35:45, 35:45].mean() - ranks[35:45, 6:14].mean() > 80


def test_grey_values_are_read_where_the_image_has_them():
    mask = disc()
    pixels = border_pixels(mask)[0]
    graph = build_graph(pixels)
    seen = normalised_intensity(mask.astype(np.float32), pixels)
    values = measure_features(graph, seen).triangles[:, INTENSITIES]
    centre = graph.points[graph.triangles].mean(axis=1)
    far = np.hypot(*(centre - 40).T)
    assert values[far < 12].min() > values[(far > 30) & ~graph.outer].max(initial=values[graph.outer].max())


def test_neither_units_nor_place_of_the_image_change_what_is_read():
    mask = disc()
    image = np.random.default_rng(0).normal(0, 1, mask.shape) + mask
    pixels = border_pixels(mask)[0]
    here = measure_features(build_graph(pixels), normalised_intensity(image, pixels))
    moved = pixels + np.array([9, 17])
    wide = 1000 * np.pad(image, ((9, 3), (17, 5))) - 7
    there = measure_features(build_graph(moved), normalised_intensity(wide, moved))
    assert np.array_equal(here.nodes, there.nodes)
    values, moved_values = (np.sort(part.triangles[:, INTENSITIES], axis=0) for part in (here, there))
    assert values == pytest.approx(moved_values, abs=0.02)


def test_a_fragment_is_known_by_its_size():
    ring = border_pixels(disc())[0]
    graph = build_graph(np.vstack([ring, [[2, 2], [2, 3]]]))
    links = measure_features(graph, None).links
    fewer, more = links[:, LINKS["fragment_size"]].T
    one = links[:, LINKS["same_fragment"]]
    ends = graph.links >= len(ring)
    inner = ~graph.ghost[graph.links].any(axis=1)
    within, across = inner & ~ends.any(axis=1), inner & (ends.sum(axis=1) == 1)
    assert one[within].all()
    assert not one[across].any()
    assert np.exp(4 * more[within | across]) == pytest.approx(len(ring), rel=1e-5)
    assert np.exp(4 * fewer[across]) == pytest.approx(2, rel=1e-5)


def test_columns_hold_what_their_names_say():
    rng = np.random.default_rng(1)
    graph = build_graph(np.unique(rng.integers(0, 40, (90, 2)), axis=0))
    features = measure_features(graph, None)
    named = {
        "links": (LINKS, {"length": np.log(graph.link_lengths), "short": graph.link_lengths < 1.5}),
        "triangles": (TRIANGLES, {"area": np.log1p(graph.areas), "outer": graph.outer, "has_image": 0}),
    }
    for table, (schema, columns) in named.items():
        for name, expected in columns.items():
            np.testing.assert_allclose(getattr(features, table)[:, schema[name]][:, 0], expected, rtol=1e-6)
    patch = features.nodes[:, NODES["occupancy_1px"]]
    assert np.array_equal(patch[:, patch.shape[1] // 2] == 255, graph.observed)
    assert np.array_equal(features.nodes[:, NODES["unobserved"]][:, 0] == 255, ~graph.observed & ~graph.ghost)


def test_the_network_is_as_wide_as_its_columns():
    model = JunctionNetwork()
    widths = [model.pixel_encoder[0], model.triangle_encoder[1], model.link_encoder[1]]
    assert [layer.in_features for layer in widths] == [part.width for part in (NODES, TRIANGLES, LINKS)]
