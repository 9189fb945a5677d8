"""Choose parameters of the corner detectors on training phantoms: `python tests/benchmarks/corner_grids.py`.

Prints the best sets of the grids of the detectors on pixels and of those on the chain code. The first of
each stand in `cccd_paper.comparisons.parameters`; the phantoms are of a case that no cohort reports on.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

from cccd.inputs.phantoms import make_phantom
from cccd.settings.imports import PhantomSettings
from cccd.tracing import trace_mask
from cccd_paper.comparisons.corner_comparison import search
from cccd_paper.comparisons.k_sweep import search_chain
from cccd_paper.comparisons.samples import choose_slices

ORGANS, SLICES, SEED = ("liver", "lungs", "kidney"), 4, 152


def main() -> None:
    """Print the two searches' best five of each detector."""
    samples, frame = [], None
    for organ in ORGANS:
        phantom = make_phantom(
            "training", organ, PhantomSettings().spacing_mm, seed=SEED, margin_voxels=3, location=""
        )
        samples += choose_slices(phantom, trace_mask(phantom), SLICES, 60.0)
        frame = phantom.frame
    for scores in (search_chain([sample.curve for sample in samples], frame), search(samples, 1.5)):
        keys = [name for name in ("image", "detector") if name in scores]
        print(scores.groupby(keys).head(5).to_string())


if __name__ == "__main__":
    main()
