"""Train the network that fills between slices: ``python -m cccd_training.filling WEIGHTS.npz``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from cccd_training.filling.bodies import sliced_body
from cccd_training.filling.training import save_weights, train


def main() -> None:
    """Draw bodies, train, write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--bodies", type=int, default=450)
    parser.add_argument("--steps", type=int, default=7000)
    parser.add_argument("--rate", type=float, default=2e-3, help="first learning rate")
    parser.add_argument("--seed", type=int, default=1000)
    asked = parser.parse_args()
    drawn = (sliced_body(asked.seed + n) for n in tqdm(range(asked.bodies), "bodies"))
    model, losses = train([body for body in drawn if body], asked.steps, asked.rate, asked.seed)
    save_weights(model, asked.weights)
    print(f"mean error of the last 100 steps: {np.mean(losses[-100:]):.3f} nodes")


if __name__ == "__main__":
    main()
