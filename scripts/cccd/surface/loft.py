"""Ordered curves -> tubes -> tensor-product B-spline patches, eq. (10) -> one closed mesh per body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cccd.containers import Curves, Frame, Patch
from cccd.errors import InputError
from cccd.metrics import mesh_area, mesh_volume
from cccd.surface.blending import blended
from cccd.surface.bsplines import DEGREE
from cccd.surface.evaluate import swollen, tessellate
from cccd.surface.fields import distance_fields, interpolated_fields, through_pixel_centres
from cccd.surface.fit import Fit, Samples, even_size, fit_samples, refinements, sample_tube, sampled_area
from cccd.surface.guide import Guide
from cccd.surface.rings import Ring, rings_of
from cccd.surface.solids import combine, solid, triangles
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
#: Blends reach this many pixels, or slice steps, to either side of the line along which tubes meet.
BLEND_PIXELS, BLEND_STEPS = 6.0, 3.0
#: Flat lids stay where they are when the surface moves; the rest follows within this many cells of them.
LID_CELLS, SAME_LID = 3.0, 1e-3
#: Cells of the grid on which the surface is meshed, in edges (marching cubes' edges are a little longer),
#: and how many of them thin organs have at least through their thickness.
CELL, THICKNESS_CELLS = 0.8, 25
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
        Plain JSON: tubes, branches, caps, cut ends, control points, bytes, warnings.
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
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    if len(curves) == 0:
        raise InputError("curves", "there is not one closed curve", "check the mask or the boundary maps")
    frame = curves.frame
    if pixel_centres is None:
        pixel_centres = through_pixel_centres(curves)
    spacing = frame.pixel_spacing
    pixel = float(np.sqrt(spacing.prod()))
    stack = _tubes(curves, settings, pixel_centres)
    tubes = stack.tubes

    reach = max(BLEND_PIXELS * pixel, BLEND_STEPS * stack.step)
    samples = [sample_tube(tube, _around(tube, pixel), stack.guide, pixel, reach / 2) for tube in tubes]
    coarse = stack.step > COARSE_MM[1] or spacing.max() > COARSE_MM[0]
    thin = coarse or stack.voxels_through < THIN_VOXELS
    compactness = settings["compactness_thin" if thin else "compactness"]
    marching_bytes = int(stack.voxel_faces.sum()) * (VERTEX_BYTES + 2 * TRIANGLE_BYTES)
    budget = marching_bytes / CONTROL_BYTES / compactness
    tolerance = settings["tolerance_voxels"] * min(pixel, float(np.cbrt(stack.voxel.prod())), COARSEST_MM)
    fits = _fit_all(samples, tolerance, budget)
    local = [_patch(fit, tube) for fit, tube in zip(fits, tubes, strict=True)]
    jumps = np.concatenate([sample.jumps for sample in samples])
    vertices, faces, amount = _mesh(local, stack, jumps, settings["edge_voxels"] * pixel, pixel, reach)
    to_world = _to_world(frame, stack.origin)
    up = np.array([0.0, 0.0, 1.0])
    patches = [_moved(swollen(patch, patch.sign * amount, up), to_world) for patch in local]
    vertices = vertices @ to_world[:3, :3].T + to_world[:3, 3]
    if np.linalg.det(to_world[:3, :3]) < 0:
        faces = np.ascontiguousarray(faces[:, ::-1])
    report = _report(tubes, fits, vertices, faces, marching_bytes)
    report["bodies"] = _bodies(vertices, faces)
    if stack.left_out:
        report["warnings"].append(
            f"{stack.left_out} parts of fewer than {SMALLEST_PART_VOXELS} voxels are not in the surface"
        )
    return Surface(patches, vertices, faces, frame, report)


@dataclass(frozen=True)
class _Stack:
    """What the slices hold: tubes in the plane's mm and height, and what they are measured by.

    ``origin`` (2,) is the plane's first pixel, ``voxel`` (3,) the distance between slices and a pixel's
    edges in mm, ``voxel_faces`` (3,) the faces between voxels inside and outside, square to each of them,
    ``volume`` what the slices enclose in mm, ``thickness`` six times that by its surface (the diameter of a
    ball, three times that of a plate), ``left_out`` the number of parts that were too small for a tube.
    """

    tubes: list[Tube]
    guide: Guide
    origin: np.ndarray
    voxel: np.ndarray
    voxel_faces: np.ndarray
    volume: float
    thickness: float
    left_out: int

    @property
    def step(self) -> float:
        """Distance between slices in mm."""
        return float(self.voxel[0])

    @property
    def voxels_through(self) -> float:
        """The thickness counted in voxels."""
        return 6 * self.volume / float(self.voxel.prod() * self.voxel_faces.sum())


def _mesh(
    patches: list[Patch], stack: _Stack, jumps: np.ndarray, edge: float, pixel: float, reach: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Vertices and faces of all tubes together, and by how many mm they had to move outwards."""
    tubes = stack.tubes
    cell = float(np.clip(stack.thickness / THICKNESS_CELLS, edge / 2, CELL * edge))
    bodies = [solid(*tessellate(patch, cell / CELL)) for patch in patches]
    joined = triangles(combine(bodies, [tube.hole for tube in tubes], [tube.depth for tube in tubes]))
    if len(joined[1]) == 0:  # holes as wide as what they are in
        joined = triangles(bodies[0])
    vertices, faces, origins = joined
    seams = np.concatenate([_seams(vertices, faces, origins), jumps])
    level_set = blended(vertices, faces, seams, stack.guide, reach, cell)
    lids = [
        (tube.sections[-way].z, 2 * way - 1) for tube in tubes for way in (0, 1) if tube.ends[way] == "cut"
    ]
    meshed = level_set.mesh()
    if len(meshed[1]) == 0:
        return vertices, faces, 0.0
    on_lid = np.isclose(meshed[0][:, 2:], [z for z, _ in lids], rtol=0, atol=SAME_LID * cell).any(axis=1)
    wall = mesh_area(meshed[0], meshed[1][~on_lid[meshed[1]].all(axis=1)])
    most = MOST_SWELLING * pixel
    amount = float(np.clip((stack.volume - mesh_volume(*meshed)) / max(wall, 1e-9), -most, most))
    vertices, faces = level_set.mesh(amount)
    for z, way in set(lids):
        away = np.abs(vertices[:, 2] - (z + way * amount)) / cell
        vertices[:, 2] -= way * amount * np.clip(1 - away / LID_CELLS, 0, 1)
        vertices[away < SAME_LID, 2] = z
    return vertices, faces, amount


