"""The learned filling, on bodies that it never saw."""

import hashlib

import numpy as np
import pytest
import torch

from cccd.filling import FillingNetwork, fill_between_slices, shipped_network
from cccd.filling.network import WEIGHTS, WEIGHTS_SHA256
from cccd_training.filling.bodies import sliced_body
from cccd_training.filling.training import FillingModel, interpolated, save_weights, train

#: Far from the seeds that the shipped weights were trained on.
UNSEEN = range(900_000, 900_012)


@pytest.fixture(scope="module")
def bodies():
    return [body for body in map(sliced_body, UNSEEN) if body is not None]


def predicted(body):
    """Distances (16, A, B, S) at the parts of a node."""
    linear = interpolated(torch.tensor(body.distance, dtype=torch.float32)[None, None])[0].numpy()
    a, b, s = body.distance.shape
    corrections = shipped_network().corrections(body.distance.astype(np.float32), body.ratio, body.pixel)
    parts = corrections.reshape(s, 4, a, 2, b, 2).transpose(3, 5, 1, 2, 4, 0).reshape(16, a, b, s)
    return linear + parts


def test_it_fills_bodies_that_it_never_saw_to_a_fifth_of_a_node(bodies):
    wrong = []
    for body in bodies:
        near = np.abs(body.truth) < 1
        near[..., -1] = False
        wrong.append(np.abs(np.clip(predicted(body), -1.5, 1.5) - body.truth)[near].mean())
    assert np.mean(wrong) < 0.18
    assert np.max(wrong) < 0.38


def test_numpy_and_torch_run_the_same_network(tmp_path):
    torch.manual_seed(3)
    model = FillingModel(width=6, layers=2)
    torch.nn.init.normal_(model.last.weight)
    save_weights(model, tmp_path / "weights.npz")
    i, j, k = np.indices((12, 10, 7))
    distance = np.clip(np.hypot(np.hypot(i - 5, j - 4), 2 * (k - 3)) - 4, -3, 3).astype(np.float32)
    with torch.no_grad():
        parts, near = model(torch.tensor(distance)[None, None], torch.tensor([2.0]), torch.tensor([0.5]))
    expected = (parts * near)[0].numpy().reshape(2, 2, 4, 12, 10, 7).transpose(5, 2, 3, 0, 4, 1)
    found = FillingNetwork.load(tmp_path / "weights.npz").corrections(distance, 2.0, 0.5)
    assert found == pytest.approx(expected.reshape(28, 24, 20), abs=1e-5)


def test_far_from_the_surface_it_corrects_nothing():
    distance = np.full((6, 30, 30), 9.0, np.float32)
    filling = fill_between_slices(distance, 1.0, 2.0, (False, False), True)
    assert np.all(filling.corrections == 0)
    assert filling.field(2.3) == pytest.approx(3.0)


def test_where_the_scan_cuts_an_organ_it_goes_on():
    i, j = np.indices((40, 40)) - 20
    distance = np.repeat((np.hypot(i, j) - 11).astype(np.float32)[None], 8, axis=0)
    cut = fill_between_slices(distance, 1.0, 2.0, (True, True), False)
    areas = [np.count_nonzero(cut.field(at) < 0) for at in (0, 0.5, 3.5, 7)]
    assert areas == pytest.approx([np.pi * 121] * 4, rel=0.03)


def test_training_learns_and_repeats(bodies):
    _, losses = train(bodies[:1], 60, 2e-3, seed=5)
    assert np.mean(losses[-5:]) < 0.9 * np.mean(losses[:5])
    first, second = (train(bodies, 5, 2e-3, seed=6)[0] for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(first.parameters(), second.parameters(), strict=True))


def test_the_shipped_weights_are_small_and_are_those_that_the_code_names():
    assert WEIGHTS.stat().st_size < 2_000_000
    assert hashlib.sha256(WEIGHTS.read_bytes()).hexdigest() == WEIGHTS_SHA256
