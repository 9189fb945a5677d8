import numpy as np
from test_inference import FRAME, boundaries, raster_order
from test_stacks import clear, disc

from cccd import store
from cccd.containers import Curves, FittedCurves, Splines
from cccd.contours import doubtful_slices
from cccd.geometry.opencv import border_pixels
from cccd.junctions import order_boundaries
from cccd.junctions.delaunay import build_graph
from cccd.junctions.inference import DEFAULTS
from cccd.junctions.uncertainty import chance_of_error, open_width


def two_circles(gap, doubt):
    """A map of two circles, ``gap`` pixels apart, between which the network has ``doubt`` nats for inside."""
    chains = [border_pixels(disc(radius))[0] for radius in (25, 25 + gap)]
    graph = build_graph(np.unique(np.vstack(chains), axis=0))
    centre = np.hypot(*(graph.points[graph.triangles].mean(axis=1) - 45).T)
    within = np.where(centre < 24.5, 9.0, np.where(centre < 24.5 + gap, doubt, -9.0))
    return graph, (within, np.full(len(graph.links), 9.0))


def test_the_width_of_what_hangs_on_a_few_nats_is_half_that_of_the_doubtful_ring():
    for gap in (4, 8):
        for doubt in (0.5, -0.5):
            assert abs(open_width(*two_circles(gap, doubt), DEFAULTS) - gap / 2) <= 1
        for sure in (6.0, -6.0):
            assert open_width(*two_circles(gap, sure), DEFAULTS) == 0


def test_more_width_is_more_chance_of_error():
    chance = chance_of_error(np.linspace(0, 20, 9), DEFAULTS)
    assert (np.diff(chance) > 0).all()
    assert 0 < chance[0] < 0.05
    assert 0.8 < chance[-1] < 1


class _Network:
    """Sure of the inner of two circles on even slices, and of nothing on odd ones."""

    def logits(self, slices):
        found = []
        for observed in slices:
            graph = observed.graph
            away = np.hypot(*(graph.points[graph.triangles].mean(axis=1) - 45).T)
            between = (away > 24.5) & (away < 32.5)
            sure = len(graph.points) % 2 == 0
            within = np.where(between, -9.0 if sure else 0.3, np.where(away < 25, 9.0, -9.0))
            found.append((within, np.full(len(graph.links), 9.0)))
        return found


def test_doubtful_slices_are_listed_and_their_uncertainty_is_stored(tmp_path):
    line = np.column_stack([np.arange(2, 10), np.full(8, 45)])
    pixels = raster_order(np.vstack([border_pixels(disc(radius))[0] for radius in (25, 33)] + [line]))
    even = pixels if len(build_graph(pixels).points) % 2 == 0 else np.vstack([pixels, [(0, 45)]])
    odd = np.vstack([even, [(0, 50)]])
    plain = raster_order(border_pixels(clear(20)[1])[0])
    curves, report = order_boundaries(boundaries([even, odd, plain], [0, 10, 20]), _Network())
    assert report["doubtful"] == [10]
    (warning,) = doubtful_slices(report)
    assert "10 (1 of 3;" in warning
    chance = dict(zip(curves.slice.tolist(), curves.uncertainty.tolist(), strict=True))
    assert chance[10] > 0.15 > chance[0] >= chance[20]
    splines = Splines(
        curves.points, curves.offsets, np.arange(5.0), np.zeros(len(curves) + 1, np.int64),
        curves.slice, curves.hole, 3, FRAME,
    )  # fmt: skip
    store.write_contours(tmp_path / "contours.h5", curves, report)
    read = store.read_contours(tmp_path / "contours.h5")
    codes = np.zeros(len(read.points), np.uint8)
    store.write_curves(
        tmp_path / "curves.h5", FittedCurves(read, codes, read.points, read.offsets, splines, {})
    )
    np.testing.assert_array_equal(store.read_curves(tmp_path / "curves.h5").uncertainty, curves.uncertainty)


def test_traced_curves_have_no_uncertainty_and_the_decoder_alone_none_either(tmp_path):
    curves, report = order_boundaries(boundaries([raster_order(border_pixels(disc(20))[0])]), None)
    assert curves.uncertainty is None
    assert doubtful_slices(report) == []
    store.write_contours(tmp_path / "contours.h5", curves, report)
    assert isinstance(back := store.read_contours(tmp_path / "contours.h5"), Curves)
    assert back.uncertainty is None
