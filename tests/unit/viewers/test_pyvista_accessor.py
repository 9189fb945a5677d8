"""PyVista's images give the surface that the library gives, wherever their voxels' values stand."""

import numpy as np
import pytest
import pyvista as pv

import cccd
import cccd_viewers.pyvista_accessor  # noqa: F401

SHAPE, SPACING, ORIGIN = (22, 24, 10), (1.0, 0.9, 2.0), (5.0, -3.0, 7.0)


def ball():
    offset = (np.indices(SHAPE).T - np.array([10, 12, 4.5])) * SPACING
    return (np.linalg.norm(offset, axis=-1) <= 8).T


def test_points_and_cells_lie_where_they_are():
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = ORIGIN
    expected = cccd.reconstruct(ball(), affine)
    points = pv.ImageData(dimensions=SHAPE, spacing=SPACING, origin=ORIGIN)
    points["organ"] = 3 * ball().ravel(order="F").astype(np.uint8)
    assert np.array_equal(points.cccd.reconstruct(label=3).vertices, expected.vertices)
    first = (3, 0, -2)  # an extract's indices need not begin at 0
    points.origin = np.subtract(ORIGIN, np.multiply(SPACING, first))
    points.SetExtent(*np.column_stack([first, np.add(first, SHAPE) - 1]).ravel())
    assert points.cccd.reconstruct(label=3).vertices == pytest.approx(expected.vertices, abs=1e-9)
    corner = np.subtract(ORIGIN, np.multiply(SPACING, 0.5))
    cells = pv.ImageData(dimensions=np.add(SHAPE, 1), spacing=SPACING, origin=corner)
    cells.cell_data["organ"] = ball().ravel(order="F").astype(np.uint8)
    drawn = cells.cccd.surface("organ")
    assert drawn.is_manifold
    assert drawn.points == pytest.approx(expected.vertices, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "label", "said"), [("liver", None, "there are: organ"), ("organ", 7, "organ|voxel")]
)
def test_what_is_not_there_is_said(name, label, said):
    image = pv.ImageData(dimensions=SHAPE, spacing=SPACING)
    image["organ"] = ball().ravel(order="F").astype(np.uint8)
    with pytest.raises(cccd.InputError, match=said):
        image.cccd.reconstruct(name, label)
