import os
import pickle

import h5py
import numpy as np
import pandas as pd
import pytest
import torch
from support.refusals import refusal
from torch_geometric.data import Batch

from cccd_junctions.delaunay import build_graph
from cccd_networks.graphs import read_graphs
from cccd_networks.settings import NetworkSettings
from cccd_training.junctions import loop
from cccd_training.junctions.data import FrozenMaps, label_map
from cccd_training.junctions.frozen_graphs import generate_graphs, pack_graphs, read_maps
from cccd_training.junctions.loop import train_model, train_task
from cccd_training.junctions.synthetic_maps import draw_large_map
from cccd_training.junctions.tasks import make_task

SETTINGS = {
    "graphs": {"training": 6, "validation": 3, "test": 3},
    "start": None,
    "fresh_maps": 2,
    "epochs": 3,
    "patience": 9,
    "batch_size": 4,
    "learning_rate": 0.003,
    "width": 8,
    "message_layers": 1,
    "paper": {"epochs": 3},
}


NETWORK = NetworkSettings(**SETTINGS)


@pytest.fixture(scope="module")
def graphs(tmp_path_factory):
    path = tmp_path_factory.mktemp("graphs") / "graphs.h5"
    generate_graphs(NETWORK.graphs, 1, path)
    return path


def train(graphs, folder, **changes):
    model, history = folder / "model.pt", folder / "history.csv"
    train_model(graphs, NETWORK.model_copy(update=changes), 3, folder / "checkpoints", model, history)
    return weights_of(folder), pd.read_csv(history)


@pytest.fixture(scope="module")
def whole(graphs, tmp_path_factory):
    """The folder of a training that nothing disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    train(graphs, folder)
    return folder


def weights_of(folder):
    return torch.load(folder / "model.pt", weights_only=True)["weights"]


def same(one, other):
    return all(torch.equal(one[name], other[name]) for name in one)


def stop_after(monkeypatch, epochs):
    """Let the process die, as by a kill, when so many epochs are in their checkpoints."""
    run = loop._run_epoch
    done = []

    def dying(*arguments):
        if len(done) == epochs:
            raise KeyboardInterrupt
        done.append(1)
        return run(*arguments)

    monkeypatch.setattr(loop, "_run_epoch", dying)


def test_graphs_are_the_same_for_a_seed_and_sparse(graphs, tmp_path):
    again = tmp_path / "again.h5"
    generate_graphs(NETWORK.graphs, 1, again)
    assert again.read_bytes() == graphs.read_bytes()
    split = read_graphs(graphs, "training")
    assert set(np.unique(split.link_labels)) == {-1, 1}
    assert len(split.links) < 3.2 * (len(split.pixels) + 12 * 6)


@pytest.mark.parametrize("version", [None, 1])
def test_graphs_of_another_version_are_refused_in_one_line(graphs, tmp_path, version):
    path = tmp_path / "graphs.h5"
    path.write_bytes(graphs.read_bytes())
    with h5py.File(path, "r+") as file:
        del file.attrs["version"]
        if version is not None:
            file.attrs["version"] = version
    line = refusal(read_maps, path, "training")
    assert str(path) in line
    assert "delete it and run snakemake again" in line


def test_graphs_of_the_papers_size_take_a_six_hundredth_of_dense_matrices(graphs):
    with h5py.File(graphs) as file:
        facts = dict(file.attrs)
    assert facts["bytes_paper_dense"] == 2 * 209 * 1917**2 * 4
    assert facts["bytes_paper"] < facts["bytes_paper_dense"] / 600


def test_stored_bytes_grow_with_the_number_of_links():
    per_link = []
    for size in (400, 3600):
        large = draw_large_map(np.random.default_rng(0), size)
        assert len(large.pixels) == size
        split = pack_graphs([large])
        per_link.append(split.graph_bytes / len(split.links))
    assert per_link[1] == pytest.approx(per_link[0], rel=0.01)


def test_stored_links_are_those_of_the_rebuilt_graph(graphs):
    rebuilt = np.concatenate([build_graph(drawn.pixels).links for drawn in read_maps(graphs, "test")])
    assert np.array_equal(rebuilt, read_graphs(graphs, "test").links)


@pytest.mark.parametrize("network", ["ours", "paper"])
def test_a_killed_run_goes_on_as_if_nothing_had_happened(graphs, tmp_path, monkeypatch, network):
    whole, history = train(graphs, tmp_path / "whole", network=network)
    with monkeypatch.context() as patch:
        stop_after(patch, 2)
        with pytest.raises(KeyboardInterrupt):
            train(graphs, tmp_path / "killed", network=network)
    assert not (tmp_path / "killed" / "model.pt").exists()
    resumed, resumed_history = train(graphs, tmp_path / "killed", network=network)
    assert same(whole, resumed)
    pd.testing.assert_frame_equal(history.drop(columns="seconds"), resumed_history.drop(columns="seconds"))


def test_kept_maps_stay_as_they_were_labelled_and_go_to_other_processes(graphs):
    maps = read_maps(graphs, "training")
    frozen = FrozenMaps(maps)
    Batch.from_data_list([frozen.labelled(0, False), frozen.labelled(1, True)])
    sent = pickle.loads(pickle.dumps(frozen))
    for one, number, hidden in ((frozen, 0, False), (frozen, 1, True), (sent, 0, False), (sent, 1, True)):
        fresh = label_map(maps[number], hidden)
        for kind, name in (("link", "x"), ("link", "y"), ("triangle", "y"), ("triangle", "pool_index")):
            assert torch.equal(one.labelled(number, hidden)[kind][name], fresh[kind][name])


class Bomb:
    """Leaves a folder behind when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("exploded",)


