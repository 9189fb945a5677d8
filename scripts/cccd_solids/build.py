"""A surface as solids: one per body, with its cavities.

Control meshes become their own patches. What has none, as organs that share their walls, gets a spline that
is fitted to its mesh, or planar facets where that takes too many quads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cccd.errors import InputError
from cccd.files import COLOUR
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import SOLID_VOLUME
from cccd_solids.bodies import nest_pieces, split_bodies
from cccd_solids.fitted import fit_within
from cccd_solids.kernel import Part, check_solid, make_solid, require_kernel, write_parts
from cccd_solids.shells import Shell, facets_within, measure_deviation
from cccd_solids.spline_shell import SplineShell, spline_shell_of

#: Percentiles from other samples of the same surfaces differ by up to this factor.
SAMPLED = 1.25
#: A mesh whose spline needs more quads is made of planar facets, which take less room in STEP.
MOST_QUADS = 20_000
#: A faceted solid has at most so many: each takes about a kilobyte in STEP, and CAD programs slow down
#: beyond.
MOST_FACETS = 40_000


@dataclass(frozen=True)
class Solids:
    """The bodies of one organ.

    Attributes
    ----------
    bodies : sequence of sequence of Shell
        Of each body the outer shell, then its cavities'.
    report : dict
        Plain JSON: what they are made of, and how far they lie from the mesh.
    warnings : list of str
        What they fall short of.
    """

    bodies: Sequence[Sequence[Shell]]
    report: dict[str, Any]
    warnings: list[str]

    @classmethod
    def of(cls, bodies: Sequence[Sequence[Shell]], mesh: Mesh, tolerance: float, **more: float) -> Solids:
        """Hold bodies against the closed mesh that they follow."""
        report = _report(bodies, mesh, tolerance) | more
        return cls(bodies, report, _warnings(report))


def build_solids(
    surface: LoftedSurface | Mesh,
    tolerance: float,
    most_quads: int = MOST_QUADS,
    most_facets: int = MOST_FACETS,
) -> Solids:
    """Turn a surface into bodies: of its own patches, or of those of splines fitted to its closed mesh.

    Parameters
    ----------
    surface : LoftedSurface or Mesh
        In mm. To a mesh, or a surface without control meshes, splines are fitted.
    tolerance : float
        99 % of the surface shall lie within so many mm of the mesh.
    most_quads, most_facets : int
        Of splines, or facets, that follow a mesh.
    """
    if isinstance(surface, LoftedSurface) and surface.bodies:
        return _of_splines(surface.bodies, tolerance)
    mesh = surface.mesh if isinstance(surface, LoftedSurface) else surface
    if not mesh.is_closed_manifold:
        raise InputError("surface", "the mesh is not closed: it encloses no solid", "export another format")
    area = mesh.area
    bodies = [
        [_follow(piece, piece.area / area, tolerance, most_quads, most_facets) for piece in body]
        for body in split_bodies(mesh)
    ]
    return Solids.of(bodies, mesh, tolerance)


def _of_splines(splines: Sequence[ControlMesh], tolerance: float) -> Solids:
    """Make bodies of control meshes; they are held against the limit surfaces, sampled as they are."""
    shells = [spline_shell_of(spline) for spline in splines]
    bodies = [[shells[n] for n in body] for body in nest_pieces([shell.mesh for shell in shells])]
    limit = Mesh.joined([shell.limit for shell in shells])
    return Solids.of(bodies, limit, tolerance, **_jumps(shells))


def _jumps(shells: Sequence[SplineShell]) -> dict[str, float]:
    """How far normals jump over edges that are no creases."""
    jumps = np.concatenate([shell.jumps.ravel() for shell in shells])
    jumps = jumps if len(jumps) else np.zeros(1)
    return {
        "normal_jump_mean_deg": float(jumps.mean()),
        "normal_jump_p99_deg": float(np.percentile(jumps, 99)),
        "normal_jump_largest_deg": float(jumps.max()),
    }


def _follow(mesh: Mesh, share: float, tolerance: float, most_quads: int, most_facets: int) -> Shell:
    """Make a piece's shell of a spline, or else of facets; ``share`` is its part of the area."""
    spline = fit_within(mesh, tolerance, most_quads)
    shell = None if spline is None else spline_shell_of(spline)
    if shell is None or len(shell.mesh.self_intersections()):
        return facets_within(mesh, tolerance, max(4, round(most_facets * share)))
    return shell


