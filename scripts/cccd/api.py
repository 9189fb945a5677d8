"""What `cccd` offers to others: a file or arrays in, a surface out. The names are listed in ``cccd.__all__``.

The command line and these functions are one: what ``cccd surface`` writes is what `reconstruct` returns, and
both are what the workflow's jobs make, to the last bit.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingTypeStubs]

from cccd.console import millilitres
from cccd.containers import Curves, FittedCurves, Frame, Sections, Structure
from cccd.contours import take_contours, trace_contours
from cccd.errors import EarlyWarning, InputError, MergedLabels
from cccd.extras import needing
from cccd.file_headers import object_in
from cccd.files import ExportOptions, format_of, write_surface
from cccd.geometry.arrays import concatenate_ragged
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.subdivision import ControlMesh
from cccd.inputs import read_request, structure_of_array
from cccd.inputs.annotation import AUTO
from cccd.inputs.file_requests import Label, Threshold, check_rule, holds_series, refuse_image, request_for
from cccd.inputs.grid import Volume
from cccd.inputs.load import existing, scan_of
from cccd.inputs.row_files import list_labels
from cccd.plugins import find, row, table
from cccd.settings.root import Settings
from cccd.surface.loft import loft_surface
from cccd.surface.surface import LoftedSurface

if TYPE_CHECKING:
    import pyvista
    import SimpleITK as sitk  # noqa: N813
    import trimesh
    from nibabel.filebasedimages import FileBasedImage

__all__ = [
    "ControlMesh",
    "Curves",
    "FittedCurves",
    "InputError",
    "Settings",
    "Structure",
    "Surface",
    "fit_contours",
    "labels",
    "read",
    "reconstruct",
]

_DEFAULTS = Settings()

F = TypeVar("F", bound=Callable[..., object])


def one_thread(function: F) -> F:
    """Run in one thread, as a job of the workflow does: sums round by how many threads share them."""
    return cast(Any, threadpool_limits).wrap(limits=1)(function)


@dataclass(frozen=True, repr=False)
class Surface:
    """A smooth closed surface, in world millimetres (RAS).

    Attributes
    ----------
    lofted : cccd.surface.LoftedSurface
        The surface in the form that the library's other functions use.
    name : str
        Name of the organ.
    series : Path or None
        Folder of the DICOM series that it came from; RTSTRUCT refers to it.
    warnings : tuple of str
        One line for each problem, for example ends that the scan cuts, or dropped fragments.
    drawn : Structure or None
        The input, if only some of its slices were annotated: a label map keeps those unchanged.
    given : cccd.surface.LoftedSurface or None
        The mesh that it was made of, on a scan's grid: label maps and DICOM contours are made of that.
    scan : cccd.inputs.grid.Volume or None
        The scan around the organ; tetrahedra get its grey values.

    See Also
    --------
    cccd.reconstruct, cccd.reconstruct_labels
    """

    lofted: LoftedSurface
    name: str = "surface"
    series: Path | None = None
    warnings: tuple[str, ...] = field(default=())
    drawn: Structure | None = None
    given: LoftedSurface | None = None
    scan: Volume | None = None
    _filled: dict[str, tuple[Any, dict[str, Any]]] = field(
        default_factory=dict[str, tuple[Any, dict[str, Any]]], init=False, compare=False
    )

    @property
    def tetrahedra(self) -> list[dict[str, Any]]:
        """What the tetrahedra are worth that `write` made: their number, angles, materials; plain JSON."""
        return [report for _, report in self._filled.values()]

    def __repr__(self) -> str:
        size = " x ".join(f"{length:.1f}" for length in self.size)
        said = f"{millilitres(self.volume / 1000)}, {size} mm, {len(self.faces)} triangles"
        count = len(self.warnings)
        return f"<Surface {self.name!r}: {said}" + f", {count} warning{'s'[: count > 1]}" * bool(count) + ">"

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The closed triangle mesh."""
        return self.lofted.mesh.to_trimesh()

    @property
    def bodies(self) -> list[ControlMesh]:
        """The closed Catmull-Clark splines from which the mesh is made; those of cavities face inwards.

        The list is empty for an organ that shares its walls with others.

        Examples
        --------
        >>> import numpy as np
        >>> from cccd import reconstruct
        >>> at = np.indices((16, 16, 16)) - 7.5
        >>> (ball,) = reconstruct(np.linalg.norm(at, axis=0) <= 6).bodies
        >>> ball.sign, bool(abs(ball.tessellate(3).volume / (4 / 3 * np.pi * 6**3) - 1) < 0.05)
        (1, True)
        """
        return self.lofted.bodies

    @property
    def vertices(self) -> np.ndarray:
        """The mesh's vertices (V, 3)."""
        return self.lofted.vertices

    @property
    def faces(self) -> np.ndarray:
        """The mesh's triangles (F, 3), counter-clockwise seen from outside."""
        return self.lofted.faces

    @property
    def volume(self) -> float:
        """The volume within the mesh, mm^3."""
        return float(self.lofted.mesh.volume)

    @property
    def area(self) -> float:
        """The area of the mesh, mm^2."""
        return float(self.lofted.mesh.area)

    @property
    def pieces(self) -> int:
        """How many bodies apart from each other there are; cavities do not count.

        Examples
        --------
        >>> import numpy as np
        >>> from cccd import reconstruct
        >>> ball = np.linalg.norm(np.indices((16, 16, 16)) - 7.5, axis=0) <= 6
        >>> reconstruct(np.concatenate([ball, ball])).pieces
        2
        """
        return self.lofted.mesh.count_bodies()

    @property
    def volume_interval(self) -> tuple[float, float] | None:
        """Lowest and highest volume, mm^3, with the share of ``surface.band``; None without a band."""
        return self.lofted.volume_interval

    @property
    def sides(self) -> dict[str, Surface]:
        """The error band's ``inner`` and ``outer`` surface; nothing without a band."""
        sides = self.lofted.sides()
        return {
            side: replace(self, lofted=lofted, name=f"{self.name}_{side}") for side, lofted in sides.items()
        }

    @one_thread
    def samples(self, count: int = 50, *, seed: int = 0) -> list[Surface]:
        """Draw surfaces as the true one may lie: compute any number of each, and read off its interval.

        Parameters
        ----------
        count : int
            How many; 50 are enough for the ends of a 90 % interval.
        seed : int
            The same seed draws the same surfaces.

        Returns
        -------
        list of Surface
            Closed, with this surface's triangles; they have neither splines nor bands.

        Raises
        ------
        InputError
            The count is below 1, or the surface has no error band.

        Examples
        --------
        >>> import numpy as np
        >>> from cccd import reconstruct
        >>> at = np.indices((16, 16, 16)) - 7.5
        >>> ball = reconstruct(np.linalg.norm(at, axis=0) <= 6)
        >>> low, high = np.quantile([one.volume for one in ball.samples()], [0.05, 0.95])
        >>> bool(low < ball.volume < high)
        True
        """
        if self.lofted.band is None:
            raise InputError(self.name, "the surface has no error band", "make it from a mask or contours")
        meshes = find(table("OPTIONS")["draw_meshes"])(self.lofted.mesh, self.lofted.band, count, seed)
        return [
            replace(
                self, lofted=replace(self.lofted, bodies=[], mesh=mesh, band=None), name=f"{self.name}_{n}"
            )
            for n, mesh in enumerate(meshes, 1)
        ]

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Intervals of the spline's volume (ml), area (mm^2) and largest diameter (mm), if it has a band."""
        whole = self.lofted.whole or self.lofted
        if not (self.lofted.band and whole.band):
            return {}
        return find(table("OPTIONS")["intervals"])(whole.mesh, whole.band)

    @property
    def size(self) -> tuple[float, float, float]:
        """Lengths of the mesh's bounding box along x, y and z, mm."""
        x, y, z = (float(length) for length in np.ptp(self.vertices, axis=0))
        return x, y, z

    @one_thread
    def uniform(self, triangles: int | None = None, edge_mm: float | None = None) -> Surface:
        """Return the surface with triangles of about one size.

        Parameters
        ----------
        triangles : int, optional
            How many, to 2 %.
        edge_mm : float, optional
            Or how long their edges are on the average, in mm.

        Returns
        -------
        Surface
            Closed, with no triangle through another. ``lofted.report["uniform"]`` has the edges' lengths, and
            the largest distance of triangles to the spline, ``chord_error_mm``.

        Raises
        ------
        InputError
            Not one of the two is given, so few triangles cannot be, or the organ shares its walls.

        Examples
        --------
        >>> import numpy as np
        >>> from cccd import reconstruct
        >>> at = np.indices((16, 16, 16)) - 7.5
        >>> even = reconstruct(np.linalg.norm(at, axis=0) <= 6).uniform(triangles=500)
        >>> len(even.faces), even.mesh.is_watertight
        (500, True)
        """
        even = find(table("OPTIONS")["uniform"])(self.lofted, triangles, edge_mm)
        return replace(self, lofted=even)

    def to_pyvista(self) -> pyvista.PolyData:
        """Return the mesh for PyVista."""
        return self.lofted.mesh.to_polydata()

    def plot(self, **options: object) -> object:
        """Draw the surface in a window or a notebook; options are those of `pyvista.PolyData.plot`."""
        return cast(Any, self.to_pyvista()).plot(**options)

    @needing("surface.write")
    @one_thread
    def write(
        self,
        path: str | Path,
        *,
        contour_spacing_mm: float | None = None,
        keep_patient: bool = False,
        settings: Settings | None = None,
    ) -> Path:
        """Write the surface; the suffix chooses the format.

        Parameters
        ----------
        path : path
            Ends with ``.ply``, ``.stl``, ``.step``, ``.vtu`` or another suffix of those that ``cccd surface
            --help`` lists. If something fails, no file is left.
        contour_spacing_mm : float, optional
            Distance of the RTSTRUCT's planes. Default: the settings', or that of the scan's slices.
        keep_patient : bool
            Whether the RTSTRUCT names the patient, as the scan's DICOM files do; so do the settings.
        settings : Settings, optional
            Section ``surface``: solids use ``step_tolerance_mm``, tetrahedra ``tetrahedra``.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InputError
            The suffix is unknown, the extra of the format is not installed, or the folder is not writable.
        """
        surface = checked_settings(settings).surface
        asked = {
            "contour_spacing_mm": contour_spacing_mm or surface.contour_spacing_mm,
            "keep_patient": keep_patient or surface.keep_patient,
        }
        on_scan = format_of(path) in {"nii.gz", "dcm", "seg.dcm"}
        lofted = self.given if on_scan and self.given is not None else self.lofted
        surface = surface.model_copy(update=asked)
        options = ExportOptions(self.name, self.series, self.drawn, surface, self.scan, self._filled)
        write_surface(path, lofted, options)
        return Path(path)