@pytest.mark.parametrize(
    "spoil",
    [lambda path: path.write_bytes(path.read_bytes()[:1000]), lambda path: torch.save(Bomb(), path)],
    ids=["torn", "hostile"],
)
def test_a_checkpoint_that_cannot_be_read_falls_back_to_the_one_before(
    graphs, whole, tmp_path, monkeypatch, spoil
):
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        stop_after(patch, 2)
        with pytest.raises(KeyboardInterrupt):
            train(graphs, tmp_path / "spoilt")
    spoil(sorted((tmp_path / "spoilt" / "checkpoints").glob("epoch_*.pt"))[-1])
    resumed, _ = train(graphs, tmp_path / "spoilt")
    assert same(weights_of(whole), resumed)
    assert not (tmp_path / "exploded").exists()


def test_other_settings_do_not_resume_a_stranger(graphs, tmp_path):
    train(graphs, tmp_path, epochs=1)
    _, history = train(graphs, tmp_path, epochs=2)
    assert history["epoch"].tolist() == [0, 1]


def test_training_stops_when_validation_gets_no_better(graphs, tmp_path):
    _, history = train(graphs, tmp_path, epochs=8, patience=1, learning_rate=1e-12)
    assert len(history) < 8


def test_of_epochs_that_validate_alike_the_last_is_taken(graphs, tmp_path):
    _, history = train(graphs, tmp_path, epochs=3, learning_rate=1e-12)
    assert history["test_correct"].notna().tolist() == [False, False, True]


def test_training_starts_from_given_weights(graphs, whole, tmp_path):
    kept, _ = train(graphs, tmp_path, start=str(whole / "model.pt"), epochs=1, learning_rate=1e-12)
    name = "inside_head.4.weight"
    assert torch.allclose(kept[name], weights_of(whole)[name], atol=1e-6)


def test_a_network_with_fewer_layers_and_features_can_be_started_from(graphs, whole, tmp_path):
    path = tmp_path / "fewer.pt"
    content = torch.load(whole / "model.pt", weights_only=True)
    name = "triangle_encoder.1.weight"
    content["weights"][name] = content["weights"][name][:, :-3]
    for key in ("weight", "bias", "running_mean", "running_var"):
        content["weights"][f"triangle_encoder.0.{key}"] = content["weights"][f"triangle_encoder.0.{key}"][:-3]
    torch.save(content, path)
    changes = {"start": str(path), "epochs": 1, "learning_rate": 1e-12, "message_layers": 2}
    grown, _ = train(graphs, tmp_path / "second", **changes)
    assert torch.allclose(grown[name][:, :-3], content["weights"][name], atol=1e-6)
    assert grown[name][:, -3:].abs().max() < 1e-6
    assert "message_layers.1.triangle_messages.weight" in grown


def test_training_without_files_gives_the_last_epochs_weights(graphs, whole):
    newest = max((whole / "checkpoints").glob("epoch_*.pt"))
    kept = torch.load(newest, weights_only=True)["model"]
    alone = train_task(make_task(read_maps(graphs, "training"), NETWORK, 3), 3)
    assert same(alone.state_dict(), kept)
