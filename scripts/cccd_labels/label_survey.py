"""All labels of an input at once: names, volumes, and where each lies; what ``cccd check`` says and draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cccd.api import read
from cccd.containers import Structure
from cccd.errors import InputError
from cccd.file_headers import object_in
from cccd.geometry.arrays import AnyArray, FloatArray
from cccd.inputs import read_request
from cccd.inputs.annotation import AUTO
from cccd.inputs.file_requests import refuse_image, request_for
from cccd.inputs.grid import Volume, interpolate_on_grid, on_grid
from cccd.inputs.load import existing
from cccd.inputs.row_files import reading_once
from cccd.settings.root import Settings
from cccd_labels.label_maps import MapLabel, colour_of, list_map, read_parts
from cccd_viewers.regions import DrawnLabels


class SurveyedLabel(NamedTuple):
    """One label of an input."""

    label: str  # its value, or the name of a mask's file
    name: str  # empty where nothing says
    volume_ml: float | None  # of its voxels; None where it cannot be read
    note: str  # why no surface can be made of it; empty where one can
    colour: str  # in the picture, "#rrggbb"

    def __str__(self) -> str:
        return f"{self.caption} ({self.note})" if self.note else self.caption

    @property
    def caption(self) -> str:
        """Value, name and volume."""
        named = self.label if self.name in ("", self.label) else f"{self.label} {self.name}"
        if self.volume_ml is None:
            return named
        return f"{named}, {self.volume_ml:{'.0f' if self.volume_ml >= 100 else '.3g'}} ml"


def measure_labels(path: Path, table: Path | None = None) -> list[tuple[SurveyedLabel, Volume | None]]:
    """Measure every label of an input.

    Parameters
    ----------
    path : path
        A label map, a DICOM SEG or RTSTRUCT, or a folder with one of them or with a mask per organ.
    table : path, optional
        Names of the labels, see `cccd_labels.label_maps.read_label_table`.

    Returns
    -------
    list of (SurveyedLabel, Volume or None)
        Boolean volumes, each no larger than its label.

    Raises
    ------
    InputError
        Not readable, or no labels.
    """
    path = path.absolute()  # whose name is in messages, "." has none
    refuse_image(path)
    held = object_in(existing(path, "mask"))
    found = read_parts(held, table)
    listed = _read_one_by_one(held, table) if found is None else found
    return [(_surveyed(label, part, number), part) for number, (label, part) in enumerate(listed, 1)]


def _read_one_by_one(path: Path, table: Path | None) -> Iterator[tuple[MapLabel, Volume | None]]:
    """Read what DICOM objects and nnU-Net's probabilities hold; what cannot be read says why."""
    files, settings = reading_once(), Settings()
    for label in list_map(path, table):
        try:
            organ = read_request(request_for(path, label.label), settings.import_, settings.seed, files)
        except InputError as error:
            yield replace(label, left_out=error.problem), None
        else:
            yield label, Volume(organ.voxels, organ.affine, label.name)


def _surveyed(label: MapLabel, part: Volume | None, number: int) -> SurveyedLabel:
    volume = None
    if part is not None:
        volume = float(np.count_nonzero(part.data) * abs(np.linalg.det(part.affine[:3, :3])) / 1000)
    small = part is not None and label.left_out
    note = f"{label.left_out}: too small for a surface" if small else label.left_out
    return SurveyedLabel(label.label, label.name, volume, note, label.colour or colour_of(number))


def survey_labels(
    path: Path, image: Path | None = None, annotated: str = AUTO, table: Path | None = None
) -> tuple[Structure, list[SurveyedLabel], DrawnLabels | None]:
    """Read all labels of an input at once.

    Parameters
    ----------
    path, image, annotated
        As of `cccd.read`.
    table
        As of `measure_labels`.

    Returns
    -------
    structure : Structure
        All labels as one organ.
    labels : list of SurveyedLabel
    drawn : DrawnLabels or None
        The labels on the structure's arrays, smaller ones over larger; None where there is but one.

    Raises
    ------
    InputError
        Not readable, no labels, or none that could be drawn.
    """
    measured = measure_labels(path, table)
    labels = [label for label, _ in measured]
    if len(labels) == 1:
        return read(path, image=image, annotated=annotated), labels, None
    there = [(label, part, rank) for rank, (label, part) in enumerate(measured, 1) if part is not None]
    every = ",".join(label.label for label, _, _ in there)
    structure = read(path, every, image=image, annotated=annotated)
    structure = replace(structure, organ=structure.case)
    ranks = np.zeros(structure.voxels.shape, np.int32)
    for _, part, rank in sorted(there, key=lambda found: -(found[0].volume_ml or 0)):
        _paint(ranks, structure.affine, part, rank)
    drawn = DrawnLabels(ranks, [label.colour for label in labels], [label.caption for label in labels])
    return structure, labels, drawn


def _paint(ranks: AnyArray, affine: FloatArray, part: Volume, rank: int) -> None:
    """Write a label's rank into the voxels (a, b, c) of a grid that lie in it."""
    corners = np.indices((2, 2, 2)).reshape(3, -1) * (np.array(part.shape)[:, None] - 1)
    world = part.affine[:3, :3] @ corners + part.affine[:3, 3:]
    index = np.linalg.solve(affine[:3, :3], world - affine[:3, 3:])
    low = np.maximum(np.floor(index.min(axis=1) + 0.5).astype(int), 0)
    high = np.minimum(np.ceil(index.max(axis=1) - 0.5).astype(int) + 1, ranks.shape)
    if (high <= low).any():
        return
    near = affine.copy()
    near[:3, 3] += affine[:3, :3] @ low
    shape = tuple((high - low).tolist())
    moved = on_grid(part, near, shape, fill=False) or interpolate_on_grid(part, near, shape, order=0)
    ranks[tuple(slice(a, b) for a, b in zip(low, high, strict=True))][moved.data] = rank