def _seams(vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """Vertices (P, 3) at which faces (F,) of different origin meet."""
    first = np.full(len(vertices), origins.max() + 1)
    last = np.full(len(vertices), origins.min() - 1)
    for corner in range(3):
        np.minimum.at(first, faces[:, corner], origins)
        np.maximum.at(last, faces[:, corner], origins)
    return vertices[first < last]


def _bodies(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Count the pieces of a mesh that are not the inside of a cavity."""
    links = coo_array(
        (np.ones(faces.size, bool), (faces.ravel(), np.roll(faces, 1, axis=1).ravel())),
        shape=2 * (len(vertices),),
    )
    _, piece = connected_components(links, directed=False)
    a, b, c = (vertices[faces[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    volume = np.bincount(piece[faces[:, 0]], np.einsum("fc,fc->f", a, np.cross(b, c)))
    return int(np.count_nonzero(volume > 0))


def _tubes(curves: Curves, settings: Mapping, pixel_centres: bool) -> _Stack:
    """Contours of all slices, and of levels between them, matched into tubes."""
    frame = curves.frame
    spacing = frame.pixel_spacing
    pixel = float(np.sqrt(spacing.prod()))
    slices, distance, origin = distance_fields(curves, pixel_centres)
    gaps = np.diff(slices)
    every = int(np.median(gaps)) if len(gaps) else 1
    step = every * frame.slice_spacing
    scan = (0.0, (frame.shape[frame.slice_axis] - 1) * frame.slice_spacing)
    smallest = SMALLEST_PART_VOXELS * spacing.prod() * step
    tubes, levels, volume, left_out = [], [], 0.0, 0
    breaks = np.flatnonzero(gaps > every * settings["bridge_slices"]) + 1
    for part in np.split(np.arange(len(slices)), breaks):
        stack = slice(part[0], part[-1] + 1)
        fields = list(
            interpolated_fields(slices[stack], distance[stack], frame.slice_spacing, LEVEL_PIXELS * pixel)
        )
        rings = [rings_of(plane, level, spacing, pixel_centres) for level, plane in enumerate(fields)]
        volume += _volume(rings, step)
        found, missing = build_tubes(fields, rings, spacing, step / 2, scan, smallest)
        tubes += found
        left_out += missing
        levels += fields
    if not tubes:
        raise InputError(
            "curves", "no curve goes around the centre of a pixel", "check the contours and the grid"
        )
    voxel, voxel_faces = np.array([step, *spacing]), _voxel_faces(distance < 0)
    thickness = 6 * volume / float(voxel_faces @ (voxel.prod() / voxel))
    for way, end in ((-1, levels[0]), (1, levels[-1])):  # what the scan cuts goes on up to its lid
        if abs(end.z - scan[way > 0]) < step / 2:
            levels.insert(0 if way < 0 else len(levels), replace(end, z=end.z + way * step / 2))
    guide = Guide.of(levels, spacing, settings["bridge_slices"] * step + pixel, thickness)
    return _Stack(tubes, guide, origin, voxel, voxel_faces, volume, thickness, left_out)


def _volume(levels: list[list[Ring]], step: float) -> float:
    """Volume in mm^3 that a stack of levels stands for, half a step beyond its first and last included."""
    area = np.array([sum(-ring.area if ring.hole else ring.area for ring in rings) for rings in levels])
    height = np.array([rings[0].z if rings else np.nan for rings in levels])
    area, height = area[np.isfinite(height)], height[np.isfinite(height)]
    return float(np.trapezoid(area, height) + (area[0] + area[-1]) * step / 2) if len(area) else 0.0


def _voxel_faces(mask: np.ndarray) -> np.ndarray:
    """Faces (3,) between voxels inside and outside, by axis: the vertices of marching cubes on the stack."""
    padded = np.pad(mask, 1)
    return np.array([np.count_nonzero(np.diff(padded, axis=axis)) for axis in range(3)])


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
            for size in refinements(sizes[n], samples[n], budget - spent):
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
        if spent + added > budget:  # another tube used the room that this was tried for
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


def _patch(fit: Fit, tube: Tube) -> Patch:
    """Give a tube's net the heights of its rows."""
    nu, nv = fit.net.shape[:2]
    return Patch(
        np.dstack([fit.net, np.broadcast_to(fit.heights, (nu, nv))]),
        np.ones((nu, nv)),
        fit.knots_u,
        fit.knots_v,
        DEGREE,
        DEGREE,
        True,
        False,
        -1 if tube.hole else 1,
    )


def _moved(patch: Patch, affine: np.ndarray) -> Patch:
    points = patch.control_points @ affine[:3, :3].T + affine[:3, 3]
    return replace(patch, control_points=np.ascontiguousarray(points))


def _report(
    tubes: list[Tube], fits: list[Fit], vertices: np.ndarray, faces: np.ndarray, marching_bytes: int
) -> dict:
    ends = [end for tube in tubes for end in tube.ends]
    control_points = sum(fit.count for fit in fits)
    control_bytes = CONTROL_BYTES * control_points
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
