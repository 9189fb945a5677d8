"""CT-like phantoms whose true surface is known.

An organ is the zero set of a smooth function (`cccd_datasets.implicit_solids`), varied by the seed. Its
scan has the grid of a LiTS volume, partial volume through the thick slices, the scanner's blur and noise, and
the neighbours that a CT shows around the organ. The mask holds the voxels whose centres lie inside.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from cccd.containers import Frame, Structure
from cccd.errors import InputError, nearest
from cccd.geometry.arrays import AnyArray
from cccd_datasets.implicit_solids import (
    ImplicitFunction,
    Tissue,
    capsule,
    ellipsoid,
    half_space,
    interpolate_lattice,
    intersection,
    mesh_zero_set,
    paint_tissues,
    sample_lattice,
    subtraction,
    torus,
    union,
    warped,
)

#: Pixels of a slice along i and j, and sub-slices that make up a thick slice.
_MATRIX, _SUBSLICES = 512, 5

#: Standard deviations of the scanner's in-plane point spread, as of a soft-tissue kernel, and of the noise,
#: as of a clinical abdominal CT.
BLUR_MM, NOISE_HU = 0.7, 12.0

#: Attenuation in HU.
_AIR, _LUNG, _FAT, _MUSCLE, _LIVER, _BLOOD, _BONE = -1000.0, -850.0, -95.0, 50.0, 105.0, 155.0, 380.0

#: Attenuation in HU of organs of the upper abdomen, with contrast agent and without.
_ENHANCED = {
    "liver": _LIVER,
    "vessels": _BLOOD,
    "heart": 120.0,
    "spleen": 115.0,
    "kidneys": 165.0,
    "pancreas": 85.0,
    "stomach": 35.0,
    "gallbladder": 12.0,
    "bowel": 30.0,
    "aorta": 190.0,
}
_PLAIN = {
    "liver": _MUSCLE,
    "vessels": 38.0,
    "heart": 40.0,
    "spleen": 45.0,
    "kidneys": 30.0,
    "pancreas": 38.0,
    "stomach": 25.0,
    "gallbladder": 8.0,
    "bowel": 25.0,
    "aorta": 40.0,
}

#: Thickness of the diaphragm, mm.
_DIAPHRAGM_MM = 3.0

#: Length and radius in mm of the airways' generations, from the trachea on.
_AIRWAYS_MM = ((60.0, 8.0), (42.0, 6.0), (26.0, 4.4), (19.0, 3.2), (14.0, 2.4), (10.0, 1.8))


@dataclass(frozen=True)
class Anatomy:
    """What is scanned: the organ, and its neighbours in the order in which they cover each other.

    Attributes
    ----------
    organ : ImplicitFunction
        The organ.
    bbox_min, bbox_max : (3,) float
        A box around the organ, mm.
    mesh_step : float
        Edge of the cubes that triangulate the organ, mm.
    hu : float
        The organ's attenuation.
    around : list of Tissue
        Neighbours; the later cover the earlier.
    within : list of Tissue
        Vessels inside the organ.
    """

    organ: ImplicitFunction
    bbox_min: AnyArray
    bbox_max: AnyArray
    mesh_step: float
    hu: float
    around: list[Tissue]
    within: list[Tissue]


def _ribs(cage: ImplicitFunction) -> ImplicitFunction:
    """Twelve oblique bars in the shell around ``cage``, 24 mm apart."""

    def distance(points: AnyArray) -> AnyArray:
        x, y, z = points
        descent = z - 0.45 * y - 0.1 * np.abs(x)
        return np.hypot(cage(points) - 7, np.abs((descent % 24.0) - 12.0) * 0.7) - 4.0

    return distance


def _trunk(width: float, depth: float) -> list[Tissue]:
    """Skin, fat, muscle, ribs and spine of a trunk with semi-axes ``width`` and ``depth`` mm."""
    cage = ellipsoid((0, 5, 0), (width, depth, 900))
    skin = ellipsoid((0, 0, 0), (width + 32, depth + 30, 1200))
    vertebra = union(
        ellipsoid((0, -depth + 14, 0), (22, 17, 900)),
        capsule((0, -depth - 6, -900), (0, -depth - 24, 900), 6),
        radius=8,
    )
    marrow = ellipsoid((0, -depth + 14, 0), (19, 14, 900))
    canal = ellipsoid((0, -depth - 8, 0), (9, 8, 900))
    return [
        (skin, _FAT),
        (ellipsoid((0, 3, 0), (width + 15, depth + 15, 1000)), _MUSCLE),
        (_ribs(cage), _BONE),
        (cage, _FAT),
        (ellipsoid((24, -depth + 2, 0), (16, 13, 900)), _MUSCLE),
        (ellipsoid((-24, -depth + 2, 0), (16, 13, 900)), _MUSCLE),
        (vertebra, _BONE),
        (marrow, 190.0),
        (canal, 20.0),
    ]


def _tree(rng: np.random.Generator, root: AnyArray, tips: AnyArray, radius: float) -> ImplicitFunction:
    """Vessels from ``root`` (3,) mm over a common stem to each of ``tips`` (n, 3), thinner after a fork."""
    stem = root + 0.35 * (tips.mean(axis=0) - root)
    pieces = [capsule(root, stem, radius)]
    for tip in tips:
        knee = stem + 0.5 * (tip - stem) + rng.normal(0, 4, 3)
        pieces += [capsule(stem, knee, 0.65 * radius), capsule(knee, tip, 0.4 * radius)]
    return union(*pieces, radius=2)


def _liver(rng: np.random.Generator, hu: Mapping[str, float] = _ENHANCED) -> Anatomy:
    size = rng.normal(1, 0.04, (2, 3))
    shift = rng.normal(0, 3, (2, 3))
    lean = Rotation.from_rotvec([0, np.deg2rad(rng.normal(-14, 3)), 0]).as_matrix()
    right = ellipsoid(np.array((70, 0, 0)) + shift[0], np.array((70, 80, 84)) * size[0])
    left = ellipsoid(np.array((-22, 36, 30)) + shift[1], np.array((76, 40, 33)) * size[1], lean)
    body = intersection(union(right, left, radius=26), ellipsoid((0, 5, 0), (137, 85, 600)), radius=8)
    organ = subtraction(
        body,
        ellipsoid(np.array((-22, -38, -56)) + shift[1], (76, 66, 74)),  # visceral face
        ellipsoid((62, -60, -62), (32, 29, 54)),  # renal impression
        capsule((22, -46, -300), (22, -42, 300), 14),
        ellipsoid(np.array((46, 38, -62)) + shift[0], (16, 26, 27)),
        ellipsoid((26, -2, -34), (42, 9, 24)),  # porta hepatis
        ellipsoid(np.array((6, 74, 4)) + shift[1], (4.5, 32, 70)),  # falciform notch
        radius=7,
    )
    organ = warped(organ, rng, 2.5, 90)
    tips = np.array([(110, 20, 30), (105, -35, 10), (70, 40, 25), (100, 0, -40), (0, 45, 30), (80, -10, 50)])
    portal = _tree(rng, np.array((30.0, -4, -30)), tips + rng.normal(0, 5, tips.shape), 7)
    hepatic = _tree(
        rng, np.array((22.0, -40, 58)), np.array([(75.0, 10, 35), (20, 50, 40), (95, -40, 45)]), 5.5
    )
    gallbladder = ellipsoid(np.array((44, 36, -58)) + shift[0], (13, 22, 24))
    around = _trunk(142, 90) + _liver_neighbours(gallbladder, hu)
    within = [(portal, hu["vessels"]), (hepatic, hu["vessels"])]
    return Anatomy(
        organ, np.array((-120, -100, -110)), np.array((160, 105, 115)), 2.0, hu["liver"], around, within
    )


def _plain_liver(rng: np.random.Generator) -> Anatomy:
    """Liver without contrast agent, as grey as the muscle that it touches.

    The abdominal wall lies on its right side and its back, elsewhere fat is in between; the diaphragm covers
    it as far as the lungs and the heart reach down.
    """
    whole = _liver(rng, _PLAIN)

    def thicker(points: AnyArray) -> AnyArray:
        return whole.organ(points) - points.dtype.type(_DIAPHRAGM_MM)

    trunk = _trunk(142, 90)
    wall = [(ellipsoid((0, 5, 0), (142, 90, 900)), _MUSCLE), (ellipsoid((-6, 8, 0), (139, 87, 900)), _FAT)]
    lungs, heart, *others = whole.around[len(trunk) :]
    diaphragm = (intersection(thicker, half_space((0, 0, 10), (0, 0, -1))), _MUSCLE)
    cage = 1 + next(n for n, (_, value) in enumerate(trunk) if value == _BONE)  # the fat inside the ribs
    around = [*trunk[:cage], *wall, *trunk[cage + 1 :], lungs, heart, diaphragm, *others]
    return replace(whole, around=around)


def _liver_neighbours(gallbladder: ImplicitFunction, hu: Mapping[str, float]) -> list[Tissue]:
    """Lower lungs, heart, and organs of the upper abdomen."""
    stomach = ellipsoid((-62, 18, 5), (46, 36, 58))
    lungs = subtraction(
        intersection(ellipsoid((0, 5, 0), (139, 87, 900)), half_space((0, 0, 12), (0, 0, -1))),
        union(ellipsoid((68, 0, 0), (76, 86, 90)), ellipsoid((-60, 5, -10), (74, 84, 92)), radius=20),
        ellipsoid((0, -5, 100), (30, 70, 150)),
    )
    spleen = subtraction(
        ellipsoid((-98, -42, 8), (30, 40, 52)), ellipsoid((-58, -20, 5), (36, 36, 60)), radius=5
    )
    return [
        (lungs, _LUNG),
        (ellipsoid((-20, 30, 120), (58, 44, 58)), hu["heart"]),
        (spleen, hu["spleen"]),
        (ellipsoid((-66, -58, -52), (27, 24, 50)), hu["kidneys"]),
        (ellipsoid((64, -58, -62), (27, 25, 50)), hu["kidneys"]),
        (ellipsoid((64, -54, -62), (11, 12, 26)), _FAT),
        (ellipsoid((-5, 8, -45), (60, 16, 14)), hu["pancreas"]),
        (stomach, hu["stomach"]),
        (intersection(stomach, half_space((0, 34, 0), (0, -1, 0))), _AIR),
        (gallbladder, hu["gallbladder"]),
        (ellipsoid((0, 20, -95), (95, 40, 26)), hu["bowel"]),
        (capsule((-12, -52, -300), (-10, -52, 300), 10), hu["aorta"]),
        (capsule((22, -46, -300), (22, -42, 300), 12), hu["vessels"]),  # vena cava
    ]


def _lungs(rng: np.random.Generator) -> Anatomy:
    size = rng.normal(1, 0.03, (2, 3))
    shift = rng.normal(0, 2.5, (2, 3))
    wall = ellipsoid((0, 2, -20), (134, 90, 260))
    domes = [
        ellipsoid(np.array((72, 12, -132)) + shift[0], (66, 74, 78)),
        ellipsoid(np.array((-74, 12, -142)) + shift[1], (64, 72, 78)),
    ]
    heart = ellipsoid(
        np.array((-26, 30, -62)) + shift[1],
        (60, 44, 52),
        Rotation.from_euler("z", 25, degrees=True).as_matrix(),
    )
    mediastinum = ellipsoid((0, 30, 0), (30, 84, 170))
    spine = capsule((0, -84, -300), (0, -84, 300), 30)
    sides = []
    for side, sign, centre, radii, tilt in (
        (0, 1, (72, -6, -6), (64, 88, 136), 0.75),
        (1, -1, (-74, -8, -8), (60, 86, 132), 0.9),
    ):
        body = intersection(
            ellipsoid(np.array(centre) + shift[side], np.array(radii) * size[side]), wall, radius=10
        )
        hilum = np.array((sign * 42.0, -8, 0)) + shift[side]
        # the oblique fissure separates the lobes everywhere but around the hilum
        root = ellipsoid(hilum + np.array((sign * 6, 0, 0)), (52, 40, 36))
        fissure = subtraction(_fissure(hilum + np.array((0, 10, -12)), tilt), root, radius=1)
        body = subtraction(body, mediastinum, spine, heart, domes[side], radius=9)
        body = subtraction(body, ellipsoid(hilum - np.array((sign * 22, 0, 0)), (24, 20, 28)), radius=8)
        sides.append(subtraction(body, fissure, radius=2))
    organ = warped(union(*sides), rng, 1.5, 100)
    within = []
    for sign in (1, -1):
        tips = np.column_stack(
            [sign * rng.uniform(55, 115, 12), rng.uniform(-65, 55, 12), rng.uniform(-70, 95, 12)]
        )
        within.append((_tree(rng, np.array((sign * 30.0, -8, 0)), tips, 7), 20.0))
    around = _trunk(138, 94) + _lung_neighbours(mediastinum, heart, domes)
    return Anatomy(organ, np.array((-150, -110, -160)), np.array((150, 110, 145)), 2.0, _LUNG, around, within)


def _fissure(middle: AnyArray, tilt: float) -> ImplicitFunction:
    """Wavy sheet 3.8 mm thick through ``middle`` (3,) mm, rising against the second axis by ``tilt``."""
    normal = np.array((0.0, tilt, 1.0)) / np.hypot(tilt, 1)

    def distance(points: AnyArray) -> AnyArray:
        x, y, z = points
        height = (y - middle[1]) * normal[1] + (z - middle[2]) * normal[2]
        return np.abs(height + 2.5 * np.sin(x / 18)) - 1.9

    return distance


def _lung_neighbours(
    mediastinum: ImplicitFunction, heart: ImplicitFunction, domes: list[ImplicitFunction]
) -> list[Tissue]:
    """Chest wall, heart and great vessels, airways, and what lies under the domes of the diaphragm."""
    return [
        (ellipsoid((0, 5, 0), (130, 88, 900)), 45.0),  # chest wall
        (mediastinum, 40.0),
        (ellipsoid((0, 62, 40), (16, 16, 70)), _FAT),
        (heart, 130.0),
        (domes[0], _LIVER),
        (domes[1], 70.0),
        (capsule((0, -52, -110), (0, -38, 150), 7), 30.0),  # oesophagus
        (capsule((-22, -52, -300), (-20, -52, 40), 12), 200.0),  # aorta
        (torus((-5, -20, 40), 30, 12, 0), 200.0),  # arch
        (capsule((14, 15, 0), (16, 12, 140), 10), 180.0),  # superior vena cava
        (capsule((0, -22, 15), (0, -20, 300), 9), _AIR),  # trachea and main bronchi
        (capsule((0, -22, 15), (36, -14, -6), 7), _AIR),
        (capsule((0, -22, 15), (-38, -16, -8), 6), _AIR),
        (capsule((0, -86, -900), (0, -86, 900), 20), 220.0),
        (ellipsoid((0, -108, 0), (9, 8, 900)), 20.0),
    ]


def _kidney(rng: np.random.Generator) -> Anatomy:
    rotation = Rotation.from_rotvec(np.deg2rad(rng.normal((0, 12, 20), 3))).as_matrix()
    radii = np.array((27, 24, 54)) * rng.normal(1, 0.04, 3)
    organ = subtraction(ellipsoid((0, 0, 0), radii, rotation), ellipsoid((-26, 4, 0), (22, 13, 20)), radius=6)
    organ = warped(organ, rng, 0.8, 60)
    around = [(ellipsoid((0, 0, 0), (70, 70, 90)), _FAT), (ellipsoid((-45, -30, 0), (28, 24, 300)), _MUSCLE)]
    return Anatomy(organ, np.full(3, -75.0), np.full(3, 75.0), 1.0, 165.0, around, [])


def _bronchi(rng: np.random.Generator) -> Anatomy:
    branches = _airways(rng, np.array((0.0, -5, 75)), np.array((0.05, 0, -1)), np.array((1.0, 0.15, 0)), 0)
    organ = warped(union(*(capsule(*branch) for branch in branches), radius=2), rng, 1.0, 60)

    def wall(points: AnyArray) -> AnyArray:
        return organ(points) - points.dtype.type(1.5)

    ends = np.array([end for start, end, _ in branches for end in (start, end)])
    lungs = [ellipsoid((side * 74, -6, -6), (64, 88, 136)) for side in (1, -1)]
    around: list[Tissue] = [(ellipsoid((0, 5, 0), (138, 94, 900)), _MUSCLE)]
    around += [(lung, _LUNG) for lung in lungs] + [(ellipsoid((0, 0, 60), (26, 40, 70)), 40.0), (wall, 30.0)]
    return Anatomy(organ, ends.min(axis=0) - 15, ends.max(axis=0) + 15, 0.5, _AIR, around, [])


def _airways(
    rng: np.random.Generator, start: AnyArray, way: AnyArray, side: AnyArray, generation: int
) -> list[tuple[AnyArray, AnyArray, float]]:
    """Branches (start, end, radius) in mm of an airway that forks in two, each time across the last fork."""
    # Radii and lengths of the generations are about those of Weibel's model of the lung.
    way, side = way / np.linalg.norm(way), side / np.linalg.norm(side)
    length, radius = _AIRWAYS_MM[generation]
    end = start + length * rng.uniform(0.9, 1.1) * way
    branches = [(start, end, radius * rng.uniform(0.95, 1.05))]
    if generation + 1 < len(_AIRWAYS_MM):
        across = np.cross(way, side)
        for sign in (1, -1):
            lean = np.deg2rad(rng.normal(36, 4))
            onwards = np.cos(lean) * way + sign * np.sin(lean) * side
            branches += _airways(rng, end, onwards, across + rng.normal(0, 0.1, 3), generation + 1)
    return branches


def _simple(
    shape: Callable[[np.random.Generator], ImplicitFunction],
) -> Callable[[np.random.Generator], Anatomy]:
    """Anatomy of a small solid around the origin, in fat."""

    def anatomy(rng: np.random.Generator) -> Anatomy:
        fat = ellipsoid((0, 0, 0), (90, 90, 90))
        return Anatomy(shape(rng), np.full(3, -60.0), np.full(3, 60.0), 1.0, 60.0, [(fat, _FAT)], [])

    return anatomy


def _sphere(rng: np.random.Generator) -> ImplicitFunction:
    return ellipsoid(rng.uniform(-1, 1, 3), np.full(3, rng.uniform(18, 22)))


def _torus(rng: np.random.Generator) -> ImplicitFunction:
    """Torus around the first axis: along the slices one contour becomes two and one again."""
    return torus(rng.uniform(-1, 1, 3), rng.uniform(27, 30), rng.uniform(11, 13), axis=0)


def _two_spheres(rng: np.random.Generator) -> ImplicitFunction:
    shift = rng.uniform(-1, 1, (2, 3))
    return union(
        ellipsoid(shift[0] + (26, 0, 0), (18, 18, 18)), ellipsoid(shift[1] - (26, 0, 5), (14, 14, 14))
    )


def _shell(rng: np.random.Generator) -> ImplicitFunction:
    centre = rng.uniform(-1, 1, 3)
    return subtraction(ellipsoid(centre, (26, 26, 26)), ellipsoid(centre, (13, 13, 13)))


#: The letters of section 9 of the paper, upright: ends (x, z) of their strokes in mm.
_LETTERS = {
    "A": [((-34, -40), (0, 44)), ((34, -40), (0, 44)), ((-22, -12), (22, -12))],
    "H": [((-26, -42), (-26, 42)), ((26, -42), (26, 42)), ((-26, 0), (26, 0))],
    "X": [((-30, -40), (30, 40)), ((-30, 40), (30, -40))],
}


def _letter(name: str) -> Callable[[np.random.Generator], ImplicitFunction]:
    """Solid letter that stands on the slices: its strokes branch and merge along them, and A has a hole."""

    def shape(rng: np.random.Generator) -> ImplicitFunction:
        ends = np.array(_LETTERS[name], float)[..., [0, 0, 1]] * (1, 0, 1)
        depth = rng.uniform(-1.5, 1.5, 2)  # leans back, as nothing scanned stands along an axis
        ends[..., 1] = depth[0] + depth[1] * ends[..., 2] / 20
        radius = rng.uniform(7.5, 8.5)
        return union(*(capsule(start, end, radius) for start, end in ends), radius=4)

    return shape


#: Organs whose neighbours differ in a scan without contrast agent.
_WITHOUT_CONTRAST = {"liver": _plain_liver}

#: What ``organ`` may be when ``source`` is ``phantom``.
ORGANS: dict[str, Callable[[np.random.Generator], Anatomy]] = {
    "liver": _liver,
    "lungs": _lungs,
    "kidney": _kidney,
    "bronchi": _bronchi,
    "sphere": _simple(_sphere),
    "torus": _simple(_torus),
    "two_spheres": _simple(_two_spheres),
    "shell": _simple(_shell),
    **{name: _simple(_letter(name)) for name in _LETTERS},
}


def _generator(seed: int, case: str, organ: str) -> np.random.Generator:
    """Random numbers of a case and organ, the same on every machine."""
    words = np.frombuffer(hashlib.sha256(f"{case}/{organ}".encode()).digest(), "<u4")
    return np.random.default_rng([seed, *words.tolist()])


def _scan(anatomy: Anatomy, frame: Frame, first: AnyArray, shape: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Noise-free HU and mask of the crop that starts at ``first``, on the frame's grid."""
    step = np.diag(frame.affine)[:3]
    origin = frame.affine[:3, 3] + step * first
    fine_step = np.array([step[0], step[1], step[2] / _SUBSLICES])
    fine_origin = origin - np.array([0, 0, step[2] * (_SUBSLICES - 1) / (2 * _SUBSLICES)])
    fine_shape = shape * np.array([1, 1, _SUBSLICES])
    values = sample_lattice(anatomy.organ, fine_origin, fine_step, fine_shape)
    mask = values[:, :, _SUBSLICES // 2 :: _SUBSLICES] < 0
    share = np.clip(0.5 - values / abs(step[0]), 0, 1)
    share = share.reshape(*shape, _SUBSLICES).mean(-1, dtype=np.float32)
    # what surrounds the organ carries no ground truth: every other pixel is enough
    half = np.array([2, 2, 1])
    rough_shape = -(-shape // half)
    around, within = (
        interpolate_lattice(
            paint_tissues(np.full(rough_shape, hu, np.float32), tissues, origin, step * half), half, shape
        )
        for hu, tissues in ((_AIR, anatomy.around), (anatomy.hu, anatomy.within))
    )
    return around + share * (within - around), mask


def _noise(rng: np.random.Generator, shape: AnyArray, hu: float) -> AnyArray:
    """CT noise of standard deviation ``hu``: grainy in the slice, independent between slices."""
    grain = ndimage.gaussian_filter(rng.standard_normal(tuple(shape), dtype=np.float32), (0.7, 0.7, 0))
    return grain * np.float32(hu / max(grain.std(), 1e-6))


def make_phantom(
    case: str,
    organ: str,
    spacing_mm: tuple[float, float, float],
    *,
    seed: int,
    margin_voxels: int | AnyArray,
    location: str,
    blur_mm: float = BLUR_MM,
    noise_hu: float = NOISE_HU,
    contrast: bool = True,
) -> Structure:
    """Make a phantom's scan, its mask and its true surface.

    Parameters
    ----------
    case, organ : str
        ``organ`` names one of `ORGANS`; every ``case`` is another individual.
    spacing_mm : three floats
        Voxel size, the last between slices.
    seed : int
        With ``case`` and ``organ`` it determines everything random.
    margin_voxels : int, or three
        Voxels left around the organ, along each axis.
    location : str
        What an error names, e.g. ``"cohort.tsv row 3"``.
    blur_mm, noise_hu : float
        Standard deviations of the scanner's in-plane point spread, and of the noise.
    contrast : bool
        Whether contrast agent was given; without it a liver is as grey as muscle, which touches it.

    Returns
    -------
    Structure
        With image (HU), mask and truth (mm, RAS). Indices run to the left, the back and the head.

    Raises
    ------
    InputError
        No such organ.
    """
    if organ not in ORGANS:
        raise InputError(location, f"there is no phantom of organ {organ!r}", nearest(organ, ORGANS))
    rng = _generator(seed, case, organ)
    anatomy = (ORGANS if contrast else ORGANS | _WITHOUT_CONTRAST)[organ](rng)
    spacing = np.asarray(spacing_mm)
    step = spacing * (-1, -1, 1)
    margin = np.broadcast_to(margin_voxels, 3)
    slices = int(np.ceil((anatomy.bbox_max[2] - anatomy.bbox_min[2]) / spacing[2]) + 2 * margin[2])
    shape = np.array([_MATRIX, _MATRIX, slices])
    middle = np.array([0.0, 0.0, (anatomy.bbox_min[2] + anatomy.bbox_max[2]) / 2])
    affine = np.diag([*step, 1.0])
    # a random part of a voxel, so that nothing is aligned with the grid
    affine[:3, 3] = middle - step * ((shape - 1) / 2 + rng.uniform(-0.5, 0.5, 3))
    frame = Frame(affine, 2, (_MATRIX, _MATRIX, slices))

    truth = mesh_zero_set(anatomy.organ, anatomy.bbox_min, anatomy.bbox_max, anatomy.mesh_step)
    index = (truth.vertices - affine[:3, 3]) / step
    first = np.floor(index.min(axis=0)).astype(int) - margin
    last = np.ceil(index.max(axis=0)).astype(int) + margin
    image, mask = _scan(anatomy, frame, first, last + 1 - first)
    image = ndimage.gaussian_filter(image, [*(blur_mm / spacing[:2]), 0], mode="nearest")
    image += _noise(rng, last + 1 - first, noise_hu)
    return Structure(
        case=case,
        organ=organ,
        frame=frame,
        origin=first.astype(np.int64),
        image=np.round(image).astype(np.float32),
        mask=mask,
        truth=truth,
        provenance={
            "source": "phantom",
            "seed": int(seed),
            "spacing_mm": list(spacing_mm),
            "blur_mm": blur_mm,
            "noise_hu": noise_hu,
        },
    )