@needing("cccd.labels", "dicom")
def labels(path: str | Path) -> dict[str, str]:
    """List the labels of a mask.

    Parameters
    ----------
    path : path
        A label map, a DICOM SEG or RTSTRUCT, or a folder with one of them or with a mask per organ.

    Returns
    -------
    dict of str to str
        Values for `read`'s ``label``, each with its name if the file has one.

    Raises
    ------
    InputError
        The file is missing, not readable, or an image.
    """
    path = Path(path).absolute()
    existing(path, path.name)
    refuse_image(path)
    return list_labels(object_in(path))


def read(
    path: str | Path,
    label: Label = "",
    *,
    image: str | Path | None = None,
    boundary: bool = False,
    annotated: str = AUTO,
    threshold: Threshold = False,
    seed: str = "",
    settings: Settings | None = None,
) -> Structure:
    """Read one organ from a file or folder.

    Parameters
    ----------
    path : path
        A mask or label map (NIfTI, NRRD, MHA), a DICOM SEG or RTSTRUCT, a folder with one of these, or a
        folder with a mask per organ (TotalSegmentator). With ``threshold`` or ``seed`` an image, or the
        folder of a DICOM series.
    label : str, int or several int
        Value(s) of a label map, or the name of an organ, segment or ROI. By default all labels, which become
        one organ; if there are several, with a Python warning.
    image : path, optional
        The scan, if it is in another file or folder.
    boundary : bool
        Whether the file contains boundary maps that need ordering.
    annotated : {"auto", "nonempty", "every slice"}
        Which slices of the mask are annotated: those that are not empty, or all. ``auto`` decides by the
        gaps: slices are filled if at least two empty ones lie between any two annotated ones.
    threshold : bool or (float or None, float or None)
        For an image without a mask: take the largest piece with grey values from ``low`` to ``high`` (None is
        no bound). True uses the range of ``import.region``, by default from Otsu's method. A threshold does
        not find organs: the structure is called ``threshold``.
    seed : str
        For an image without a mask: where the organ is, as in the cohort sheet. A voxel ``"120,88,40"`` or a
        box ``"110:130,80:96,38:42"`` within the organ, with indices from 0; separate several by semicolons.
        What is of the same tissue around it is a rough region. `reconstruct` looks for the image's edges
        near its border, and needs the extra ``gnn``. The structure is called ``seeded``.
    settings : Settings, optional
        Section ``import`` is used.

    Returns
    -------
    Structure
        The organ, cropped, with its grid in mm (RAS).

    Raises
    ------
    InputError
        The file is missing, not readable or empty, has no such label, or is an image without a mask. The
        message is one line with a hint.

    See Also
    --------
    labels : what a file contains.
    reconstruct : the surface of the result.
    """
    settings = checked_settings(settings)
    with needing("cccd.read"):
        request = request_for(
            path,
            label,
            image=image,
            boundary=boundary,
            annotated=annotated,
            threshold=threshold,
            seeds=(seed,) if seed else (),
        )
        return _warned(read_request(request, settings.import_, settings.seed), 2)


