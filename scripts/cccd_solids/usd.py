"""USD: the control meshes themselves, as subdivision surfaces with their creases, in mm with z up.

Other programs evaluate the spline itself: `subdivisionScheme` is `catmullClark`, whose rules are ours.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.files import COLOUR, ExportOptions
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.store import NOTE
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

    def add(name: str, scheme: str, vertices: FloatArray, faces: IntArray) -> Any:
        mesh = geom.Mesh.Define(stage, f"/surface/{name}")
        points = np.ascontiguousarray(vertices, np.float32)
        mesh.CreateSubdivisionSchemeAttr(scheme)
        mesh.CreatePointsAttr(points)
        mesh.CreateExtentAttr(np.stack([points.min(axis=0), points.max(axis=0)]))
        mesh.CreateFaceVertexCountsAttr(np.full(len(faces), faces.shape[1], np.int32))
        mesh.CreateFaceVertexIndicesAttr(faces.ravel().astype(np.int32))
        mesh.CreateOrientationAttr(geom.Tokens.rightHanded)  # cavities are inside out by their faces
        mesh.CreateDisplayColorAttr([colour])
        return mesh

    numbers = {1: 0, -1: 0}
    for body in surface.bodies:
        numbers[body.sign] += 1
        name = f"{'body' if body.sign > 0 else 'cavity'}_{numbers[body.sign]}"
        mesh = add(name, "catmullClark", body.vertices, body.quads)
        if len(body.creases):
            mesh.CreateCreaseIndicesAttr(body.creases.ravel().astype(np.int32))
            mesh.CreateCreaseLengthsAttr(np.full(len(body.creases), 2, np.int32))
            mesh.CreateCreaseSharpnessesAttr(body.sharpness.astype(np.float32))
    if not surface.bodies:
        add("triangles", "none", surface.vertices, surface.faces)
    if not layer.Export(str(path)):
        raise OSError(f"USD could not write {path}")
