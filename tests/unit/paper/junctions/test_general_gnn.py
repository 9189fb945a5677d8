import os

import numpy as np
import pytest
import torch

from cccd_paper.junctions.general_gnn import (
    EPSILON,
    MESSAGE_PASSING,
    POST_PROCESS,
    PRE_PROCESS,
    GeneralGNN,
    mlp,
)
from cccd_paper.junctions.network import link_data

DROPOUT = 0.5


def shuffled(module, seed=0):
    """Weights, slopes and running statistics that are all different, in evaluation mode."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, value in module.state_dict().items():
            if value.dtype.is_floating_point:
                low, high = (0.5, 2) if "running_var" in name else (-0.5, 0.5)
                value.uniform_(low, high, generator=generator)
    return module.eval()


def dense_layer(x, part, activation):
    """``Act(BN(x W + b))`` of arrays; dropout does nothing in evaluation."""
    sent = x @ part["dense.weight"].T + part["dense.bias"]
    sent = (sent - part["norm.running_mean"]) / np.sqrt(part["norm.running_var"] + EPSILON)
    return activation(sent * part["norm.weight"] + part["norm.bias"])


def prelu(slope):
    return lambda x: np.where(x > 0, x, slope * x)


def parts_of(module, prefix, renamed=""):
    weights = {name: value.double().numpy() for name, value in module.state_dict().items()}
    return {
        name.removeprefix(prefix).replace(renamed, ""): value
        for name, value in weights.items()
        if name.startswith(prefix)
    }


def random_graph(nodes=30, links=80, seed=0):
    rng = np.random.default_rng(seed)
    pairs = np.column_stack(np.triu_indices(nodes, 1))
    chosen = pairs[rng.choice(len(pairs), links, replace=False)]
    adjacency = np.zeros((nodes, nodes))
    adjacency[tuple(chosen.T)] = adjacency[tuple(chosen[:, ::-1].T)] = 1
    return rng.normal(size=(nodes, 2)), chosen, adjacency


def dense_general_gnn(model, x, adjacency):
    """The whole network with a dense adjacency matrix, layer after layer."""
    for n in range(PRE_PROCESS):
        part = parts_of(model, "pre.", f"_{n}")
        x = dense_layer(x, part, prelu(part["activation.weight"]))
    for n in range(MESSAGE_PASSING):
        part = parts_of(model, f"layers.{n}.")
        received = adjacency @ dense_layer(x, part, prelu(part["activation.weight"]))
        x = np.concatenate([received, x], axis=1)
    return x


def test_the_network_is_its_dense_evaluation():
    x, links, adjacency = random_graph()
    model = shuffled(GeneralGNN(2, channels=7, dropout=DROPOUT))
    data = link_data(x, links, links)
    with torch.inference_mode():
        found = model(data.x, data.edge_index).numpy()
    np.testing.assert_allclose(found, dense_general_gnn(model, x, adjacency), rtol=1e-4, atol=1e-4)


def test_a_node_sees_itself_and_what_lies_four_links_away():
    # a path of 12 nodes; a change at its first node reaches the first five and nothing beyond
    links = np.column_stack([np.arange(11), np.arange(1, 12)])
    data = link_data(np.ones((12, 1)), links, links)
    model = shuffled(GeneralGNN(1, channels=5))
    with torch.inference_mode():
        before = model(data.x, data.edge_index)
        data.x[0] = -1
        changed = (model(data.x, data.edge_index) - before).abs().amax(dim=1) > 1e-9
    assert changed.tolist() == [True] * 5 + [False] * 7


@pytest.mark.filterwarnings("ignore")
def test_spektral_has_the_same_numbers():
    os.environ["TF_USE_LEGACY_KERAS"] = "1"
    models = pytest.importorskip("spektral.models")
    tf = pytest.importorskip("tensorflow")
    x, links, adjacency = random_graph()
    theirs = models.GeneralGNN(1, activation="tanh", hidden=7, dropout=DROPOUT, pool=None)
    inputs = tf.constant(x, tf.float32), tf.sparse.from_dense(tf.constant(adjacency, tf.float32))
    theirs(inputs)
    rng = np.random.default_rng(1)
    theirs.set_weights([rng.uniform(0.5, 1, value.shape) for value in theirs.get_weights()])
    ours = GeneralGNN(2, channels=7, dropout=DROPOUT)
    last = mlp(ours.width_out, 7, 1, POST_PROCESS, DROPOUT, torch.nn.Tanh())
    for blocks, module in ((theirs.pre, ours.pre), (theirs.post, last)):
        _copy_mlp(blocks, module)
    for block, layer in zip(theirs.gnn, ours.layers, strict=True):
        _copy(block.kernel, block.bias, block.batch_norm, block.activation, layer)
    data = link_data(x, links, links)
    with torch.inference_mode():
        found = last.eval()(ours.eval()(data.x, data.edge_index)).numpy()
    np.testing.assert_allclose(found, theirs(inputs).numpy(), rtol=1e-4, atol=1e-5)


def _copy_mlp(block, module):
    layers = block.mlp.layers
    for n in range(len(layers) // 4):
        dense, norm, _, activation = layers[4 * n : 4 * n + 4]
        ours = {name: getattr(module, f"{name}_{n}") for name in ("dense", "norm", "activation")}
        _copy(dense.kernel, dense.bias, norm, activation, torch.nn.ModuleDict(ours))


def _copy(kernel, bias, norm, activation, module):
    get = module.__getitem__ if isinstance(module, torch.nn.ModuleDict) else module.__getattr__
    pairs = [
        (get("dense").weight, np.asarray(kernel).T),
        (get("dense").bias, np.asarray(bias)),
        (get("norm").weight, np.asarray(norm.gamma)),
        (get("norm").bias, np.asarray(norm.beta)),
        (get("norm").running_mean, np.asarray(norm.moving_mean)),
        (get("norm").running_var, np.asarray(norm.moving_variance)),
    ]
    if hasattr(get("activation"), "weight"):
        pairs.append((get("activation").weight, np.asarray(activation.alpha)))
    with torch.no_grad():
        for ours, theirs in pairs:
            ours.copy_(torch.as_tensor(np.array(theirs)))
