"""Train the network that estimates distances: ``python -m cccd_training.distance WEIGHTS.npz``."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm
from tqdm.contrib.concurrent import process_map

from cccd_training.distance.bodies import draw_sample
from cccd_training.distance.training import save_weights, train


def main() -> None:
    """Draw bodies, train, write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--samples", type=int, default=28_000, help="stacks: a third of a second, 1 MB each")
    parser.add_argument("--steps", type=int, default=120_000, help="each takes 5 ms of a GPU, 1 s of a core")
    parser.add_argument("--rate", type=float, default=2e-3, help="first learning rate")
    parser.add_argument("--device", default="cuda", help="of PyTorch; its memory holds all stacks")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.samples)
    drawn = process_map(draw_sample, seeds, chunksize=16, desc="stacks")
    samples = [sample for sample in drawn if sample is not None]
    with tqdm(total=asked.steps, desc="steps") as bar:

        def report(_step: int, loss: float) -> None:
            bar.set_postfix_str(f"{loss:.3f} pixels", refresh=False)
            bar.update()

        model = train(samples, asked.steps, asked.rate, asked.seed, asked.device, report)
    save_weights(model, asked.weights)


if __name__ == "__main__":
    main()
