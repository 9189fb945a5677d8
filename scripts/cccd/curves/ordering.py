"""From a structure to its ordered curves: exact where a mask is given, by the GNN where it is not.

A mask needs no network: border following is exact. The GNN earns its cost on boundary-only input and
on edge maps of grey images. With a mask its boundary pixels are ordered beside the exact tracing, so that
every structure says how well that goes.
"""

from __future__ import annotations

import numpy as np

from cccd.containers import Boundaries, Curves, Structure
from cccd.errors import InputError
from cccd.junctions import order_boundaries
from cccd.metrics import dice
from cccd.tracing import left_out, trace_mask

__all__ = ["order_structure"]


def order_structure(
    structure: Structure, boundaries: Boundaries, model, ordering: str = "auto"
) -> tuple[Curves, dict]:
    """Order the boundary pixels of every slice into closed simple curves.

    Parameters
    ----------
    structure : Structure
        With contours (taken as they are), a mask, or boundary maps.
    boundaries : Boundaries
        Its boundary pixels.
    model : torch module
        From `cccd.junctions.checkpoint.load_model`.
    ordering : {"auto", "gnn"}
        ``auto`` traces a mask exactly; ``gnn`` lets the GNN order in any case, as the paper does.

    Returns
    -------
    curves : Curves
        Closed, simple, oriented.
    report : dict
        Plain JSON: ``method``, the GNN's per-slice counts, and for a traced mask how far the GNN agrees.

    Raises
    ------
    InputError
        When no slice has a closed boundary.
    """
    if structure.contours is not None:
        return structure.contours, {"method": "contours as given"}
    curves, report = order_boundaries(
        boundaries, model, image=structure.stack("image"), image_origin=structure.stack_origin
    )
    traced = ordering == "auto" and structure.mask is not None and structure.boundary is None
    if traced:
        exact = trace_mask(structure)
        report["method"] = "traced mask"
        report["left_out"] = left_out(structure.stack("mask"), structure.stack_origin, exact)
        report["gnn_agreement"] = _agreement(exact, curves)
        curves = exact
    else:
        report["method"] = "GNN"
    if not len(curves):
        raise InputError(
            f"{structure.case}/{structure.organ}",
            "no slice has a closed boundary",
            "look at the input's slices, or lower the smallest area that counts",
        )
    return curves, report


def _agreement(exact: Curves, other: Curves) -> dict:
    """Share of curves found again and 3D Dice of two sets of curves of one structure."""
    if not len(exact) or not len(other):
        return {"dice": 0.0, "curves": len(other), "curves_exact": len(exact)}
    low = np.floor(exact.points.min(0)).astype(int) - 1
    shape = np.ceil(exact.points.max(0)).astype(int) + 2 - low
    slices = np.union1d(exact.slice, other.slice)
    origin = (slices[0], *low)
    extent = (slices[-1] - slices[0] + 1, *shape)
    score = dice(exact.rasterise(origin, extent), other.rasterise(origin, extent))
    return {"dice": float(score), "curves": len(other), "curves_exact": len(exact)}
