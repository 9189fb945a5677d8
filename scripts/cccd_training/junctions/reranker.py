"""Train the network that chooses among a slice's labellings: ``python -m cccd_training.junctions.reranker``.

It reads what a trained junction network says of fresh synthetic maps, and learns which alternative of the
least cut has the right curves (`cccd_training.junctions.scoring`); and from maps left aside, how likely the
chosen one is wrong. No real scan is among the maps.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor, nn
from tqdm import tqdm

from cccd.geometry.arrays import BoolArray, FloatArray, SingleArray
from cccd_junctions.alternatives import FEATURES, alternatives, describe
from cccd_junctions.checkpoint import load_model
from cccd_junctions.energy import energy_weights, inference_energy, least_energy
from cccd_junctions.inference import Predictor, read_slices
from cccd_junctions.network import JunctionNetwork
from cccd_junctions.reranking import Reranker
from cccd_junctions.uncertainty import areas_between, doubt_facts
from cccd_training.junctions.scoring import score_labels
from cccd_training.junctions.synthetic_maps import SyntheticMap, draw_map

#: How often each kind of map is drawn.
KINDS = {
    "spurs": 1.5,
    "bridges": 2,
    "pinch": 3,
    "gaps": 4,
    "noise": 1.5,
    "double": 3,
    "thick": 4,
    "mixed": 8,
    "everything": 2,
    "canny": 5,
}
#: Maps of which the severity is drawn as for the junction network; of the others it is within these bounds.
ORDINARY, SEVERITIES = 0.5, (0.8, 3.0)
#: Images that are not shown, and pixels of the outlines at least.
HIDDEN, SHORTEST_PX = 0.15, 80
#: Maps drawn from one seed.
GROUP = 12
#: Channels of the two layers, and what is dropped of them in training.
CHANNELS, DROPOUT = (96, 48), (0.3, 0.15)
#: Training: maps per step, peak learning rate, and weight decay.
STEP, RATE, DECAY = 128, 4e-3, 0.02
#: Where no alternative is right, those of more Dice are worth more: so much, and per unit of Dice.
SECOND_BEST, DICE_WORTH = 0.3, 40.0
#: Of so many maps one is left aside for the chance of error.
ASIDE = 5
#: Score of what is no alternative.
_NEVER = -1e9


@dataclass(frozen=True, eq=False)
class Example:
    """A slice's labellings.

    Attributes
    ----------
    features : (K, F) float32
        `cccd_junctions.alternatives.FEATURES`.
    correct : (K,) bool
        Whether each has the right curves.
    dice : (K,) float32
    apart : (K, K) float32
        Areas in pixels between any two (`cccd_junctions.uncertainty.areas_between`).
    """

    features: SingleArray
    correct: BoolArray
    dice: SingleArray
    apart: SingleArray


def draw_examples(model: Predictor, seed: int, group: int) -> list[Example]:
    """Draw a group of maps and find the alternatives of those that are not outlines already."""
    rng = np.random.default_rng([seed, group])
    maps = [_draw(rng) for _ in range(GROUP)]
    shown = [None if rng.random() < HIDDEN else drawn.image for drawn in maps]
    read = read_slices([drawn.pixels for drawn in maps], shown, model)
    examples: list[Example] = []
    for drawn, one in zip(maps, read, strict=True):
        if one.logits is None:
            continue
        graph, energy = one.graph, inference_energy(one.graph, one.logits)
        cut = least_energy(graph, energy)
        if not cut.any():
            continue
        labels = alternatives(graph, energy, energy_weights(graph), cut)
        features = describe(graph, one.logits, energy, labels).astype(np.float32)
        scores = [score_labels(graph, inside, drawn.contours) for inside in labels]
        examples.append(
            Example(
                features,
                np.array([score.correct for score in scores]),
                np.array([score.dice for score in scores], np.float32),
                np.array([areas_between(graph, labels, k) for k in range(len(labels))], np.float32),
            )
        )
    return examples


def _draw(rng: np.random.Generator) -> SyntheticMap:
    shares = np.array(list(KINDS.values())) / sum(KINDS.values())
    while True:
        kind = str(rng.choice(list(KINDS), p=shares))
        severity = None if rng.random() < ORDINARY else float(rng.uniform(*SEVERITIES))
        drawn = draw_map(rng, kind, severity)
        if sum(map(len, drawn.contours)) >= SHORTEST_PX:
            return drawn


def train_reranker(examples: Sequence[Example], epochs: int, seed: int) -> Reranker:
    """Fit scores whose softmax is the probability that a labelling is the right one.

    One in `ASIDE` of the examples is not trained on: the chance of error is fitted to these.
    """
    aside = examples[::ASIDE]
    examples = [example for n, example in enumerate(examples) if n % ASIDE]
    cast(Any, torch).manual_seed(seed)
    everything = np.concatenate([example.features for example in examples])
    blank = Reranker(everything.mean(axis=0), everything.std(axis=0) + np.float32(0.01), [], [])
    batch = _packed(examples, blank)
    net = _perceptron()
    optimiser = torch.optim.AdamW(net.parameters(), RATE / 2, weight_decay=DECAY)
    steps = -(-len(examples) // STEP)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=epochs * steps)
    for _ in tqdm(range(epochs), "epochs"):
        order = torch.randperm(len(examples))
        for start in range(0, len(examples), STEP):
            chosen = order[start : start + STEP]
            features, *rest = (part[chosen] for part in batch)
            optimiser.zero_grad()
            cast(Any, _loss(net(features).squeeze(-1), *rest)).backward()
            cast(Any, optimiser).step()
            schedule.step()
    layers = [layer for layer in net if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().numpy().T.copy() for layer in layers]
    biases = [layer.bias.detach().numpy() for layer in layers]
    trained = replace(blank, weights=weights, biases=biases)
    return replace(trained, doubt=fit_doubt(trained, aside))


def fit_doubt(reranker: Reranker, examples: Sequence[Example]) -> SingleArray:
    """Fit the logistic curve (4,) of `cccd_junctions.uncertainty.chance_of_error`, by maximum likelihood.

    Parameters
    ----------
    reranker : Reranker
        Which chooses.
    examples : sequence of Example
        Maps that it was not trained on.
    """
    facts: list[FloatArray] = []
    wrong: list[bool] = []
    for example in examples:
        scores = reranker.scores(example.features)
        chosen = int(scores.argmax())
        size = float(example.features[0, FEATURES.index("size")])
        facts.append(doubt_facts(scores, float(scores[0]), example.apart[chosen], size))
        wrong.append(not example.correct[chosen])
    design = np.column_stack([facts, np.ones(len(facts))])

    def surprise(weights: FloatArray) -> float:
        odds = design @ weights
        return float(np.logaddexp(0, odds).sum() - odds[wrong].sum())

    return minimize(surprise, np.zeros(design.shape[1])).x.astype(np.float32)


def _perceptron() -> nn.Sequential:
    sizes = [len(FEATURES), *CHANNELS]
    layers: list[nn.Module] = []
    for inner, outer, dropped in zip(sizes, sizes[1:], DROPOUT, strict=False):
        layers += [nn.Linear(inner, outer), nn.ReLU(), nn.Dropout(dropped)]
    return nn.Sequential(*layers, nn.Linear(sizes[-1], 1))


def _packed(examples: Sequence[Example], scaling: Reranker) -> list[Tensor]:
    """Features (N, K, F), which of the K there are, which are correct, and Dice."""
    shape = len(examples), max(len(example.correct) for example in examples)
    features = np.zeros((*shape, len(FEATURES)), np.float32)
    there, correct, dice = np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape, np.float32)
    for n, example in enumerate(examples):
        count = len(example.correct)
        features[n, :count] = scaling.standardised(example.features)
        there[n, :count], correct[n, :count], dice[n, :count] = True, example.correct, example.dice
    return [torch.as_tensor(part) for part in (features, there, correct, dice)]


def _loss(scores: Tensor, there: Tensor, correct: Tensor, dice: Tensor) -> Tensor:
    """Cross entropy of the correct labellings together; without any, of weights that follow Dice."""
    logs = torch.log_softmax(scores.masked_fill(~there, _NEVER), dim=1)
    found = -torch.logsumexp(logs.masked_fill(~correct, _NEVER), dim=1)
    weights = torch.softmax((DICE_WORTH * dice).masked_fill(~there, _NEVER), dim=1)
    nearest = -(weights * logs.clamp(min=-30)).sum(dim=1)
    return torch.where(correct.any(dim=1), found, SECOND_BEST * nearest).mean()


def _groups(model: Predictor, seed: int, maps: int, processes: int) -> Iterator[list[Example]]:
    draw = partial(draw_examples, model, seed)
    groups = range(-(-maps // GROUP))
    if processes == 1:
        yield from map(draw, groups)
        return
    with multiprocessing.get_context("fork").Pool(processes) as workers:
        yield from workers.imap(draw, groups, chunksize=4)


def main() -> None:
    """Draw maps, train, write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path, help="trained junction network, as workflow/models/junctions.pt")
    parser.add_argument("weights", type=Path, help="file to write, as reranker.npz")
    parser.add_argument("--maps", type=int, default=20_000)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=201)
    parser.add_argument("--processes", type=int, default=1)
    asked = parser.parse_args()
    model = load_model(asked.model)
    if not isinstance(model, JunctionNetwork):
        parser.error(f"{asked.model} holds the paper's network, which has no alternatives")
    torch.set_num_threads(1)
    groups = _groups(model, asked.seed, asked.maps, asked.processes)
    examples = [one for group in tqdm(groups, "maps", asked.maps // GROUP) for one in group]
    train_reranker(examples, asked.epochs, asked.seed).save(asked.weights)


if __name__ == "__main__":
    main()
