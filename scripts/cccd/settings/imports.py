"""Settings of the import: from a row of the cohort sheet to one cropped structure."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cccd.settings.section import Section, setting

__all__ = [
    "PHANTOM_DISTANCES_MM",
    "PHANTOM_ORGANS",
    "DamageSettings",
    "ImportSettings",
    "LimitSettings",
    "PhantomSettings",
    "RegionSettings",
    "ScanSettings",
]

#: Phantoms that ``snakemake phantoms`` writes, and the slice distances at which it scans each, in mm.
PHANTOM_ORGANS = (
    "A",
    "H",
    "X",
    "bronchi",
    "kidney",
    "liver",
    "lungs",
    "shell",
    "sphere",
    "torus",
    "two_spheres",
)
PHANTOM_DISTANCES_MM = (2, 5, 8)

_Block = Annotated[int, Field(ge=1, le=20)]
_Damage = Literal[
    "clean",
    "spurs",
    "bridges",
    "pinch",
    "blocks",
    "gaps",
    "noise",
    "double",
    "thick",
    "mixed",
    "everything",
]
_Spacing = Annotated[float, Field(ge=0.1, le=20)]


class RegionSettings(Section):
    """How the organ is found in an image that comes without a mask."""

    window: Literal["otsu"] | tuple[float | None, float | None] = setting(
        "otsu",
        "grey values [low, high], either of them null for no bound; otsu: above its threshold",
        why="Otsu's threshold needs no knowledge of the scanner; where the grey values have a meaning "
        "(HU), a window is better.",
        unit="grey value",
    )
    components: int = setting(
        1,
        "at most so many of the largest pieces ...",
        why="Most organs are one piece; lungs and kidneys are two.",
        unit="count",
        ge=1,
        le=1000,
    )
    smallest_share: float = setting(
        0.1,
        "... of which none is smaller than this share of the largest",
        why="A tenth leaves both lungs and drops specks.",
        unit="share",
        ge=0,
        le=1,
    )
    drop_border: bool = setting(
        False,
        "leave out pieces that reach the sides of the slices (the air around a patient)",
        why="An organ that the field of view cuts would be lost.",
    )
    fill_holes: bool = setting(
        True, "fill cavities", why="Vessels and airways inside an organ fall outside its grey values."
    )


class PhantomSettings(Section):
    """How phantoms are scanned."""

    spacing_mm: tuple[_Spacing, _Spacing, _Spacing] = setting(
        (0.75, 0.75, 5.0),
        "voxel size, the last between slices",
        why="Of the order of a clinical abdominal CT's.",
        unit="mm",
    )
    blur_mm: float = setting(
        0.7,
        "standard deviation of the scanner's in-plane point spread",
        why="Of the order of a soft-tissue kernel's.",
        unit="mm",
        ge=0,
        le=10,
    )
    noise_hu: float = setting(
        12.0,
        "standard deviation of the noise",
        why="Of the order of a clinical abdominal CT's.",
        unit="HU",
        ge=0,
        le=500,
    )


class ScanSettings(Section):
    """How the brain of source ``mni152_scan`` is scanned."""

    every: tuple[_Block, _Block, _Block] = setting(
        (2, 2, 5),
        "voxels of the template that become one, along each axis",
        why="2 x 2 x 5 mm: a quick clinical scan, and seconds to order.",
        unit="voxels",
    )
    noise: float = setting(
        0.03,
        "standard deviation of the noise (Rician), as a share of the brightest tissue",
        why="BrainWeb's middle level, 3 %.",
        unit="share",
        ge=0,
        le=1,
    )
    bias: float = setting(
        0.4,
        "how far a coil's bias field spreads one tissue's grey values, as a share of their mean",
        why="BrainWeb's stronger field, 40 %: factors from 0.8 to 1.2.",
        unit="share",
        ge=0,
        lt=2,
    )


class DamageSettings(Section):
    """How the boundary maps of source ``damaged_phantom`` are damaged."""

    severity: float = setting(
        1.0,
        "1: as in the comparison of the decoders (table of junctions)",
        why="The decoders' own test.",
        unit="1",
        gt=0,
        le=3,
    )
    kinds: Annotated[tuple[_Damage, ...], Field(min_length=1)] = setting(
        ("spurs", "bridges", "pinch", "blocks", "gaps", "noise", "double", "thick", "mixed"),
        "kinds of damage, of which each slice has one, drawn by chance",
        why="All that the comparison of the decoders has, but for undamaged maps.",
    )


class LimitSettings(Section):
    """What a file may ask for; one that asks for more is refused in one line, before its voxels are read."""

    most_slices: int = setting(
        20_000,
        "slices of a volume, or images of a series",
        why="Several times a whole body at half a millimetre.",
        unit="count",
        expert=True,
        ge=1,
    )
    most_pixels: int = setting(
        100_000_000,
        "pixels of one slice",
        why="10,000 squared: micrographs have fewer.",
        unit="px",
        expert=True,
        ge=1,
    )
    most_voxels: int = setting(
        4_000_000_000,
        "voxels of a volume",
        why="A packed file of some megabytes can promise a thousand times its size; these are 8 GB.",
        unit="voxels",
        expert=True,
        ge=1,
    )
    most_mm: int = setting(
        10_000,
        "length of an organ",
        why="Longer than any; a header in micrometres asks for a mesh that fills every memory.",
        unit="mm",
        expert=True,
        ge=1,
    )
    most_contours: int = setting(
        100_000,
        "drawn contours of one region (RTSTRUCT)",
        why="Dozens on every slice of a whole body.",
        unit="count",
        expert=True,
        ge=1,
    )
    most_contour_points: int = setting(
        20_000_000,
        "points of all these contours together",
        why="Drawn contours have some hundred points each; these are half a gigabyte.",
        unit="count",
        expert=True,
        ge=1,
    )


class ImportSettings(Section):
    """How a structure is read and cropped (section ``import``)."""

    slice_axis: Literal["auto", 0, 1, 2] = setting(
        "auto",
        "0, 1, 2, or auto: the thickest spacing, then the one nearest to head-foot",
        why="Contours are drawn across the thickest spacing.",
    )
    margin_voxels: int = setting(
        3,
        "background left around the organ",
        why="Blurs and dilations near the organ stay inside the crop.",
        unit="voxels",
        ge=1,
        le=100,
    )
    resample: bool = setting(
        False,
        "interpolate the image where its grid is not the mask's; otherwise an error",
        why="Two grids are more often a mix-up of files than meant.",
    )
    fill_gaps: bool = setting(
        False,
        "interpolate missing or uneven DICOM slices; otherwise an error",
        why="A missing slice is more often a broken download than meant.",
    )
    contour_pixel_mm: float = setting(
        1.0,
        "pixel size that drawn contours (RTSTRUCT) get where no image comes with them",
        why="Tolerances are in pixels; scans on which organs are drawn have pixels of about a millimetre.",
        unit="mm",
        expert=True,
        gt=0,
        le=20,
    )
    limits: LimitSettings = setting(
        LimitSettings(),
        "what a file may ask for",
        why="A damaged or hostile header must not fill the memory.",
        expert=True,
    )
    region: RegionSettings = setting(
        RegionSettings(),
        "the organ in an image that comes without a mask",
        why="Read only for such rows of the sheet.",
    )
    phantom: PhantomSettings = setting(
        PhantomSettings(),
        "how phantoms are scanned",
        why="Read only for rows of source phantom and damaged_phantom.",
    )
    scan: ScanSettings = setting(
        ScanSettings(), "how source mni152_scan is scanned", why="Read only for rows of this source."
    )
    damage: DamageSettings = setting(
        DamageSettings(),
        "how the maps of source damaged_phantom are damaged",
        why="Read only for rows of this source.",
    )
