"""USD: the control meshes themselves, as subdivision surfaces with their creases, in mm with z up.

Other programs evaluate the spline itself: `subdivisionScheme` is `catmullClark`, whose rules are ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.files import ExportOptions
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.plugins import COLOUR, NOTE
from cccd.surface.surface import LoftedSurface

#: USD's colours are linear; ours are sRGB.
GAMMA = 2.2


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write a mesh for each body and cavity; triangles where the surface has no control meshes."""
    from pxr import Gf, Sdf, Usd, UsdGeom  # pyright: ignore[reportMissingTypeStubs]  # of the extra usd

    gf, sdf, usd, geom = (cast(Any, module) for module in (Gf, Sdf, Usd, UsdGeom))
    layer = sdf.Layer.CreateAnonymous(path.suffix)
    stage = usd.Stage.Open(layer)
    geom.SetStageMetersPerUnit(stage, geom.LinearUnits.millimeters)
    geom.SetStageUpAxis(stage, geom.Tokens.z)
    layer.comment = NOTE
    root = geom.Xform.Define(stage, "/surface")
    root.GetPrim().SetDisplayName(options.organ)
    stage.SetDefaultPrim(root.GetPrim())
    colour = gf.Vec3f(*(part**GAMMA for part in COLOUR))
    for part in _parts(surface):
        mesh = geom.Mesh.Define(stage, f"/surface/{part.name}")
        points = np.ascontiguousarray(part.points, np.float32)
        mesh.CreateSubdivisionSchemeAttr(part.scheme)
        mesh.CreatePointsAttr(points)
        mesh.CreateExtentAttr(np.stack([points.min(axis=0), points.max(axis=0)]))
        mesh.CreateFaceVertexCountsAttr(np.full(len(part.faces), part.faces.shape[1], np.int32))
        mesh.CreateFaceVertexIndicesAttr(part.faces.ravel().astype(np.int32))
        mesh.CreateOrientationAttr(geom.Tokens.rightHanded)  # cavities are inside out by their faces
        mesh.CreateDisplayColorAttr([colour])
        if len(part.creases):
            mesh.CreateCreaseIndicesAttr(part.creases.ravel().astype(np.int32))
            mesh.CreateCreaseLengthsAttr(np.full(len(part.creases), 2, np.int32))
            mesh.CreateCreaseSharpnessesAttr(part.sharpness.astype(np.float32))
    if not layer.Export(str(path)):
        raise OSError(f"USD could not write {path}")


@dataclass(frozen=True, eq=False)
class _Part:
    """A mesh of the file."""

    name: str
    scheme: str
    points: FloatArray
    faces: IntArray
    creases: IntArray
    sharpness: FloatArray


def _parts(surface: LoftedSurface) -> Iterator[_Part]:
    numbers = {1: 0, -1: 0}
    for body in surface.bodies:
        numbers[body.sign] += 1
        name = f"{'body' if body.sign > 0 else 'cavity'}_{numbers[body.sign]}"
        yield _Part(name, "catmullClark", body.vertices, body.quads, body.creases, body.sharpness)
    if not surface.bodies:
        nothing: dict[str, Any] = {"creases": np.zeros((0, 2), np.int64), "sharpness": np.zeros(0)}
        yield _Part("triangles", "none", surface.vertices, surface.faces, **nothing)