def checked_settings(settings: object) -> Settings:
    """Return settings as they were given, the default ones where there are none."""
    if isinstance(settings, Settings | None):
        return settings or _DEFAULTS
    raise InputError("settings", f"{type(settings).__name__} is no cccd.Settings", "give cccd.Settings(...)")


def _warned(structure: Structure, level: int) -> Structure:
    """Warn, before any work, that all labels of a map become one organ; ``level``: whose line is named."""
    for note in structure.warnings:
        if isinstance(note, EarlyWarning):
            warnings.warn(note, MergedLabels, stacklevel=level + 1)
    return structure


@needing("cccd.reconstruct")
@one_thread
def reconstruct(
    organ: Structure | Curves | np.ndarray | FileBasedImage | sitk.Image,
    affine: np.ndarray | None = None,
    *,
    spacing: Sequence[float] | None = None,
    annotated: str = AUTO,
    settings: Settings | None = None,
    progress: Callable[[str], None] | None = None,
) -> Surface:
    """Make a smooth closed surface.

    Parameters
    ----------
    organ : (a, b, c) array, nibabel or SimpleITK image, Structure or Curves
        A mask, probabilities between 0 and 1, or a result of `read` or `order`. An image brings its grid.
    affine : (4, 4) float, optional
        Grid of an array: ``world_mm = affine @ (a, b, c, 1)``, RAS. Default: voxels of one millimetre.
    spacing : three floats, optional
        Or the lengths of an array's voxels along its axes, mm.
    annotated : {"auto", "nonempty", "every slice"}
        Which slices of an array are annotated, see `read`.
    settings : Settings, optional
        Default: `Settings` without arguments.
    progress : callable, optional
        Called with the name of each step as it begins: ``contours``, ``splines``, ``surface``.

    Returns
    -------
    Surface
        A closed surface in mm (RAS).

    Raises
    ------
    InputError
        The mask is empty, has too few slices, or the affine is not usable.

    See Also
    --------
    reconstruct_labels : all labels of a map, with shared walls.

    Examples
    --------
    >>> import numpy as np, cccd
    >>> i, j, k = np.indices((24, 24, 12)) - np.array([12, 12, 6]).reshape(3, 1, 1, 1)
    >>> ball = np.hypot(np.hypot(i, j), 2 * k) <= 8
    >>> surface = cccd.reconstruct(ball, np.diag([1, 1, 2, 1]))
    >>> surface.mesh.is_watertight, bool(abs(surface.volume / (2 * ball.sum()) - 1) < 0.01)
    (True, True)
    """
    settings = checked_settings(settings)
    tell: Callable[[str], object] = progress or (lambda step: None)
    tell("contours")
    if isinstance(organ, Curves):
        lofted = _loft(Sections(organ), settings, tell)
        return Surface(lofted, warnings=tuple(lofted.report["warnings"]))
    if isinstance(organ, (str, Path)):
        raise InputError(str(organ), "a path, not an array", "cccd.read reads it: reconstruct(read(path))")
    if isinstance(organ, Structure):
        structure = organ
    else:
        from cccd.inputs.in_memory import array_of

        array, grid = array_of(organ, affine, spacing)
        structure = structure_of_array(array, grid, settings.import_, annotated=check_rule(annotated))
        _warned(structure, 4)  # two frames are the decorators'
    return reconstruct_structure(structure, settings, tell)


