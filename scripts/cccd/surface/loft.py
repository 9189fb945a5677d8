"""Ordered curves -> tubes -> tensor-product B-spline patches, eq. (10) -> one closed mesh per body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from cccd.containers import Curves, Frame, Patch
from cccd.errors import InputError
from cccd.surface.bsplines import DEGREE
from cccd.surface.evaluate import swollen, tessellate
from cccd.surface.fields import distance_fields, interpolated_fields, through_pixel_centres
from cccd.surface.fit import Fit, Samples, even_size, fit_samples, refinements, sample_tube, sampled_area
from cccd.surface.rings import Ring, rings_of
from cccd.surface.solids import combine, fair_creases, remesh, solid, swelling, triangles, untangle
from cccd.surface.tubes import Tube, build_tubes

__all__ = ["Surface", "loft_surface"]

#: Levels between slices lie about this many pixels apart.
LEVEL_PIXELS = 1.5
#: Parts of fewer voxels than this are noise of the mask.
SMALLEST_PART_VOXELS = 6
#: The tolerance does not grow with voxels larger than this in mm.
COARSEST_MM = 1.5
#: Pixels and slices above these sizes in mm (2 x 2 x 3 and some rounding) make a coarse scan.
COARSE_MM = (2.05, 3.05)
#: Six times volume by surface, the diameter of a ball, below this many voxels: a thin organ.
THIN_VOXELS = 15
#: The whole surface moves by at most this many pixels to regain the volume of the slices.
MOST_SWELLING = 0.25
#: Booleans leave slivers: what moves the surface by less than this share of an edge is collapsed.
SLIVER = 0.01
#: The same where a surface that passes through itself could not be relaxed, and the grid's cell, in
#: edges, on which it is meshed anew if even that does not help.
COARSER, REMESH_CELL = 0.1, 0.75
#: Share of the control points that are laid out evenly before errors say where more are needed.
FIRST_SHARE = 0.25
#: Bytes of a control point (three float32), of a mesh vertex and of a triangle in binary PLY.
CONTROL_BYTES, VERTEX_BYTES, TRIANGLE_BYTES = 12, 12, 13


@dataclass
class Surface:
    """The surface of one structure.

    Attributes
    ----------
    patches : list of Patch
        Control nets in mm RAS.
    vertices : (V, 3) float64
        mm RAS.
    faces : (F, 3) int64
        Counter-clockwise from outside.
    frame : Frame
        The grid of the source volume.
    report : dict
        Plain JSON: tubes, branches, caps, cut ends, control points, bytes, repairs, warnings.
    """

    patches: list[Patch]
    vertices: np.ndarray
    faces: np.ndarray
    frame: Frame
    report: dict = field(default_factory=dict)


def loft_surface(curves: Curves, settings: Mapping, pixel_centres: bool | None = None) -> Surface:
    """Loft a stack of ordered curves.

    Parameters
    ----------
    curves : Curves
        Closed simple curves, outlines and holes.
    settings : mapping
        Section ``surface`` of the configuration: ``tolerance_voxels``, ``compactness``,
        ``bridge_slices``, ``edge_voxels``.
    pixel_centres : bool, optional
        Whether the curves run through pixel centres (the surface then encloses the pixels, half a
        pixel further out) or are the outline itself; by default told by their coordinates.

    Raises
    ------
    InputError
        When there is no curve at all.
    """
    if len(curves) == 0:
        raise InputError("curves", "there is not one closed curve", "check the mask or the boundary maps")
    frame = curves.frame
    if pixel_centres is None:
        pixel_centres = through_pixel_centres(curves)
    spacing = frame.pixel_spacing
    pixel = float(np.sqrt(spacing.prod()))
    tubes, origin, step, volume, voxel_faces = _tubes(curves, settings, pixel_centres)

    samples = [sample_tube(tube, _around(tube, pixel)) for tube in tubes]
    voxel = float(spacing.prod() * step)
    coarse = step > COARSE_MM[1] or spacing.max() > COARSE_MM[0]
    thin = coarse or 6 * volume / voxel / voxel_faces < THIN_VOXELS
    compactness = settings["compactness_thin" if thin else "compactness"]
    budget = voxel_faces * (VERTEX_BYTES + 2 * TRIANGLE_BYTES) / CONTROL_BYTES / compactness
    tolerance = settings["tolerance_voxels"] * min(pixel, voxel ** (1 / 3), COARSEST_MM)
    fits = _fit_all(samples, tolerance, budget)
    to_world = _to_world(frame, origin)
    patches = [_patch(fit, tube, to_world) for fit, tube in zip(fits, tubes, strict=True)]
    edge = settings["edge_voxels"] * pixel
    meshes = [tessellate(patch, edge) for patch in patches]
    bodies = [solid(untangle(*mesh)[0], mesh[1]) for mesh in meshes]
    whole = combine(bodies, [tube.hole for tube in tubes], [tube.depth for tube in tubes])
    vertices, faces, origins = triangles(whole.simplify(SLIVER * edge) if len(bodies) > 1 else whole)
    heights = vertices @ np.linalg.inv(to_world)[2, :3] + np.linalg.inv(to_world)[2, 3]
    lids = [tube.sections[side].z for tube in tubes for side in (0, -1) if tube.ends[side] == "cut"]
    on_lid = np.isclose(heights[:, None], lids, rtol=0, atol=1e-6).any(axis=1)
    joined = vertices
    vertices = fair_creases(vertices, faces, origins, on_lid)
    axis = frame.stack_affine[:3, 2] / frame.slice_spacing
    direction, amount = swelling(vertices, faces, axis, volume)
    amount = float(np.clip(amount, -MOST_SWELLING * pixel, MOST_SWELLING * pixel))
    vertices = vertices + amount * direction
    patches = [swollen(patch, patch.sign * amount, axis) for patch in patches]
    vertices, tangled, left = untangle(vertices, faces, joined)
    repairs = [f"relaxed {tangled} pairs of triangles that passed through each other"] if tangled else []
    if left:
        vertices, faces, _ = triangles(solid(vertices, faces).simplify(COARSER * edge))
        vertices, _, left = untangle(vertices, faces)
        repairs.append("collapsed short edges where that was not enough")
    if left:
        cell = REMESH_CELL * edge
        vertices, faces = remesh(vertices, faces, cell)
        repairs.append(f"meshed anew on a grid of {cell:.2f} mm: {left} pairs still did")
    report = _report(tubes, fits, vertices, faces, voxel_faces)
    report["repairs"] = repairs
    report["bodies"] = len(whole.decompose())
    return Surface(patches, vertices, faces, frame, report)


def _tubes(
    curves: Curves, settings: Mapping, pixel_centres: bool
) -> tuple[list[Tube], np.ndarray, float, float, int]:
    """Tubes of every stack, the plane's origin, the slice step and the volume in mm, the voxels' faces."""
    frame = curves.frame
    spacing = frame.pixel_spacing
    pixel = float(np.sqrt(spacing.prod()))
    slices, distance, origin = distance_fields(curves, pixel_centres)
    gaps = np.diff(slices)
    every = int(np.median(gaps)) if len(gaps) else 1
    step = every * frame.slice_spacing
    scan = (0.0, (frame.shape[frame.slice_axis] - 1) * frame.slice_spacing)
    smallest = SMALLEST_PART_VOXELS * spacing.prod() * step
    tubes, volume = [], 0.0
    breaks = np.flatnonzero(gaps > every * settings["bridge_slices"]) + 1
    for part in np.split(np.arange(len(slices)), breaks):
        stack = slice(part[0], part[-1] + 1)
        fields = list(
            interpolated_fields(slices[stack], distance[stack], frame.slice_spacing, LEVEL_PIXELS * pixel)
        )
        rings = [rings_of(plane, level, spacing, pixel_centres) for level, plane in enumerate(fields)]
        volume += _volume(rings, step)
        tubes += build_tubes(fields, rings, spacing, step / 2, scan, smallest)
    return tubes, origin, step, volume, _voxel_faces(distance < 0)


def _volume(levels: list[list[Ring]], step: float) -> float:
    """Volume in mm^3 that a stack of levels stands for, half a step beyond its first and last included."""
    area = np.array([sum(-ring.area if ring.hole else ring.area for ring in rings) for rings in levels])
    height = np.array([rings[0].z if rings else np.nan for rings in levels])
    area, height = area[np.isfinite(height)], height[np.isfinite(height)]
    return float(np.trapezoid(area, height) + (area[0] + area[-1]) * step / 2) if len(area) else 0.0


def _voxel_faces(mask: np.ndarray) -> int:
    """Faces between voxels inside and outside: the number of vertices of marching cubes on the stack."""
    padded = np.pad(mask, 1)
    return sum(int(np.count_nonzero(np.diff(padded, axis=axis))) for axis in range(3))


def _around(tube: Tube, pixel: float) -> int:
    """Count the samples around a tube: about one per pixel of its longest section, a multiple of 16."""
    longest = max(
        np.hypot(*(np.roll(section.points, -1, axis=0) - section.points).T).sum() for section in tube.sections
    )
    return int(np.clip(16 * np.ceil(longest / pixel / 16), 32, 320))


def _fit_all(samples: list[Samples], tolerance: float, budget: float) -> list[Fit]:
    """Refine every tube until its mean error is below the tolerance or the budget is used up.

    The next control points always go where they remove most error, weighted by the tube's size.
    """
    whole = sum(sampled_area(sample) for sample in samples)
    sizes = [even_size(sample, FIRST_SHARE * budget * sampled_area(sample) / whole) for sample in samples]
    fits = [fit_samples(sample, size, 1) for sample, size in zip(samples, sizes, strict=True)]
    weight = [sampled_area(sample) for sample in samples]
    spent = sum(fit.count for fit in fits)
    open_tubes = {n for n, fit in enumerate(fits) if fit.error > tolerance}
    gains: dict[int, tuple[float, tuple[int, int], Fit]] = {}
    while open_tubes:
        for n in open_tubes - gains.keys():
            best = None
            for size in refinements(sizes[n], samples[n]):
                trial = fit_samples(samples[n], size, 1)
                gain = (fits[n].error - trial.error) * weight[n] / (trial.count - fits[n].count)
                if best is None or gain > best[0]:
                    best = (gain, size, trial)
            if best is not None:
                gains[n] = best
        open_tubes &= gains.keys()
        if not open_tubes:
            break
        n = max(open_tubes, key=lambda tube: gains[tube][0])
        _, size, trial = gains.pop(n)
        added = trial.count - fits[n].count
        if spent + added > budget:
            open_tubes.discard(n)
            continue
        spent += added
        sizes[n], fits[n] = size, trial
        if trial.error <= tolerance:
            open_tubes.discard(n)
    return [fit_samples(sample, size) for sample, size in zip(samples, sizes, strict=True)]


def _to_world(frame: Frame, origin: np.ndarray) -> np.ndarray:
    """Affine (4, 4) from the fields' plane mm and height mm to mm RAS."""
    scale = np.diag([*(1 / frame.pixel_spacing), 1 / frame.slice_spacing, 1.0])
    scale[:2, 3] = origin
    return frame.stack_affine @ scale


