"""Boundary maps that the junction network's training never saw.

    python bench/out_of_distribution.py

The outlines are those of organs (slices of the MNI brain, of a phantom liver and kidney), where training and
the report's table draw random blobs. The damage is not that of `cccd_datasets.corruptions`: published
augmentations (Cutout, DeVries and Taylor 2017; GridMask, Chen et al. 2020) and what imaging does (a noisy
slice's threshold, ghosts of motion, coarse pixels, straight lines across). The last kind is no damage: edges
of an MR template's slices, under noise, with the brain's mask as label (`cccd_junctions.boundary.edge_map`);
the network sees these slices too. The table goes to ``docs/out_of_distribution.csv``.
"""

from one_core import ROOT  # isort: skip

from pathlib import Path

import numpy as np
from scipy import ndimage

from cccd.geometry.opencv import border_pixels
from cccd.inputs import Request, read_request
from cccd.settings.imports import ImportSettings, PhantomSettings
from cccd.settings.junctions import BoundarySettings
from cccd_datasets.phantoms import make_phantom
from cccd_junctions.boundary import edge_map
from cccd_junctions.checkpoint import load_model
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.junction_comparison import (
    by_true_labels,
    classical_decoder,
    compare_decoders,
    network_decoder,
)
from cccd_training.junctions.damages import FIRST_DAMAGES
from cccd_training.junctions.synthetic_maps import SyntheticMap

#: Slices of each organ, and the shortest outline in pixels.
SLICES, SHORTEST_PX, MARGIN_PX, SEED = 8, 150, 24, 38


def organs():
    """Name, and stacks (S, I, J) of mask and image, of each organ."""
    row = dict.fromkeys(("image", "mask", "boundary", "label", "location"), "")
    brain = row | {"case": "test", "organ": "brain", "source": "mni152"}
    yield read_request(Request.of_row(brain, Path()), ImportSettings(), seed=SEED)
    for organ in ("liver", "kidney"):
        yield make_phantom(
            "unseen", organ, PhantomSettings().spacing_mm, seed=SEED, margin_voxels=MARGIN_PX, location=organ
        )


def slices(structure):
    """Masks of one piece without holes, with a margin, and their grey slices."""
    masks, images = structure.required_stack("mask"), structure.required_stack("image")
    used = np.flatnonzero(masks.any(axis=(1, 2)))
    for k in used[(np.linspace(0.15, 0.85, SLICES) * (len(used) - 1)).astype(int)]:
        labels, _ = ndimage.label(masks[k])
        sizes = np.bincount(labels.ravel())
        sizes[0] = 0
        mask = np.pad(ndimage.binary_fill_holes(labels == sizes.argmax()), MARGIN_PX)
        mask = ndimage.binary_opening(mask, np.ones((2, 2)))
        yield mask, np.pad(images[k].astype(np.float32), MARGIN_PX, mode="edge")


def unseen_maps():
    """Maps of every kind of unseen damage, and of the edges of MR slices, by the kind's name."""
    rng = np.random.default_rng(SEED)
    maps = {name: [] for name in (*FIRST_DAMAGES, "edges of MR slices")}
    for structure in organs():
        for mask, image in slices(structure):
            contours = [contour.astype(np.int32) for contour in border_pixels(mask.astype(np.uint8))]
            if len(contours) != 1 or len(contours[0]) < SHORTEST_PX:
                continue
            outline = np.zeros(mask.shape, bool)
            outline[tuple(contours[0].T)] = True
            observed = {name: damage(rng, mask, outline) for name, damage in FIRST_DAMAGES.items()}
            grey = dict.fromkeys(observed)
            if structure.organ == "brain":
                inside = np.ptp(np.percentile(image[mask], (5, 95)))
                noisy = image + rng.normal(0, 0.1 * inside, image.shape).astype(np.float32)
                observed["edges of MR slices"] = edge_map(noisy[None], mask[None], BoundarySettings())[0]
                grey["edges of MR slices"] = noisy
            for name, found in observed.items():
                pixels = np.argwhere(found).astype(np.int32)
                maps[name].append(SyntheticMap(pixels, contours, name, mask.shape, grey[name]))
    return maps


def main():
    """Score the shipped network, the best classical decoders and the true labels; write the table."""
    shipped = load_model(ROOT / "workflow" / "models" / "junctions.pt")
    decoders = {"GNN, shipped": network_decoder(shipped), "decoder + true labels": by_true_labels}
    for name in ("skeleton prune + tour + prizes", "spanning tree, best cycle", "watershed (seeded)"):
        decoders[name] = classical_decoder(DECODERS[name].run)
    table, _ = compare_decoders(decoders, unseen_maps())
    table = table[table["kind"] != "all ten"].drop(columns="ms")
    table.to_csv(ROOT / "docs" / "out_of_distribution.csv", index=False, float_format="%.4g")
    print(table.pivot(index="kind", columns="decoder", values="correct").to_string())


if __name__ == "__main__":
    main()
