"""Binary glTF. By its standard it is in metres with y up: the root node carries the transform from mm RAS."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.files.write import ExportOptions
from cccd.settings.formats import COLOUR, NOTE
from cccd.surface.surface import LoftedSurface

#: mm RAS to glTF's metres, y up, z towards the viewer: x right, y superior, z anterior-to-viewer.
TO_GLTF = np.array([[1e-3, 0, 0, 0], [0, 0, 1e-3, 0], [0, -1e-3, 0, 0], [0, 0, 0, 1.0]])


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh in a scene of its own."""
    import trimesh

    mesh = cast(Any, surface.mesh.to_trimesh())
    mesh.visual = gltf_material(options.organ, COLOUR)
    scene = cast(Any, trimesh.Scene())
    scene.add_geometry(mesh, node_name="surface", geom_name="surface", transform=TO_GLTF)
    scene.metadata["note"] = f"{NOTE}; the node's matrix turns mm RAS into metres, y up"
    path.write_bytes(scene.export(file_type="glb"))


def gltf_material(name: str, colour: tuple[float, float, float]) -> Any:
    """Make trimesh's visuals of a colour (sRGB, 0 to 1); glTF's own factors are linear."""
    import trimesh

    visual = cast(Any, trimesh).visual  # not among its stubs' attributes
    linear = [part**2.2 for part in colour]
    material = visual.material.PBRMaterial(
        name=name, baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=0.6
    )
    return visual.TextureVisuals(material=material)
