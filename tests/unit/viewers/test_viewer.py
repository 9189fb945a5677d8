"""What the page's figures hold lies where the organ lies."""

import base64
import json
import zlib

import numpy as np
import pytest
import trimesh
from support.shapes import drawn

from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd_viewers.page_files import View
from cccd_viewers.viewer import case_figure, colour_limit, colour_stops, packed, surface_figure

CUBE = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def numbers(typed):
    """What plotly.js makes of typed numbers."""
    return np.frombuffer(
        base64.b64decode(typed["bdata"]), {"f4": np.float32, "u4": np.uint32}[typed["dtype"]]
    )


def points_of(trace):
    return np.column_stack([numbers(trace[axis]) for axis in "xyz"])


@pytest.fixture
def figure():
    box = trimesh.creation.box((20, 30, 40))
    mesh = Mesh(np.asarray(box.vertices) + 5, np.asarray(box.faces, np.int64))
    values = {"distance": np.linspace(-0.4, 0.4, 8), "band": np.linspace(1, 2, 8)}
    corners = np.array(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1.0)]
    )
    square = np.array([(0, 0), (4, 0), (4, 4), (0, 4.0)])
    curves = drawn([square, square], [2, 5], (9, 9, 9), np.diag([1.0, 1, 3, 1]))
    view = View({"surface": mesh, "cubes": mesh}, values, 12, "the mask", {})
    return surface_figure(view, [ControlMesh(corners * 10, CUBE)], curves, "theirs", "distance"), mesh


def test_a_figure_holds_the_mesh_the_net_and_the_curves_in_mm(figure):
    traces = {trace["name"]: trace for trace in figure[0]["data"]}
    assert list(traces) == ["Surface", "theirs", "Control mesh", "Curves on the slices"]
    faces = np.column_stack([numbers(traces["Surface"][corner]) for corner in "ijk"])
    assert Mesh(points_of(traces["Surface"]).astype(float), faces.astype(np.int64)).volume == pytest.approx(
        24000
    )
    net = points_of(traces["Control mesh"]).reshape(-1, 3, 3)
    np.testing.assert_allclose(np.linalg.norm(net[:, 1] - net[:, 0], axis=1), 10)
    assert len(net) == 12
    assert np.isnan(net[:, 2]).all()
    lines = points_of(traces["Curves on the slices"]).reshape(2, 6, 3)
    assert np.isnan(lines[:, 5]).all()
    np.testing.assert_array_equal(lines[:, 0], lines[:, 4])  # closed
    assert lines[:, :5, 2].tolist() == [[6] * 5, [15] * 5]


def test_the_menu_colours_by_each_value_and_takes_the_colour_away(figure):
    (menu,) = figure[0]["layout"]["updatemenus"]
    assert [button["label"] for button in menu["buttons"]] == ["plain", "distance", "band"]
    assert menu["buttons"][0]["args"][0]["intensity"] == [None]
    distance, band = (button["args"][0] for button in menu["buttons"][1:])
    np.testing.assert_allclose(numbers(distance["intensity"][0]), np.linspace(-0.4, 0.4, 8), atol=1e-6)
    assert (distance["cmin"], distance["cmax"]) == ([-0.5], [0.5])
    assert (band["cmin"], band["cmax"]) == ([0], [2.0])
    assert menu["active"] == 1
    assert figure[0]["data"][0]["cmax"] == 0.5


def test_what_is_packed_is_plain_json(figure):
    assert json.loads(zlib.decompress(base64.b64decode(packed(figure[0])))) == figure[0]


def test_a_case_shows_its_largest_organ_first(figure):
    organs = [{"organ": "a", "name": "A", "color": "#010203", "volume_ml": 1.0}]
    organs.append(organs[0] | {"organ": "b", "name": "B", "volume_ml": 24.0})
    shown = case_figure(organs, {"a": figure[1], "b": figure[1]})["data"]
    assert [trace["name"] for trace in shown] == ["B (24 ml)", "A (1 ml)"]


@pytest.mark.parametrize(
    ("value", "limit"), [(0.0011, 0.0015), (1.0, 1.0), (4.2, 5.0), (71, 100.0), (0, 1.0)]
)
def test_colour_scales_end_at_round_numbers(value, limit):
    assert colour_limit(np.full(9, -value), "distance") == pytest.approx(limit)


def test_colour_scales_are_light_in_the_middle_and_the_bands_at_its_least():
    for name, stops in colour_stops().items():
        sums = np.sum(stops, axis=1)
        if name == "band":
            assert np.all(np.diff(sums[::8]) < 0)
            continue
        assert sums[len(sums) // 2] > 690
        assert max(sums[0], sums[-1]) < 330
