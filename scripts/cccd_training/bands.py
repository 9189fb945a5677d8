"""Train the scale of the error bands and calibrate it: ``python -m cccd_training.bands SHEET CACHE``.

SHEET is a cohort sheet of masks and phantoms. Each organ is thinned in `STACKS` ways along any axis; what was
compared lies in CACHE, so that a run that was cut off goes on. Writes ``cccd/bands/scale.npz`` and
``cccd/bands/shipped.json``; prints what held-out organs' bands cover.
"""

from __future__ import annotations

import itertools
import sys
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from scipy.stats import spearmanr
from torch import nn

from cccd.bands.calibration import REGIMES, SHIPPED, Thinned, calibrate
from cccd.bands.scale import FARTHEST, WEIGHTS, Scale, shipped_scale
from cccd.cohort import read_cohort
from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.inputs import load_structure
from cccd.settings.root import Settings
from cccd.store import atomic_path
from cccd.thinning import Thinning, averaged, thin_once

#: Stacks of an organ with slices left out, and ones whose voxels are averaged, which have isotropic ones.
STACKS, AVERAGED = 8, 2
EVERY = (2, 3, 4, 5, 6, 8, 10)
#: Phantoms have isotropic voxels.
SETTINGS = {"import": {"phantom": {"spacing_mm": (1.5, 1.5, 1.5)}}}
#: Masks of more voxels are averaged over two along each axis first.
MOST_VOXELS = 6_000_000
#: Hidden values of each layer. With one layer of 32 bands are a little narrower, but rank vertices less well.
WIDTHS = (64, 32)
#: The quantile of offsets that is learnt: lower ones rank vertices better, higher ones give narrower bands
#: at 90 %.
QUANTILE = 0.75
#: Offsets of fewer pixels count as this many.
LEAST_OFFSET = 0.02
STEPS, RATE, DECAY = 3000, 8e-3, 1e-4
#: Stacks of a step, and points of each: widths are ranked among points of one stack.
BATCH_STACKS, BATCH_POINTS = 16, 160
#: Weight of pairs in the wrong order next to the quantile's loss, and how steeply it rises with their widths.
RANKING, STEEPNESS = 2.0, 2.0
#: Logarithms of errors, of so many pixels at least, whose difference counts up to so much.
LEAST_DIFFERENCE, MOST_DIFFERENCE = 0.05, 2.0
#: Points of each stack that are trained with, with repeats.
PER_STACK = 1000
#: Points of the true surface weigh so much more in training: they are fewer.
TRUE_WEIGHT = 4.0
#: Parts of the organs that are held out in turn.
FOLDS = 6


def thinnings(rng: np.random.Generator) -> list[tuple[int, Thinning]]:
    """Draw the ways in which an organ is thinned, each with what its reference keeps of the slices."""
    ways: list[tuple[int, Thinning]] = []
    for number in range(STACKS + AVERAGED):
        axis = int(rng.choice(3, p=[0.25, 0.25, 0.5]))
        if number >= STACKS:
            block = int(rng.integers(2, 4))
            ways.append((1, Thinning(axis, block * int(rng.choice([1, 1, 2])), 0, block, averaged=True)))
            continue
        every, kind = EVERY[(number + int(rng.integers(2)) * 3) % len(EVERY)], rng.random()
        block, coarser = (2, 1) if kind < 0.15 else (1, int(rng.integers(2, 4)) if kind < 0.35 else 1)
        how = Thinning(axis, every, int(rng.integers(every)), block, bool(rng.random() < 0.25))
        ways.append((coarser, how))
    return ways


def gather(sheet: Path, cache: Path) -> list[Thinned]:
    """Thin and compare every organ of a sheet."""
    settings, found = Settings.model_validate(SETTINGS), list[Thinned]()
    cache.mkdir(parents=True, exist_ok=True)
    for row in read_cohort(sheet):
        file = cache / f"{row['case']}_{row['organ']}.npz"
        if not file.exists():
            rng = np.random.default_rng(zlib.crc32(file.stem.encode()))
            stacks = _stacks(load_structure(row, sheet.parent, settings.import_), settings, rng)
            with atomic_path(file) as path:
                _keep(path, stacks)
            print(file.stem, flush=True)
        found += _kept(file)
    return found