def reconstruct_structure(
    structure: Structure, settings: Settings, tell: Callable[[str], None] = lambda step: None
) -> Surface:
    """Make a surface as `reconstruct` does."""
    match structure.input:
        case "contours":
            curves = take_contours(structure)
        case "mask":
            curves = trace_contours(structure)
        case other:
            make = find(table("CURVES")[other])
            curves = make(structure, settings.boundaries, settings.gnn.inference)
    return surface_of(structure, _loft(structure.sections(curves), settings, tell))


def _loft(sections: Sections, settings: Settings, tell: Callable[[str], None]) -> LoftedSurface:
    """Loft what is known of slices; what is wrong with the curves comes before the surface's warnings."""
    tell("surface")
    surface = loft_surface(sections, settings.surface)
    if sections.mask is None:
        from cccd.curves.describe import crossed_warnings, self_crossed_warnings

        wrong = [*self_crossed_warnings(sections.curves), *crossed_warnings(sections.curves)]
        surface.report["warnings"] = [*wrong, *surface.report["warnings"]]
    return surface


def surface_of(structure: Structure, lofted: LoftedSurface) -> Surface:
    """Give a structure's surface what else is known of the structure."""
    notes = (*structure.warnings, *lofted.report.get("warnings", []))
    drawn = None if structure.annotation is None else structure
    return Surface(lofted, structure.organ, _series(structure), notes, drawn, scan=scan_of(structure))


