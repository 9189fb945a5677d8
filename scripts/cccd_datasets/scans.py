"""Scans that are no files: by a request's ``source``."""

from __future__ import annotations

from typing import Any

import numpy as np

from cccd.containers import Structure
from cccd.inputs.load import MARGIN_VOXELS, Scan, find_organ, frame_of, scan_of
from cccd.request import Request
from cccd.settings.imports import ImportSettings
from cccd_datasets import packaged
from cccd_datasets.degraded import BIAS, EVERY, NOISE, damage_maps, rescan
from cccd_datasets.heads import draw_head
from cccd_datasets.phantoms import make_phantom

# What is scanned around a phantom's organ, mm, and by how much its voxels are larger than a mask's phantom's:
# a quick scan, and seconds to order.
_AROUND_PHANTOM_MM, _COARSER = 45.0, (2, 2, 1)


def read_packaged(request: Request, settings: ImportSettings, seed: int) -> Scan:
    """Read a scan and its mask from a package's data; nothing of it is random."""
    image, mask, facts = getattr(packaged, f"read_{request.source}")(request.organ, request.location)
    provenance: dict[str, Any] = {"source": request.source, **facts}
    return Scan(frame_of(mask, settings), image.data, mask.data, provenance=provenance)


def make_row_phantom(request: Request, settings: ImportSettings, seed: int) -> Structure:
    """Make a phantom, its slices' boundary maps damaged where the source says so."""
    phantom = make_phantom(
        request.case,
        request.organ,
        settings.phantom.spacing_mm,
        seed=seed,
        margin_voxels=MARGIN_VOXELS,
        location=request.location,
    )
    if request.source == "phantom":
        return phantom
    return damage_maps(phantom, np.random.default_rng(seed))


def scan_brain(request: Request, settings: ImportSettings, seed: int) -> Scan:
    """Scan the MNI brain anew, or a head around it, and find its region in this image alone.

    The mask is ground truth.
    """
    clean, brain, facts = packaged.read_mni152(request.organ, request.location)
    rng = np.random.default_rng(seed)
    if request.source == "mni152_head":
        clean = draw_head(clean, brain, rng)
    image, mask = rescan(clean, brain, rng)
    region, found = find_organ(image, request, settings)
    provenance = {
        "source": request.source,
        **facts,
        "scan": {"every": list(EVERY), "noise": NOISE, "bias": BIAS},
        "seed": seed,
        **found,
    }
    frame = frame_of(image, settings)
    return Scan(frame, image.data, mask.data, region=region.data, provenance=provenance)


def scan_row_phantom(request: Request, settings: ImportSettings, seed: int) -> Scan:
    """Scan a phantom with what is around its organ, and find that in the image alone; the rest is truth."""
    i, j, k = (float(size) for size in np.multiply(settings.phantom.spacing_mm, _COARSER))
    most = np.ceil(np.divide(_AROUND_PHANTOM_MM, (i, j, k))).astype(int)
    phantom = make_phantom(
        request.case,
        request.organ,
        (i, j, k),
        seed=seed,
        margin_voxels=most,
        location=request.location,
        contrast=False,
    )
    image = scan_of(phantom)
    assert image is not None
    region, found = find_organ(image, request, settings)
    provenance = phantom.provenance | {"source": request.source, **found}
    layers = {"mask": phantom.mask, "region": region.data, "truth": phantom.truth}
    return Scan(frame_of(image, settings), image.data, **layers, provenance=provenance)