def _keep(path: Path, stacks: Sequence[Thinned]) -> None:
    """Write what was compared: for each stack an array of each attribute."""
    names = [field.name for field in fields(Thinned)]
    arrays = {f"{n}/{name}": getattr(stack, name) for n, stack in enumerate(stacks) for name in names}
    with path.open("wb") as file:
        cast(Any, np).savez(file, **arrays)


def _kept(path: Path) -> list[Thinned]:
    """Read what `_keep` wrote."""
    with np.load(path) as file:
        count = len({name.partition("/")[0] for name in file.files})
        values = [{f.name: file[f"{n}/{f.name}"] for f in fields(Thinned)} for n in range(count)]
    return [Thinned(**{k: v if v.ndim else v.item() for k, v in stack.items()}) for stack in values]


def _stacks(structure: Structure, settings: Settings, rng: np.random.Generator) -> list[Thinned]:
    structure = _apart(structure)
    stacks: list[Thinned] = []
    for coarser, how in thinnings(rng):
        reference = _thinned(structure, Thinning(how.axis, coarser))
        try:
            stack = thin_once(reference, how, settings, rng)
        except (InputError, ValueError) as error:  # too thin an organ for so few slices
            print(f"  {how}: {error}")
            continue
        if stack is not None and np.isfinite(stack.outer).all() and np.isfinite(stack.offset).all():
            stacks.append(stack)
    return stacks


def _apart(structure: Structure) -> Structure:
    """Average large masks over two voxels along each axis."""
    assert structure.mask is not None
    return _thinned(structure, None) if structure.mask.size > MOST_VOXELS else structure


def _thinned(structure: Structure, how: Thinning | None) -> Structure:
    mask, affine = structure.mask, structure.frame.affine.copy()
    assert mask is not None
    affine[:3, 3] += affine[:3, :3] @ structure.origin
    mask, affine = averaged(mask, affine, np.full(3, 2)) if how is None else how.of(mask, affine)
    shape = mask.shape[0], mask.shape[1], mask.shape[2]
    frame = Frame(affine, structure.frame.slice_axis, shape)
    return replace(structure, frame=frame, origin=np.zeros(3, int), mask=mask)