def _series(structure: Structure) -> Path | None:
    """Folder of the DICOM series that a structure came from."""
    folders = (Path(name) for name in structure.provenance.get("files", ()))
    return next((folder for folder in folders if folder.is_dir() and holds_series(folder)), None)


def check_references(paths: Sequence[Path], structure: Structure) -> None:
    """Refuse, before any work, files that could not refer to the series that a structure came from."""
    for path in paths:
        if check := row("WRITERS", format_of(path)).check:
            find(check)(path, _series(structure))


@needing("cccd.fit_contours")
@one_thread
def fit_contours(
    contours: Curves | Sequence[np.ndarray],
    affine: np.ndarray | None = None,
    settings: Settings | None = None,
) -> FittedCurves:
    """Describe closed contours by few points: corners and closed cubic B-splines.

    Parameters
    ----------
    contours : Curves or sequence of (n, 2) float arrays
        A result of `order`, or the contours of one slice in pixels (i, j): outlines counter-clockwise,
        holes clockwise, the first point not repeated.
    affine : (4, 4) float, optional
        For a sequence: index to world mm. Default: pixels of one millimetre.
    settings : Settings, optional
        Section ``curves``: the tolerance, or a number of control points.

    Returns
    -------
    FittedCurves
        ``splines`` yields control points (n, 2) and knots of each contour.

    Examples
    --------
    >>> import numpy as np, cccd
    >>> angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    >>> circle = 30 + 20 * np.column_stack([np.cos(angle), np.sin(angle)])
    >>> fitted = cccd.fit_contours([circle])
    >>> len(fitted.splines.control_points) < 30
    True
    """
    from cccd.curves.describe import describe_curves

    if not isinstance(contours, Curves):
        contours = _one_slice(contours, np.eye(4) if affine is None else np.asarray(affine, float))
    return describe_curves(contours, checked_settings(settings).curves)


def _one_slice(contours: Sequence[np.ndarray], affine: np.ndarray) -> Curves:
    rings = [np.asarray(contour, float) for contour in contours]
    for number, ring in enumerate(rings):
        if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3 or not np.isfinite(ring).all():
            raise InputError(
                f"contour {number}",
                f"an array of shape {ring.shape}",
                "give three finite points (n, 2) or more",
            )
    if not rings:
        raise InputError("contours", "there is none", "give at least one array (n, 2)")
    points, offsets = concatenate_ragged(rings)
    hole = RaggedPolygons(points, offsets).signed_areas < 0
    shape = tuple(int(size) + 2 for size in np.ceil(points.max(axis=0)))
    frame = Frame(affine, 2, (shape[0], shape[1], 1))
    return Curves(points, offsets, np.zeros(len(rings), np.int32), hole, frame)
