"""The paper's chain to its end: corners of each k, splines with them as control points, a surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from shapely import MultiPolygon, Polygon

from cccd.containers import Boundaries, Curves, Sections, Structure
from cccd.contours import trace_contours
from cccd.curves.fitting import fit_splines
from cccd.geometry.arrays import concatenate_ragged
from cccd.geometry.raster import dice
from cccd.settings.surface import LoftSettings
from cccd.store import bodies_bytes
from cccd.surface.loft import loft_surface
from cccd_paper.comparisons.corner_measures import paper_splines
from cccd_paper.comparisons.orderers import Orderer
from cccd_paper.comparisons.paper_k import AUTOMATIC, TABLE_3
from cccd_paper.comparisons.samples import between, middle_slab
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.tuning import SAMPLES
from cccd_paper.settings import CornerSurfaceSettings
from cccd_workflow.surface_measures import Reference, measure_agreement

#: Bytes of a point as the paper counts them, two 32-bit indices; of the number of pixels that a curve bounds,
#: by which the surface is moved to their outer border; and of a grey value.
POINT_BYTES, PIXEL_COUNT_BYTES, GREY_BYTES = 8, 4, 2
#: The paper's stack (section 1).
STACK = 200


def compare_corner_surfaces(
    structure: Structure,
    boundaries: Boundaries,
    curves: Curves,
    settings: CornerSurfaceSettings,
    lofting: LoftSettings,
    orderers: Sequence[Orderer] = (),
    ks: Sequence[int] = TABLE_3,
) -> pd.DataFrame:
    """Loft a surface from the corner splines of each k, and one from the automatic splines beside them.

    Parameters
    ----------
    structure : Structure
        With a mask, against which the surfaces are measured; without one the table is empty.
    boundaries, curves : Boundaries, Curves
        Its boundary pixels and ordered curves.
    settings : CornerSurfaceSettings
        ``most_slices``: of an organ with more, a slab of so many adjacent slices is taken.
    lofting : LoftSettings
    orderers : sequence of Orderer
        The run's network, whose ordering is timed; without one it is the mask's tracing.
    ks : sequence of int

    Returns
    -------
    DataFrame
        One row per k and one ``automatic``: ``slices`` taken, ``control_points`` of the splines and their
        ``share`` of the boundary's pixels, ``dice_2d`` (median over the slices, against the filled curves),
        ``dice_3d``, ``assd_mm`` and ``volume_bias`` against the slab (missing where nothing solid comes out);
        ``stack_bytes``, what 200 such slices take: control points at the paper's 8 bytes each, and 4 bytes
        for the number of pixels of each curve; ``image_bytes``, what 200 images of the scan's matrix take at
        16 bits; ``net_bytes`` of the surface; processor seconds to ``order_s`` the boundary pixels,
        ``curve_s`` (corners and splines) and ``surface_s``, and their sum ``seconds``.

    Notes
    -----
    The splines run through boundary pixels. Lofting moves each outwards, by one pixel at most, until it
    encloses as many pixels as the curve that it was made of: without that number a spline of few corners
    stays too small.
    """
    if structure.mask is None or not len(curves):
        return pd.DataFrame()
    structure, curves, slices = middle_slab(structure, curves, settings.most_slices)
    boundaries = between(boundaries, slices, structure.frame)
    if orderers:  # compiled before anything is timed
        k = int(boundaries.slice[0])
        orderers[0](between(boundaries, range(k, k + 1), boundaries.frame))
    _, order_s = timed(orderers[0], boundaries) if orderers else timed(trace_contours, structure)
    reference = Reference.of(structure)
    rows = [_surface_of(curves, structure, k, lofting, order_s, reference) for k in (*ks, None)]
    table = pd.DataFrame(rows)
    table.insert(0, "k", [*map(str, ks), AUTOMATIC])
    return table


def _grown(drawn: Curves) -> Curves:
    """Move curves through the centres of pixels outwards by half a pixel, to where these end."""
    rings: list[np.ndarray] = []
    kept: list[int] = []
    for number, ring in enumerate(drawn.polygons):
        moved = Polygon(ring).buffer(-0.5 if drawn.hole[number] else 0.5)
        for part in moved.geoms if isinstance(moved, MultiPolygon) else [moved]:
            if not part.is_empty:
                rings.append(np.asarray(part.exterior.coords)[:-1])
                kept.append(number)
    points, offsets = concatenate_ragged(rings)
    return Curves(points, offsets, drawn.slice[kept], drawn.hole[kept], drawn.frame)


def _surface_of(
    curves: Curves,
    structure: Structure,
    k: int | None,
    lofting: LoftSettings,
    order_s: float,
    reference: Reference,
) -> dict[str, float]:
    """Splines and surface of one k, or of the automatic splines, measured."""
    splines, curve_s = timed(fit_splines, curves) if k is None else timed(paper_splines, curves, k)
    surface, surface_s = timed(lambda: loft_surface(Sections(_grown(splines.sample())), lofting))
    points, slices = len(splines.control_points), len(np.unique(curves.slice))
    rows, columns = (structure.frame.shape[axis] for axis in structure.frame.in_plane_axes)
    figures = (
        measure_agreement(surface.mesh, structure, reference, SAMPLES) if len(surface.mesh.faces) else {}
    )
    return {
        "slices": slices,
        "control_points": points,
        "share": points / len(curves.points),
        "dice_2d": _dice_2d(curves, splines.sample()),
        **{name: figures.get(name, np.nan) for name in ("dice_3d", "assd_mm", "volume_bias")},
        "stack_bytes": STACK * (POINT_BYTES * points + PIXEL_COUNT_BYTES * len(curves)) / slices,
        "image_bytes": GREY_BYTES * STACK * rows * columns,
        "net_bytes": bodies_bytes(surface.bodies),
        "order_s": order_s,
        "curve_s": curve_s,
        "surface_s": surface_s,
        "seconds": order_s + curve_s + surface_s,
    }


def _dice_2d(curves: Curves, drawn: Curves) -> float:
    """Median over the slices of the Dice of what the splines enclose, counted in pixels."""
    low = np.floor(np.minimum(curves.points.min(axis=0), drawn.points.min(axis=0))).astype(int) - 1
    high = np.ceil(np.maximum(curves.points.max(axis=0), drawn.points.max(axis=0))).astype(int) + 2
    slices = np.unique(curves.slice)
    rows, columns = (int(size) for size in high - low)
    origin, shape = (int(slices[0]), *low), (int(slices[-1] - slices[0]) + 1, rows, columns)
    scores = np.asarray(dice(curves.rasterise(origin, shape), drawn.rasterise(origin, shape), axis=(1, 2)))
    return float(np.median(scores[slices - slices[0]]))
