"""How well a result agrees with the truth: in the plane (equations 12-21), and on surfaces.

The paper prints its rates as shares of *all* pixels and calls TP / (TP + FN) precision, which everyone
else calls recall. `Confusion.printed` gives the equations as printed, `Confusion.standard` the usual
definitions of what goes by the same or a neighbouring name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from cccd.geometry.arrays import FloatArray
from cccd.geometry.booleans import shared_volume
from cccd.geometry.distance import nearest_faces, unsigned_to_mesh
from cccd.geometry.mesh import Mesh

__all__ = [
    "Confusion",
    "Gaps",
    "confusion",
    "dice",
    "normal_angles",
    "solid_dice",
    "surface_distances",
]

Counts = np.ndarray | int
Rates = np.ndarray | float


def _ratio(part: Counts, whole: Counts, empty: float = np.nan) -> Rates:
    """``part / whole``, and ``empty`` where the whole is nothing."""
    part, whole = np.asarray(part, float), np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(np.shape(whole), empty), where=whole > 0)[()]


@dataclass(frozen=True)
class Confusion:
    """Pixel counts of a prediction against the truth, for one region or an array of them.

    Attributes
    ----------
    tp, fp, tn, fn : int or array of int
        True positives, false positives, true negatives, false negatives (section 4.4).

    Examples
    --------
    >>> counts = Confusion(tp=40, fp=10, tn=40, fn=10)
    >>> float(counts.printed["DSC"]), float(counts.printed["TP rate"])
    (0.8, 0.4)
    """

    tp: Counts
    fp: Counts
    tn: Counts
    fn: Counts

    @property
    def printed(self) -> dict[str, Rates]:
        """Equations 12-21 as the paper prints them, under the abbreviations of its Figure 11."""
        tp, fp, tn, fn = self.tp, self.fp, self.tn, self.fn
        everything = tp + fp + tn + fn
        return {
            "TP rate": _ratio(tp, everything),  # eq. (12)
            "FP rate": _ratio(fp, everything),  # eq. (13)
            "TN rate": _ratio(tn, everything),  # eq. (14)
            "FN rate": _ratio(fn, everything),  # eq. (15)
            "ACC": _ratio(tp + tn, everything),  # eq. (16)
            "MC": _ratio(fp + fn, everything),  # eq. (17)
            "PRE": _ratio(tp, tp + fn),  # eq. (18): the usual recall
            "SPEC": _ratio(tn, tn + fp),  # eq. (19)
            "DSC": _ratio(2 * tp, 2 * tp + fp + fn, empty=1.0),  # eq. (20)
            "JI": _ratio(tp, tp + fp + fn, empty=1.0),  # eq. (21)
        }

    def take(self, regions: np.ndarray) -> Confusion:
        """Keep the counts of some of the regions, by their numbers."""
        tp, fp, tn, fn = (np.asarray(count)[regions] for count in (self.tp, self.fp, self.tn, self.fn))
        return Confusion(tp, fp, tn, fn)

    def together(self) -> Confusion:
        """Count all regions as one.

        Examples
        --------
        >>> counts = Confusion(*(np.array(count) for count in ([4, 1], [0, 2], [5, 5], [1, 0])))
        >>> int(counts.together().tp), float(counts.together().printed["JI"])
        (5, 0.625)
        """
        tp, fp, tn, fn = (np.sum(count) for count in (self.tp, self.fp, self.tn, self.fn))
        return Confusion(tp, fp, tn, fn)

    @property
    def standard(self) -> dict[str, Rates]:
        """The usual definitions where the printed ones differ from them."""
        return {
            "precision": _ratio(self.tp, self.tp + self.fp),
            "recall": _ratio(self.tp, self.tp + self.fn),
            "false positive rate": _ratio(self.fp, self.fp + self.tn),
            "false negative rate": _ratio(self.fn, self.fn + self.tp),
        }


def confusion(
    truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> Confusion:
    """Count agreeing and disagreeing pixels.

    Parameters
    ----------
    truth, predicted : bool arrays of one shape
        Foreground of the ground truth and of the prediction.
    axis : int or tuple of int, optional
        Axes to count over; all by default. ``(1, 2)`` counts each slice of a stack (S, I, J).

    Raises
    ------
    ValueError
        When the shapes differ.
    """
    truth, predicted = np.asarray(truth, bool), np.asarray(predicted, bool)
    if truth.shape != predicted.shape:
        raise ValueError(f"truth {truth.shape} and prediction {predicted.shape} differ in shape")
    tp = np.count_nonzero(truth & predicted, axis=axis)
    positives = np.count_nonzero(truth, axis=axis)
    claimed = np.count_nonzero(predicted, axis=axis)
    pixels = truth.size if axis is None else truth.size // max(np.size(positives), 1)
    return Confusion(tp=tp, fp=claimed - tp, tn=pixels - positives - claimed + tp, fn=positives - tp)


def dice(truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Rates:
    """Dice score, eq. (20); two empty regions agree (1)."""
    return confusion(truth, predicted, axis).printed["DSC"]


class Gaps(NamedTuple):
    """Distances in mm from points on each of two surfaces to the other, the points uniform by area.

    Attributes
    ----------
    there, back : (count,) float64
        From the first surface, and from the second.
    farthest : float
        The largest distance of these points, and of the vertices.
    areas : tuple of float
        Areas of the two surfaces.
    """

    there: FloatArray
    back: FloatArray
    farthest: float
    areas: tuple[float, float]

    @classmethod
    def between(cls, first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000) -> Gaps:
        """Measure them, from ``count`` points on each mesh."""
        points, others = first.sample(count, rng), second.sample(count, rng)
        there, back = unsigned_to_mesh(points, second), unsigned_to_mesh(others, first)
        farthest = max(_farthest(first, second, points, there), _farthest(second, first, others, back))
        return cls(there, back, farthest, (first.area, second.area))

    @property
    def figures(self) -> dict[str, float]:
        """What `surface_distances` returns."""
        return {
            "assd": float(self.there.sum() + self.back.sum()) / (len(self.there) + len(self.back)),
            "hd95": float(max(np.percentile(self.there, 95), np.percentile(self.back, 95))),
            "hausdorff": self.farthest,
        }

    def surface_dice(self, tolerance: float) -> float:
        """Share of both surfaces that lies within a tolerance in mm of the other (Nikolov et al. 2021)."""
        within = [float(np.mean(part <= tolerance)) for part in (self.there, self.back)]
        return float(np.average(within, weights=self.areas))


def surface_distances(
    first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000
) -> dict[str, float]:
    """Distances in mm between two meshes, both ways, from area-uniform points to the other's triangles.

    Returns
    -------
    dict
        ``assd`` (average symmetric surface distance), ``hd95`` (the larger of the two 95th
        percentiles) and ``hausdorff`` (the largest distance met, vertices included).
    """
    return Gaps.between(first, second, rng, count).figures


def _farthest(mesh: Mesh, other: Mesh, points: FloatArray, distances: FloatArray) -> float:
    """Largest distance to another mesh, of points (P, 3) whose distances (P,) are known, and of vertices."""
    far = float(distances.max())
    away, nearest = scipy.spatial.cKDTree(points).query(mesh.vertices)
    further = mesh.vertices[distances[nearest] + away > far]  # no others can be: a step away is a step more
    return max(far, float(unsigned_to_mesh(further, other).max())) if len(further) else far


def solid_dice(first: Mesh, second: Mesh) -> float | None:
    """Dice of what two closed meshes enclose, exact; None where one of them bounds no solid."""
    shared = shared_volume(first, second)
    return None if shared is None else min(1.0, 2 * shared / (first.volume + second.volume))


def normal_angles(
    mesh: Mesh, truth: Mesh, rng: np.random.Generator, count: int = 10_000, *, is_smooth: bool = True
) -> np.ndarray:
    """Angles (count,) in degrees between a mesh's normals and the true surface's at the nearest points.

    Points are uniform by area of the truth. A mesh's normal is that of the face nearest to the point; the
    true surface's is between those of its vertices, because its own faces are coarser than its shape. Where
    it is not ``is_smooth``, but a mesh like the other, its normal is its face's: equal meshes agree.
    """
    face = rng.choice(len(truth.faces), count, p=truth.face_areas / truth.area)
    weights = rng.dirichlet(np.ones(3), count)
    points = np.einsum("pc,pcx->px", weights, truth.vertices[truth.faces[face]])
    at_corners = truth.vertex_normals[truth.faces[face]] if is_smooth else truth.unit_normals[face][:, None]
    true = (weights[..., None] * at_corners).sum(axis=1)
    nearest = mesh.unit_normals[nearest_faces(points, mesh)]
    across = np.linalg.norm(np.cross(true, nearest), axis=1)
    return np.degrees(np.arctan2(across, np.einsum("px,px->p", true, nearest)))
