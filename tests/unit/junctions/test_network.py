import numpy as np
import pytest
import torch

from cccd.junctions.batch import make_batch
from cccd.junctions.delaunay import build_graph
from cccd.junctions.layers import GatedConvolution
from cccd.junctions.network import JunctionNetwork


def layer(width_in=5, width_out=4, heads=1):
    torch.manual_seed(0)
    convolution = GatedConvolution(width_in, width_out, 0.0, heads)
    with torch.no_grad():
        for parameter in convolution.parameters():
            parameter.normal_()
        convolution.norm.running_mean.normal_()
        convolution.norm.running_var.uniform_(0.5, 2)
    return convolution.eval()


def test_convolution_is_equation_11_evaluated_densely():
    convolution = layer()
    rng = np.random.default_rng(0)
    x = rng.standard_normal((9, 5))
    adjacency = np.triu(rng.random((9, 9)) < 0.4, 1)
    adjacency = adjacency | adjacency.T
    W, b = convolution.dense.weight.detach().numpy().T, convolution.dense.bias.detach().numpy()
    norm = convolution.norm
    mean, var = norm.running_mean.numpy(), norm.running_var.numpy()
    gamma, beta = norm.weight.detach().numpy(), norm.bias.detach().numpy()
    expected = np.zeros((9, 4))
    for i in range(9):
        for j in range(9):
            if adjacency[i, j]:
                normed = (x[j] @ W + b - mean) / np.sqrt(var + norm.eps) * gamma + beta
                expected[i] += np.maximum(normed, 0)
    source, target = map(torch.from_numpy, np.nonzero(adjacency))
    with torch.no_grad():
        result = convolution.along_links(torch.from_numpy(x).float(), source, target)
    np.testing.assert_allclose(result.numpy(), expected, rtol=1e-4, atol=1e-5)


def test_gates_of_one_change_nothing_and_zero_closes_a_link():
    convolution = layer(heads=2)
    x = torch.randn(6, 5)
    source, target = torch.tensor([0, 1, 2, 3]), torch.tensor([1, 0, 4, 4])
    with torch.no_grad():
        plain = convolution.along_links(x, source, target)
        assert torch.equal(convolution.along_links(x, source, target, torch.ones(4, 2)), plain)
        gate = torch.ones(4, 2)
        gate[2] = 0
        closed = convolution.along_links(x, source, target, gate)
        assert torch.allclose(closed[4], convolution.along_links(x, source[3:], target[3:])[4])


def test_three_sides_and_a_list_of_links_agree():
    convolution = layer(width_in=4)
    x = torch.randn(7, 4)
    neighbours = torch.randint(0, 7, (7, 3))
    with torch.no_grad():
        listed = convolution.along_links(x, neighbours.reshape(-1), torch.arange(7).repeat_interleave(3))
        assert torch.allclose(convolution.over_sides(x, neighbours), listed, atol=1e-6)


def test_dropout_acts_in_training_only():
    convolution = GatedConvolution(5, 4, 0.5)
    x = torch.randn(50, 5)
    convolution.train()
    assert not torch.equal(convolution.messages(x), convolution.messages(x))
    convolution.eval()
    assert torch.equal(convolution.messages(x), convolution.messages(x))


def test_every_link_and_triangle_gets_one_logit_and_every_weight_a_gradient():
    rng = np.random.default_rng(0)
    graph = build_graph(np.unique(rng.integers(0, 40, (90, 2)), axis=0))
    batch = make_batch(graph, [None])
    model = JunctionNetwork(width=16, link_width=8, message_layers=2, heads=4)
    inside, link = model(batch)
    assert inside.shape == (len(graph.triangles),)
    assert link.shape == (len(graph.links),)
    (inside.square().mean() + link.square().mean()).backward()
    assert all(parameter.grad is not None for parameter in model.parameters())


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_a_gpu_gives_what_the_cpu_gives():
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    graph = build_graph(np.unique(rng.integers(0, 60, (300, 2)), axis=0))
    batch = make_batch(graph, [None])
    model = JunctionNetwork()
    here = model.predict(batch)
    for ours, theirs in zip(here, model.to("cuda").predict(batch), strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=1e-3, atol=1e-3)
