"""All organs of a case in one file each: a scene for viewers, a segmentation for 3D Slicer, a list."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import SimpleITK as sitk  # noqa: N813

from cccd.containers import Frame
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.surface.formats import NOTE
from cccd.surface.formats.glb import TO_GLTF, gltf_material
from cccd.volumes.grid import LPS_TO_RAS

__all__ = ["SceneOrgan", "describe_scene", "name_organs", "write_scene", "write_segmentation"]

#: Hues of organs without a colour lie this share of the circle apart: no two of the first hundred are alike.
GOLDEN_SHARE = 0.61803398875

_CONTEXT = "Segmentation category and type - 3D Slicer General Anatomy list"


class SceneOrgan(NamedTuple):
    """One organ of a case."""

    organ: str  # its folder's name
    name: str  # what people call it
    label: int  # in the label map
    colour: str  # "#rrggbb"
    code: str  # of a terminology, as the table of labels has it; may be empty
    mesh: Mesh  # closed, mm RAS

    @property
    def rgb(self) -> tuple[float, float, float]:
        """Parts of the colour, sRGB, from 0 to 1."""
        red, green, blue = (int(self.colour[n : n + 2], 16) / 255 for n in (1, 3, 5))
        return red, green, blue


def name_organs(meshes: Mapping[str, Mesh], labels: Mapping[str, Mapping[str, str]]) -> list[SceneOrgan]:
    """Give organs the names, label values, colours and codes of their map, and those without one another.

    Parameters
    ----------
    meshes : mapping of str to Mesh
        By organ.
    labels : mapping
        What the map says of each organ: see `cccd.volumes.label_maps.MapLabel`; it may say nothing.
    """
    given = [labels.get(organ, {}).get("label", "") for organ in meshes]
    own = len(set(given)) == len(given) and all(label.isdecimal() for label in given)
    named: list[SceneOrgan] = []
    for number, (organ, mesh) in enumerate(meshes.items(), 1):
        told = labels.get(organ, {})
        colour = told.get("colour") or _colour(number)
        label = int(given[number - 1]) if own else number
        named.append(SceneOrgan(organ, told.get("name") or organ, label, colour, told.get("code", ""), mesh))
    return named


def _colour(number: int) -> str:
    """Colour of the organ of a number."""
    rgb = colorsys.hsv_to_rgb(GOLDEN_SHARE * number % 1, 0.5 + 0.15 * (number % 2), 0.85)
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def describe_scene(case: str, organs: Sequence[SceneOrgan]) -> dict[str, Any]:
    """Tell what a scene holds, as plain JSON: volumes in ml, sizes in mm."""
    return {
        "case": case,
        "space": "RAS",
        "unit": "mm",
        "organs": [
            {
                "organ": organ.organ,
                "name": organ.name,
                "label": organ.label,
                "color": organ.colour,
                "code": organ.code,
                "volume_ml": round(organ.mesh.volume / 1000, 4),
                "size_mm": [round(float(length), 2) for length in np.ptp(organ.mesh.vertices, axis=0)],
                "triangles": len(organ.mesh.faces),
            }
            for organ in organs
        ],
    }


def write_scene(path: Path, organs: Sequence[SceneOrgan]) -> None:
    """Write binary glTF: a node for each organ, with its name and colour."""
    import trimesh

    scene = cast(Any, trimesh.Scene())
    for organ in organs:
        mesh = cast(Any, organ.mesh.to_trimesh())
        mesh.visual = gltf_material(organ.name, organ.rgb)
        scene.add_geometry(mesh, node_name=organ.organ, geom_name=organ.organ, transform=TO_GLTF)
    scene.metadata["note"] = f"{NOTE}; the nodes' matrices turn mm RAS into metres, y up"
    path.write_bytes(scene.export(file_type="glb"))


def write_segmentation(path: Path, organs: Sequence[SceneOrgan], frame: Frame) -> None:
    """Write a ``.seg.nrrd`` as 3D Slicer does, on the scan's grid, of the voxels whose centres lie inside."""
    largest = max(organ.label for organ in organs)
    voxels = np.zeros(frame.shape, np.uint8 if largest < 256 else np.uint16 if largest < 65536 else np.uint32)
    for organ in organs:
        _fill(voxels, organ, frame)
    image = sitk.GetImageFromArray(np.ascontiguousarray(voxels.T))
    affine = LPS_TO_RAS @ frame.affine  # its own inverse
    image.SetOrigin(affine[:3, 3].tolist())
    image.SetSpacing(frame.spacing.tolist())
    image.SetDirection((affine[:3, :3] / frame.spacing).ravel().tolist())
    image.SetMetaData("Segmentation_MasterRepresentation", "Binary labelmap")
    image.SetMetaData("Segmentation_ContainedRepresentationNames", "Binary labelmap|")
    image.SetMetaData("Segmentation_ReferenceImageExtentOffset", "0 0 0")
    extent = " ".join(f"0 {size - 1}" for size in frame.shape)
    for number, organ in enumerate(organs):
        keys = {
            "ID": organ.organ,
            "Name": organ.name,
            "NameAutoGenerated": "0",
            "Color": " ".join(f"{part:.6f}" for part in organ.rgb),
            "ColorAutoGenerated": "0",
            "LabelValue": str(organ.label),
            "Layer": "0",
            "Extent": extent,
            "Tags": f"TerminologyEntry:{_terminology(organ)}|" if organ.code else "",
        }
        for key, value in keys.items():
            image.SetMetaData(f"Segment{number}_{key}", value)
    sitk.WriteImage(image, str(path), True)


def _terminology(organ: SceneOrgan) -> str:
    """Slicer's terminology entry of an organ's code: ``SCT^10200004^Liver``, its meaning optional."""
    if "~" in organ.code:  # it is one already
        return organ.code
    scheme, value, meaning = (*(organ.code if "^" in organ.code else f"SCT^{organ.code}").split("^"), "")[:3]
    entry = f"{scheme}^{value}^{meaning or organ.name}"
    category = "SCT^123037004^Anatomical Structure"
    return f"{_CONTEXT}~{category}~{entry}~^^~Anatomic codes - DICOM master list~^^~^^"


def _fill(voxels: np.ndarray, organ: SceneOrgan, frame: Frame) -> None:
    """Give the voxels (a, b, c) whose centres lie in an organ its label."""
    index = (organ.mesh.vertices - frame.affine[:3, 3]) @ np.linalg.inv(frame.affine[:3, :3]).T
    first = np.maximum(np.floor(index.min(axis=0)).astype(np.int64), 0)
    stop = np.minimum(np.ceil(index.max(axis=0)).astype(np.int64) + 1, frame.shape)
    a, b, c = (int(size) for size in np.maximum(stop - first, 0))
    if min(a, b, c) == 0:
        return
    inside = voxelise(organ.mesh, frame.affine, (a, b, c), first)
    block = tuple(slice(start, end) for start, end in zip(first, stop, strict=True))
    voxels[block][inside] = organ.label
