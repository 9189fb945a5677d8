"""The whole configuration."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ValidationError, create_model

from cccd.plugins import find, table
from cccd.settings import Section, setting
from cccd.settings.curves import CurveSettings
from cccd.settings.imports import ImportSettings
from cccd.settings.junctions import BoundarySettings, JunctionSettings
from cccd.settings.surface import LoftSettings


class Settings(Section):
    """All settings, section by section; what is not given has its default.

    The sections are ``import_`` (``import`` in YAML), ``boundaries``, ``gnn``, ``curves``,
    ``surface`` and ``report``. docs/configuration.md has every key with its unit, range and reason.

    Examples
    --------
    >>> Settings(surface={"smallest_part_voxels": 20}).surface.smallest_part_voxels
    20.0
    """

    if not TYPE_CHECKING:  # whose checkers see the fields

        def __init__(self, **sections: Any) -> None:
            """Check the sections.

            Raises
            ------
            InputError
                Names the key, what is wrong with it, and a hint.
            """
            try:
                super().__init__(**sections)
            except ValidationError as error:
                from cccd.settings.validation import explain  # which imports this module

                raise explain(error, sections) from None

    cohort: str = setting(
        "config/cohort.tsv",
        "one row per structure",
        why="Relative to where the command was typed, or to the project's root; or absolute.",
    )
    seed: int = setting(
        152,
        "everything random is drawn from it",
        why="Equal seeds give equal bytes.",
        unit="1",
        ge=0,
        le=2**32 - 1,
    )
    train: Literal["auto"] | bool = setting(
        "auto",
        "true: train the junction network; false: take a ready one; auto: train for the default cohort",
        why="Other cohorts take the shipped model, or the one that gnn.pretrained names.",
    )
    compare: Literal["auto"] | bool = setting(
        "auto",
        "true: compare with other methods and the paper; false: do not; auto: compare the default cohort",
        why="Comparisons take several times as long as the surfaces. With auto those for a closer look, and "
        "the longest of all but each case's first structure, are left to the target evidence.",
    )
    device: Literal["auto", "cpu", "cuda"] = setting(
        "auto",
        "where networks are trained and used",
        why="auto: on a GPU if torch finds one. A change repeats no finished job.",
    )
    segmenter: str | None = setting(
        None,
        "what makes masks: a network (nnunet, ...), a file of weights, totalsegmentator; null: nothing",
        why="Without one a threshold finds the organ (import.region). A network (nnunet, polar_unet, "
        "kiunet_3d, h_denseunet, unet_3plus) is trained on the sheet's rows of role train; nnunetv2:FOLDER "
        "calls nnU-Net's own command with a model that it trained.",
    )
    import_: ImportSettings = setting(
        ImportSettings(),
        "from a row of the sheet to one cropped structure",
        why="Scans come in many ways.",
        alias="import",
    )
    boundaries: BoundarySettings = setting(
        BoundarySettings(), "from slices to boundary pixels", why="Section 4.3, Algorithm 1."
    )
    gnn: JunctionSettings = setting(
        JunctionSettings(), "the network that orders boundary pixels", why="Equation 11."
    )
    curves: CurveSettings = setting(
        CurveSettings(), "ordered curves, their corners and splines", why="Definitions 3 and 4."
    )
    surface: LoftSettings = setting(
        LoftSettings(), "from curves to a closed surface", why="What all the rest is for."
    )


@functools.cache
def whole_settings() -> type[Settings]:
    """Join the sections that other packages add (`cccd.plugins`) to the configuration's model."""
    sections = {name: find(path) for name, path in table("SETTINGS").items()}
    return create_model("Settings", __base__=Settings, **sections)
