"""Distances below the voxel and between slices, on bodies whose surface is known."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from cccd.geometry.distance import to_mask
from cccd.surface import learned_distance
from cccd.surface.levels import levels_of_slices
from cccd_training.distance.bodies import draw_sample, packed
from cccd_training.distance.training import DistanceModel, save_weights, unpacked

#: Seeds that no training began from.
UNSEEN = range(7_000_000, 7_000_012)


@pytest.fixture(scope="module")
def samples():
    return [sample for sample in map(draw_sample, UNSEEN) if sample is not None]


def estimated(sample):
    seen = unpacked(torch.from_numpy(sample.seen)).numpy()
    around = learned_distance.Surroundings(seen, sample.base, np.ones(len(seen), np.float32), sample.flipped)
    return learned_distance.shipped_network().estimate(around, sample.ratio, sample.height, sample.exact)


def test_it_is_nearer_to_bodies_that_it_never_saw_than_the_slices_distances(samples):
    """By half on the mean, and nearer on nearly each of them."""
    wrong, plain = [], []
    for sample in samples:
        near = np.abs(sample.truth) < 1
        wrong.append(np.abs(estimated(sample) - sample.truth)[near].mean())
        plain.append(np.abs(sample.base - sample.truth)[near].mean())
    assert np.mean(wrong) < 0.6 * np.mean(plain)
    assert np.mean(np.array(wrong) < plain) > 0.95


def test_numpy_and_torch_run_the_same_network(tmp_path, samples):
    torch.manual_seed(3)
    model = DistanceModel()
    torch.nn.init.normal_(model.last)
    save_weights(model, tmp_path / "weights.npz")
    network = learned_distance.DistanceNetwork.load(tmp_path / "weights.npz")
    seen, base = unpacked(torch.from_numpy(samples[0].seen[:50])), samples[0].base[:50]
    around = learned_distance.Surroundings(seen.numpy(), base, np.ones(50, np.float32), np.zeros(50, bool))
    basis = torch.tensor(learned_distance.condition_basis(2.2, np.full(1, 0.25), True), dtype=torch.float32)
    with torch.no_grad():
        expected = model(seen[None], torch.tensor(base)[None], basis)[0].numpy()
    found = network.estimate(around, 2.2, 0.25, True)
    assert found == pytest.approx(expected, rel=0.02, abs=0.02)  # weights are stored in 16 bits


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 15), st.sampled_from([0.0, 0.5]), st.integers(0, 1000))
def test_turned_and_mirrored_stacks_are_seen_alike(turn, height, seed):
    """Distances do not depend on which way round the slices lie, nor on which side is called inside."""
    rng = np.random.default_rng(seed)
    stack = rng.normal(0, 3, (9, 21, 21)).astype(np.float32)  # no two ways are equally steep
    other = stack.transpose(0, 2, 1) if turn & 2 else stack
    other = other[:, :: -1 if turn & 4 else 1, :: -1 if turn & 8 else 1]
    way = -height if turn & 1 else height
    other = np.ascontiguousarray(other[:: -1 if turn & 1 else 1])
    node = np.array([[0, 2, 2]])  # the middle, without padding
    answers = []
    for planes, above in ((stack, height), (other, way), (-stack, height)):
        base = learned_distance.in_space(*planes[3:6], 2.0, above)[10:11, 10]
        around = learned_distance.Surroundings.of(planes, node, base)
        answers.append(learned_distance.shipped_network().estimate(around, 2.0, above, False)[0])
    assert answers[1] == pytest.approx(answers[0], abs=1e-3)
    assert answers[2] == pytest.approx(-answers[0], abs=1e-3)


def test_what_is_seen_is_kept_in_a_byte():
    seen = np.linspace(-2, 2, 4001).astype(np.float32)
    wrong = np.abs(unpacked(torch.from_numpy(packed(seen))).numpy() - seen)
    assert max(wrong.max() / 4, wrong[np.abs(seen) < 0.15].max()) < 0.005


@pytest.mark.parametrize(("ratio", "most"), [(1.0, 0.07), (3.0, 0.09), (5.0, 0.12)])
def test_an_oblique_plane_is_found_between_pixels_and_between_slices(ratio, most):
    k, i, j = np.indices((14, 70, 44)).astype(float)
    way = np.array([0.37 * ratio, 1.0, 0.27])
    size = float(np.hypot(np.hypot(0.37, 1.0), 0.27))
    planes = [to_mask(layer, np.ones(2)) for layer in way[0] * k + i + way[2] * j < 45.2]
    cut = (True, True)
    z, values = levels_of_slices(np.stack(planes), ratio * np.arange(14), ratio, np.ones(2), cut, False)
    true = (0.37 * z[:, None, None] + i[0] + way[2] * j[0] - 45.2) / size
    near = np.abs(true) < 0.7
    near[:, :, :10] = near[:, :, -10:] = near[:5] = near[-5:] = False
    assert near.sum() > 50
    assert np.abs(values - true)[near].mean() < most


def test_far_from_the_surface_nothing_is_estimated():
    planes = np.full((6, 30, 30), 9.0, np.float32)
    _, values = levels_of_slices(planes, np.arange(6.0), 1.0, np.ones(2), (True, True), False)
    assert np.all(values == 8)


def test_a_slice_stays_on_its_side():
    rng = np.random.default_rng(0)
    planes = np.where(rng.random((5, 30, 30)) < 0.3, -0.5, 0.5).astype(np.float32)
    z, values = levels_of_slices(planes, np.arange(5.0), 1.0, np.ones(2), (True, True), False)
    assert len(z) == 5
    assert np.array_equal(values < 0, planes < 0)
