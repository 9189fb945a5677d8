"""Settings of the import: from a row of the cohort sheet to one cropped structure."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cccd.settings import Section, setting

_Spacing = Annotated[float, Field(ge=0.1, le=20)]


class RegionSettings(Section):
    """How the organ is found in an image that comes without a mask."""

    window: Literal["otsu"] | tuple[float | None, float | None] = setting(
        "otsu",
        "grey values [low, high], null for no bound; otsu: above Otsu's threshold",
        why="Otsu's threshold needs no knowledge of the scanner; where the grey values have a meaning "
        "(HU), a window is better.",
        unit="grey value",
    )
    components: int = setting(
        1,
        "the largest pieces that are taken, at most ...",
        why="Most organs are one piece; lungs and kidneys are two.",
        unit="count",
        ge=1,
        le=1000,
    )
    smallest_share: float = setting(
        0.1,
        "... and none smaller than this share of the largest",
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


class ImportSettings(Section):
    """How a structure is read and cropped (section ``import``)."""

    slice_axis: Literal["auto", 0, 1, 2] = setting(
        "auto",
        "0, 1, 2, or auto: the thickest spacing, then the one nearest to head-foot",
        why="Contours are drawn across the thickest spacing.",
    )
    resample: bool = setting(
        False,
        "interpolate the image where its grid is not the mask's; otherwise an error",
        why="Two grids are more often mixed-up files than intended.",
    )
    fill_gaps: bool = setting(
        True,
        "interpolate missing or uneven DICOM slices, with a warning; false: an error",
        why="Slices lie where their headers say. A missing one may be a broken download: read the warning.",
    )
    contour_pixel_mm: float = setting(
        1.0,
        "pixel size that drawn contours (RTSTRUCT) get where no image comes with them",
        why="Tolerances are in pixels; scans on which organs are drawn have pixels of about a millimetre.",
        unit="mm",
        gt=0,
        le=20,
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
