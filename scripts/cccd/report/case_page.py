"""A page of all organs of a case, to switch on and off and to make transparent: one file, no request."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from cccd.geometry.mesh import Mesh
from cccd.store import atomic_path

__all__ = ["build_case_page"]

#: Positions are kept as whole numbers up to this.
_STEPS = 65535
#: An organ keeps this many triangles at least.
_LEAST = 400
#: All organs together are simplified to about this many triangles: a page of some 6 MB.
_TRIANGLES = 320_000


def build_case_page(
    scene: Mapping[str, Any], meshes: Mapping[str, Mesh], template_dir: Path, output: Path
) -> None:
    """Write the page of a case.

    Parameters
    ----------
    scene : mapping
        What ``scene.json`` holds.
    meshes : mapping of str to Mesh
        By organ, mm RAS.
    template_dir : path
        ``workflow/report``.
    output : path
        Where the page goes.
    """
    points = np.concatenate([mesh.vertices for mesh in meshes.values()])
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    share = min(1.0, _TRIANGLES / max(1, sum(len(mesh.faces) for mesh in meshes.values())))
    organs = [
        {**organ, **_packed(meshes[organ["organ"]], share, low, size)}
        for organ in sorted(scene["organs"], key=lambda organ: -organ["volume_ml"])
    ]
    loader = jinja2.FileSystemLoader(template_dir)
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    extent = (np.ptp(points, axis=0) / size).tolist()
    page = environment.get_template("case.html.j2").render(case=scene["case"], organs=organs, extent=extent)
    with atomic_path(output) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _packed(mesh: Mesh, share: float, low: np.ndarray, size: float) -> dict[str, str]:
    """Points (16 bits each) and corners (32 bits each) of a simplified mesh, as base64."""
    small = mesh.simplified(max(_LEAST, int(share * len(mesh.faces))))
    points = np.rint(np.clip((small.vertices - low) / size, 0, 1) * _STEPS).astype("<u2")
    return {
        "points": base64.b64encode(points.tobytes()).decode(),
        "faces": base64.b64encode(small.faces.astype("<u4").tobytes()).decode(),
    }
