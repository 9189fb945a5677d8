"""The whole way of a structure to its surface, as the pipeline's jobs go it one by one."""

from __future__ import annotations

from collections.abc import Callable

from cccd.containers import Curves, Sections, Structure
from cccd.contours import take_contours, trace_contours
from cccd.plugins import find, table
from cccd.settings.junctions import BoundarySettings, InferenceSettings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd.surface.surface import LoftedSurface


def find_contours(structure: Structure, boundaries: BoundarySettings, inference: InferenceSettings) -> Curves:
    """Make ordered closed curves of what a structure brings.

    Drawn contours are taken as they are, a mask is traced; anything else another package orders.

    Parameters
    ----------
    structure : Structure
    boundaries, inference
        Sections ``boundaries`` and ``gnn.inference`` of the configuration, read where a network orders.

    Raises
    ------
    InputError
        No slice has a closed curve.
    """
    match structure.input:
        case "contours":
            return take_contours(structure)
        case "mask":
            return trace_contours(structure)
        case other:
            return find(table("CURVES")[other])(structure, boundaries, inference)


def loft_sections(
    sections: Sections, lofting: LoftSettings, tell: Callable[[str], None] = lambda step: None
) -> LoftedSurface:
    """Loft what is known of slices.

    Parameters
    ----------
    sections : Sections
    lofting : LoftSettings
        Section ``surface`` of the configuration.
    tell : callable
        Gets the name of the step as it begins.

    Returns
    -------
    LoftedSurface
        What is wrong with the curves stands before its own warnings.
    """
    tell("surface")
    surface = loft_surface(sections, lofting)
    if sections.mask is None:
        from cccd.curves.describe import crossed_warnings, self_crossed_warnings

        wrong = [*self_crossed_warnings(sections.curves), *crossed_warnings(sections.curves)]
        surface.report["warnings"] = [*wrong, *surface.report["warnings"]]
    return surface
