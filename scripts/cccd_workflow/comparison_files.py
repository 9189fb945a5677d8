"""What ``cccd compare`` writes: heat maps of the distance on the first surface, and a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.errors import InputError
from cccd.files import TO_GLTF
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh, xml_of
from cccd.project import PROJECT
from cccd.store import atomic_path
from cccd_viewers.page_files import View
from cccd_workflow.comparison import Compared, Comparison, is_closed

#: A page shows at most so many triangles of each surface.
_TRIANGLES = 30_000


def check_outputs(paths: Sequence[Path]) -> None:
    """Refuse files that `write_comparison` could not write, before anything is measured.

    Raises
    ------
    InputError
        Another suffix.
    """
    for path in paths:
        if path.suffix.lower() not in _WRITERS:
            known = ", ".join(_WRITERS)
            raise InputError(
                str(path), f"unknown format {path.suffix!r} of a comparison", f"choose one of {known}"
            )


def write_comparison(path: Path, found: Comparison) -> None:
    """Write a heat map (``.glb``, ``.vtp``) or a page (``.html``).

    Parameters
    ----------
    path : path
        Its suffix chooses what.
    found : Comparison
        Measured with ``heat_map``.

    Raises
    ------
    InputError
        No row has a surface of both inputs.
    """
    rows = [row for row in found.rows if row.mesh is not None]
    if not rows:
        raise InputError(str(path), "no label is in both inputs", "leave -o out")
    with atomic_path(path) as temporary:
        _WRITERS[path.suffix.lower()](temporary, found, rows)


def _mesh(row: Compared) -> tuple[Mesh, Any]:
    """Surface of a row, and the distance at its vertices."""
    assert row.mesh is not None
    assert row.distance is not None
    return row.mesh, row.distance


def _write_vtp(path: Path, found: Comparison, rows: Sequence[Compared]) -> None:
    parts = [_mesh(row) for row in rows]
    data = cast(Any, Mesh.joined([mesh for mesh, _ in parts]).to_polydata())
    data.point_data["distance"] = np.concatenate([distance for _, distance in parts])
    data.point_data["row"] = np.repeat(np.arange(len(rows)), [len(mesh.vertices) for mesh, _ in parts])
    data.field_data["Rows"] = [row.caption for row in rows]
    data.field_data["SpaceUnit"] = ["mm"]
    data.field_data["Space"] = ["RAS"]
    path.write_text(xml_of(data), encoding="ascii")


def _write_glb(path: Path, found: Comparison, rows: Sequence[Compared]) -> None:
    import trimesh

    from cccd_viewers.viewer import colour_limit, colour_stops

    stops = np.array(colour_stops()["distance"], float)
    limit = colour_limit(np.concatenate([_mesh(row)[1] for row in rows]), "distance")
    scene = cast(Any, trimesh.Scene())
    for row in rows:
        mesh, distance = _mesh(row)
        share = np.clip(distance / limit, -1, 1)
        at = (share + 1) / 2 * (len(stops) - 1)
        colours = np.column_stack([np.interp(at, np.arange(len(stops)), stops[:, c]) for c in range(3)])
        drawn = cast(Any, mesh.to_trimesh())
        drawn.visual = cast(Any, trimesh).visual.ColorVisuals(
            drawn, vertex_colors=np.column_stack([np.rint(colours), np.full(len(at), 255)]).astype(np.uint8)
        )
        scene.add_geometry(drawn, node_name=row.caption, geom_name=row.caption, transform=TO_GLTF)
    ends = f"blue {-limit:g} mm (inside), white 0, red {limit:g} mm (outside)"
    scene.metadata["note"] = f"distance to {Path(found.second).name}: {ends}"
    path.write_bytes(scene.export(file_type="glb"))


def _write_page(path: Path, found: Comparison, rows: Sequence[Compared]) -> None:
    from cccd_workflow.report.page import build_comparison_page

    names = Path(found.first).name, Path(found.second).name
    views = {row.caption: _view(row, names[1]) for row in rows}
    build_comparison_page(found.as_json(), views, names, path, PROJECT / "workflow" / "report")


def _view(row: Compared, other: str) -> View:
    """Make what the page shows of a row: both surfaces made small, the first one's coloured."""
    mesh, _ = _mesh(row)
    assert row.other is not None
    shown, theirs = mesh.simplified(_TRIANGLES), row.other.simplified(_TRIANGLES)
    distance = to_mesh(shown.vertices, row.other)
    if not is_closed(row.other):
        distance = np.abs(distance)
    return View({"surface": shown, "cubes": theirs}, {"distance": distance}, len(mesh.faces), other, {})


_WRITERS: dict[str, Callable[[Path, Comparison, Sequence[Compared]], None]] = {
    ".glb": _write_glb,
    ".vtp": _write_vtp,
    ".html": _write_page,
}