def train(stacks: Sequence[Thinned], seed: int = 0) -> Scale:
    """Learn the quantile of offsets on either side from the signs; each organ weighs as much."""
    torch.manual_seed(seed)
    rng, names = np.random.default_rng(seed), [stack.organ for stack in stacks]
    signs, offset, weight = [], [], []
    for stack in stacks:
        some = rng.choice(len(stack.offset), PER_STACK)
        true = some >= stack.of_surface
        signs.append((stack.outer[some], stack.inner[some]))
        offset.append((stack.offset[some], -stack.offset[some]))
        weight.append(np.where(true, TRUE_WEIGHT, 1.0) / names.count(stack.organ))
    found, off, weight = np.array(signs), np.array(offset), np.array(weight)
    flat = found.reshape(-1, found.shape[-1])
    mean, spread = flat.mean(axis=0), flat.std(axis=0) + np.float32(1e-3)
    x = torch.tensor((found - mean) / spread, dtype=torch.float32).clamp(-FARTHEST, FARTHEST)
    y = torch.tensor(np.log(np.maximum(off, LEAST_OFFSET)), dtype=torch.float32)
    error = torch.tensor(np.log(np.abs(off[:, 0]) + LEAST_DIFFERENCE), dtype=torch.float32)
    w = torch.tensor(weight / weight.mean(), dtype=torch.float32)
    layers = [nn.Linear(ins, outs) for ins, outs in itertools.pairwise([x.shape[-1], *WIDTHS, 1])]
    network = nn.Sequential(layers[0], *(part for layer in layers[1:] for part in (nn.Tanh(), layer)))
    optimiser = torch.optim.AdamW(network.parameters(), lr=RATE / 2, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=STEPS)
    for _ in range(STEPS):
        which = torch.randint(0, len(x), (BATCH_STACKS, 1))
        some = torch.randint(0, PER_STACK, (BATCH_STACKS, BATCH_POINTS))
        scale = network(x[which, :, some])[..., 0]  # stacks, points, sides
        miss = y[which, :, some] - scale
        loss = (w[which, some][..., None] * torch.maximum(QUANTILE * miss, (QUANTILE - 1) * miss)).mean()
        loss = loss + RANKING * _misranked(scale.logsumexp(dim=2), error[which, some])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    learnt = tuple((layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in layers)
    return Scale(mean, spread, learnt, "")


def _misranked(width: torch.Tensor, error: torch.Tensor) -> torch.Tensor:
    """How many pairs of a stack's points (S, P) are in the wrong order, smooth; alike errors count less."""
    wider, larger = (part[:, ::2] - part[:, 1::2] for part in (width, error))
    weight = larger.abs().clamp(max=MOST_DIFFERENCE)
    return (weight * nn.functional.softplus(-STEEPNESS * larger.sign() * wider)).mean()


def kin(organ: str) -> str:
    """Return the name under which organs are held out together: all hippocampi are one kind."""
    return organ.split("/")[1]


def held_out(stacks: Sequence[Thinned], share: float = 0.9) -> dict[str, FloatArray]:
    """Bands of organs whose kind neither trained the scale nor made the factors: figures (S,) per stack."""
    kinds = np.array([kin(stack.organ) for stack in stacks])
    fold = np.array([zlib.crc32(kind.encode()) % FOLDS for kind in kinds])
    figures: dict[str, list[float]] = {name: [] for name in _FIGURES}
    for number in range(FOLDS):
        rest = [stack for stack, of in zip(stacks, fold, strict=True) if of != number]
        scale = train(rest)
        # factors of a scale that has seen these organs are a little too small: folds are many, organs alike
        known = calibrate(rest, scale, "", share, "held out")
        for stack in (stack for stack, of in zip(stacks, fold, strict=True) if of == number):
            scores, swept = stack.scores(scale)
            factor, volume, extrapolated = known.factors(stack.ratio, share)
            outer, inner = scale(stack.outer), scale(stack.inner)
            own = slice(stack.of_surface)
            low, high = np.quantile(stack.offset[own], [(1 - share) / 2, (1 + share) / 2])
            around = np.quantile(np.abs(stack.offset[own]), share)
            width = factor * (outer + inner)[own].mean()
            row = (
                stack.ratio,
                (scores[own] <= factor).mean(),
                (scores[own.stop :] <= factor).mean(),
                width / min(high - low, 2 * around),
                spearmanr((outer + inner)[own], np.abs(stack.offset[own])).statistic,
                swept <= volume,
                extrapolated,
                number,
            )
            for name, value in zip(_FIGURES, row, strict=True):
                figures[name].append(float(value))
    return {name: np.array(values) for name, values in figures.items()}


_FIGURES = ("ratio", "covered", "true", "width", "spearman", "volume", "extrapolated", "fold")


def main(sheet: Path, cache: Path) -> None:
    """Gather, hold out, train on all, write."""
    stacks = gather(sheet, cache)
    organs = sorted({stack.organ for stack in stacks})
    figures = held_out(stacks)
    print(
        "slice distance, px | stacks | own points | true points | >= 80 % | width | Spearman | volume | known"
    )
    for low, high in [*itertools.pairwise(REGIMES), (0, np.inf)]:
        here = (figures["ratio"] >= low) & (figures["ratio"] < high)
        if here.any():
            of = {name: values[here] for name, values in figures.items()}
            least, known = (of["covered"] >= 0.8).mean(), 1 - of["extrapolated"].mean()
            print(
                f"{low} to {high} | {here.sum()} | {of['covered'].mean():.3f} | {of['true'].mean():.3f}"
                f" | {least:.2f}"
                f" | {of['width'].mean():.2f} | {of['spearman'].mean():.2f}"
                f" | {of['volume'].mean():.3f} | {known:.2f}"
            )
    scale = train(stacks)
    plain = {"mean": scale.mean, "spread": scale.spread}
    for number, (matrix, offsets) in enumerate(scale.layers):
        plain |= {f"matrix{number}": matrix, f"offsets{number}": offsets}
    cast(Any, np).savez(WEIGHTS, **plain)
    kinds = sorted(Counter(map(kin, organs)).items())
    made_of = f"{len(stacks)} thinned stacks of {len(organs)} organs: "
    made_of += ", ".join(f"{kind} ({count})" if count > 1 else kind for kind, count in kinds)
    calibrate(stacks, shipped_scale(), made_of, 0.9, sheet.name).write(SHIPPED)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