def _report(bodies: Sequence[Sequence[Shell]], mesh: Mesh, tolerance: float) -> dict[str, Any]:
    shells = [shell for body in bodies for shell in body]
    whole = Mesh.joined([shell.mesh for shell in shells])
    deviation = measure_deviation(whole, mesh)
    return {
        "bodies": len(bodies),
        "cavities": len(shells) - len(bodies),
        "smooth_shells": sum(shell.smooth for shell in shells),
        "faceted_shells": sum(not shell.smooth for shell in shells),
        "planar_faces": sum(shell.planar for shell in shells),
        "tolerance_mm": tolerance,
        "mean_mm": deviation.mean,
        "p99_mm": deviation.p99,
        "largest_mm": deviation.largest,
        "volume_ratio": whole.volume / mesh.volume,
        "self_intersections": len(whole.self_intersections()),
    }


def _warnings(report: dict[str, Any]) -> list[str]:
    found: list[str] = []
    if report["p99_mm"] > SAMPLED * report["tolerance_mm"]:
        found.append(
            f"99 % of the solid lie within {report['p99_mm']:.2g} mm of the mesh, not "
            f"{report['tolerance_mm']:g}: raise surface.step_tolerance_mm"
        )
    if abs(report["volume_ratio"] - 1) > SOLID_VOLUME:
        found.append(f"the solid has {report['volume_ratio']:.2%} of the mesh's volume")
    if report["self_intersections"]:
        found.append(f"the solid intersects itself in {report['self_intersections']} places")
    return found


def write_solids(path: Path, name: str, solids: Solids, form: str) -> dict[str, Any]:
    """Write an organ's solids to a file of OpenCASCADE's, checked before.

    Returns
    -------
    dict
        The report of `build_solids`, and what OpenCASCADE finds: ``valid``, ``free_edges``, ``faces``,
        ``volume_ml``; ``bytes`` of the file; ``warnings``.

    Raises
    ------
    InputError
        Where OpenCASCADE is missing or cannot write.
    """
    require_kernel(path)
    part, found = _checked_part(name, solids, COLOUR)
    write_parts(path, [part], form)
    return {"format": form, "bytes": path.stat().st_size, **found}


def write_organs(
    path: Path, organs: Mapping[str, Solids], colours: Mapping[str, tuple[float, float, float]], form: str
) -> dict[str, Any]:
    """Write several organs to one file, each by its name and in its colour (sRGB, 0 to 1).

    Returns
    -------
    dict
        ``bytes`` of the file, ``organs`` with what `write_solids` reports of each, and all their
        ``warnings``, which begin with the organ's name.

    Raises
    ------
    InputError
        Where OpenCASCADE is missing or cannot write.
    """
    require_kernel(path)
    checked = {name: _checked_part(name, solids, colours[name]) for name, solids in organs.items()}
    write_parts(path, [part for part, _ in checked.values()], form)
    found = {name: report for name, (_, report) in checked.items()}
    warnings = [f"{name}: {line}" for name, report in found.items() for line in report["warnings"]]
    return {"format": form, "bytes": path.stat().st_size, "organs": found, "warnings": warnings}


def _checked_part(
    name: str, solids: Solids, colour: tuple[float, float, float]
) -> tuple[Part, dict[str, Any]]:
    """Make an organ's solids, and report what OpenCASCADE finds about them."""
    shapes = [make_solid([shell.build() for shell in body]) for body in solids.bodies]
    checked = [check_solid(shape) for shape in shapes]
    found = {
        "valid": all(solid.valid for solid in checked),
        "free_edges": sum(solid.free_edges for solid in checked),
        "faces": sum(solid.faces for solid in checked),
        "volume_ml": sum(solid.volume for solid in checked) / 1000,
    }
    warnings = list(solids.warnings)
    if not found["valid"] or found["free_edges"]:
        warnings.append("OpenCASCADE does not find the solid valid: check it before you cut or mesh it")
    return Part(name, shapes, colour), {**solids.report, **found, "warnings": warnings}
