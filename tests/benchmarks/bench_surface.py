"""Time of the surface, curves given: ``pytest tests/benchmarks/bench_surface.py``."""

import numpy as np
import pytest

from cccd.containers import Frame, Sections, Structure
from cccd.settings.surface import LoftSettings
from cccd.surface import loft_surface
from cccd.tracing import trace_mask

SETTINGS = LoftSettings()


def brain_curves():
    from nilearn.datasets import load_mni152_brain_mask

    image = load_mni152_brain_mask(resolution=1)
    mask = np.asarray(image.dataobj) > 0
    frame = Frame(image.affine, 2, mask.shape)
    return trace_mask(Structure("mni152", "brain", frame, np.zeros(3, int), mask=mask))


@pytest.mark.parametrize("slices", [40, 80, 155])
def test_brain(benchmark, slices):
    curves = brain_curves()
    keep = curves.slice < np.unique(curves.slice)[:slices][-1] + 1
    count = int(keep.sum())
    part = type(curves)(
        curves.points[: curves.offsets[count]],
        curves.offsets[: count + 1],
        curves.slice[:count],
        curves.hole[:count],
        curves.frame,
    )
    loft_surface(Sections(part), SETTINGS)  # compile
    surface = benchmark.pedantic(loft_surface, (Sections(part), SETTINGS), rounds=3)
    assert surface.mesh.is_closed_manifold
