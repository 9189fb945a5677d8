"""How a tube ends where nothing follows: rounded or planar caps, the scan's border, a hole that opens."""

from __future__ import annotations

import numpy as np
import shapely

from cccd.geometry.arrays import FloatArray
from cccd.geometry.polygons import resample
from cccd.settings.surface import MatchingSettings
from cccd.surface.ring_graph import RingGraph
from cccd.surface.rings import Ring, overlap
from cccd.surface.stack import Run
from cccd.surface.tubes import Section

__all__ = ["cap_height", "opening", "planar_cap", "reaches_scan_border", "rounded_cap"]

#: Radii, as shares of the end ring's, at which a rounded cap is sampled.
CAP_RADII = np.array([0.96, 0.85, 0.65, 0.4, 0.15])
#: Angles in degrees at which the rounded rim of a planar cap is sampled, and the least share of the ring's
#: area that the cap keeps.
RIM_ANGLES, RIM_AREA = (35, 60, 80, 90), 0.3
#: Points of an outline that is looked at for its kernel.
KERNEL_POINTS = 48


def reaches_scan_border(ring: Ring, way: int, run: Run) -> bool:
    """Whether the scan ends at a ring's slice."""
    return abs(ring.z - run.scan_range[way]) < run.half_step


def planar_cap(ring: Ring, way: int, run: Run) -> list[Section]:
    """Repeat the ring half a slice step further, where the scan cuts the organ."""
    return [Section.of_ring(ring, ring.z + _sign(way) * run.half_step)]


def cap_height(ring: Ring, way: int, graph: RingGraph, run: Run, settings: MatchingSettings) -> float:
    """Height in mm at which a tube closes beyond ``ring``, by the area of its last slices.

    Near its pole the section of any smooth body falls linearly with height, as a paraboloid's does. Where it
    was drawn on planes across the slices, they say how far it goes.
    """
    step = run.step
    drawn = [rise for guide in run.guides if (rise := guide.rise(ring, way)) is not None]
    if drawn:
        return max(drawn)
    # what nobody drew was made to end: it falls as it was made to
    back = run.pixel if run.of_some_slices and ring.source_slice is None else step
    before = ring
    while abs(before.z - ring.z) < 0.99 * back and (further := graph.next(before, 1 - way)) is not None:
        before = further
    fall = (before.area - ring.area) / max(abs(before.z - ring.z), 1e-9)
    low, high = settings.lowest_cap_steps, settings.highest_cap_steps
    return float(np.clip(ring.area / fall, low * back, high * step)) if fall > 0 else high * step


def rounded_cap(
    ring: Ring, way: int, height: float, rim_depth: float
) -> tuple[list[Section], FloatArray | None]:
    """Round an end over ``height`` mm: sections outwards, and the pole if there is one.

    A ring that a point inside it sees as a whole closes on a pole as a paraboloid; any other is rounded
    over its rim and gets a planar cap that leaves it half the volume too; the rim cuts in by at most
    ``rim_depth`` of the inradius.
    """
    centre = _kernel_point(ring.points)
    if centre is None:
        return _rounded_rim(ring, _sign(way) * height / 2, height / 2, rim_depth), None
    rise = _sign(way) * height
    sections = [
        Section(
            ring.z + rise * float(1 - radius**2),
            centre + radius * (ring.points - centre),
            ring.area * radius**2,
        )
        for radius in CAP_RADII
    ]
    return sections, np.array([*centre, ring.z + rise])


def _rounded_rim(ring: Ring, rise: float, depth: float, rim_depth: float) -> list[Section]:
    """Sections that shrink on a quarter of an ellipse up to a planar cap ``rise`` mm from the ring."""
    shape = shapely.Polygon(ring.points).buffer(0)
    inradius = 2 * shape.area / shape.length
    depth = min(depth, rim_depth * inradius)
    sections: list[Section] = []
    for angle in np.deg2rad(RIM_ANGLES):
        smaller = _largest(shape.buffer(-depth * (1 - np.cos(angle))))
        if smaller is None or smaller.area < RIM_AREA * ring.area:
            break
        sections.append(Section.of_polygon(ring.z + rise * float(np.sin(angle)), smaller))
    return sections or [Section.of_ring(ring, ring.z + rise)]


def _kernel_point(points: FloatArray) -> FloatArray | None:
    """Find a point from which the whole polygon is seen, but for its pixel steps; None for bent shapes."""
    outline = resample(points, KERNEL_POINTS)
    smooth = (np.roll(outline, 1, axis=0) + 2 * outline + np.roll(outline, -1, axis=0)) / 4
    shape = shapely.Polygon(smooth)
    for centre in (shape.centroid, shapely.maximum_inscribed_circle(shape.buffer(0)).centroid):
        arms = smooth - (centre.x, centre.y)
        following = np.roll(arms, -1, axis=0)
        turning = arms[:, 0] * following[:, 1] - arms[:, 1] * following[:, 0]
        if np.all(turning > 0):
            return np.array([centre.x, centre.y])
    return None


def opening(ring: Ring, way: int, run: Run, share: float) -> list[Section] | None:
    """Sections that lead a hole to the outside on the next level; None when it does not open there.

    It opens where at least a ``share`` of its area meets the outside. A hole that is open in the organ's
    last slice, or before, runs on straight through the cap.
    """
    level = ring.level + _sign(way)
    beyond = _sign(way) * run.step
    following = run.rings[level] if 0 <= level < len(run.rings) else ()
    covers = [other for other in following if not other.hole and overlap(ring, other)]
    if not covers:
        return [Section.of_ring(ring, ring.z + beyond)]
    outside = shapely.Polygon(ring.points).buffer(0)
    for cover in covers:
        outside = outside.difference(shapely.Polygon(cover.points).buffer(0))
    shape = _largest(outside)
    if shape is None or shape.area < max(run.pixel**2, share * ring.area):
        return None
    section = Section.of_polygon(run.fields[level].z, shape)
    if 0 < level < len(run.rings) - 1:
        return [section]
    return [section, Section(section.z + beyond, section.points, section.area)]


def _sign(way: int) -> int:
    """-1 for downwards, +1 for upwards."""
    return 2 * way - 1


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    """Pick the largest of a shape's polygons, if it has any."""
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon) and part.area > 0]
    return max(parts, key=lambda part: part.area) if parts else None