def _patch(fit: Fit, tube: Tube, to_world: np.ndarray) -> Patch:
    nu, nv = fit.net.shape[:2]
    local = np.dstack([fit.net, np.broadcast_to(fit.heights, (nu, nv))])
    world = local @ to_world[:3, :3].T + to_world[:3, 3]
    return Patch(
        np.ascontiguousarray(world),
        np.ones((nu, nv)),
        fit.knots_u,
        fit.knots_v,
        DEGREE,
        DEGREE,
        True,
        False,
        -1 if tube.hole else 1,
    )


def _report(
    tubes: list[Tube], fits: list[Fit], vertices: np.ndarray, faces: np.ndarray, voxel_faces: int
) -> dict:
    ends = [end for tube in tubes for end in tube.ends]
    control_points = sum(fit.count for fit in fits)
    control_bytes = CONTROL_BYTES * control_points
    marching_bytes = voxel_faces * (VERTEX_BYTES + 2 * TRIANGLE_BYTES)
    return {
        "tubes": len(tubes),
        "cavities": sum(tube.hole for tube in tubes),
        "joined_ends": ends.count("joined"),
        "caps": ends.count("cap"),
        "openings": ends.count("opens"),
        "cut_ends": ends.count("cut"),
        "control_points": control_points,
        "control_bytes": control_bytes,
        "marching_cubes_bytes": marching_bytes,
        "compactness": marching_bytes / max(control_bytes, 1),
        "vertices": len(vertices),
        "triangles": len(faces),
        "mean_error_mm": float(np.mean([fit.error for fit in fits])) if fits else 0.0,
        "warnings": [],
    }
