"""Train the network that estimates distances: ``python -m cccd_training.distance WEIGHTS.npz``."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

from cccd_training.distance.bodies import draw_sample
from cccd_training.distance.training import save_weights, train


def main() -> None:
    """Draw bodies, train, write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--samples", type=int, default=4000, help="stacks; each takes a third of a second")
    parser.add_argument("--steps", type=int, default=70_000, help="each takes a twentieth of a second")
    parser.add_argument("--rate", type=float, default=1.2e-3, help="first learning rate")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    drawn = (draw_sample(asked.seed + n) for n in tqdm(range(asked.samples), "stacks"))
    samples = [sample for sample in drawn if sample is not None]
    with tqdm(total=asked.steps, desc="steps") as bar:

        def told(_step: int, loss: float, _model: object) -> None:
            bar.set_postfix_str(f"{loss:.3f} pixels", refresh=False)
            bar.update()

        model = train(samples, asked.steps, asked.rate, asked.seed, told=told)
    save_weights(model, asked.weights)


if __name__ == "__main__":
    main()
