import numpy as np
import pytest
import torch
from torch_geometric.data import Batch
from torch_geometric.nn import MessagePassing

from cccd_junctions.delaunay import build_graph
from cccd_junctions.graph_data import TRIANGLE_LINKS, make_data
from cccd_junctions.intensity import normalised_intensity
from cccd_junctions.layers import EquationEleven, both_ways, shared_means
from cccd_junctions.network import JunctionNetwork


def layer(width_in=5, width_out=4):
    torch.manual_seed(0)
    convolution = EquationEleven(width_in, width_out, 0.0)
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
    assert isinstance(convolution, MessagePassing)
    edges = torch.from_numpy(np.stack(np.nonzero(adjacency)))
    with torch.no_grad():
        result = convolution(torch.from_numpy(x).float(), edges)
    np.testing.assert_allclose(result.numpy(), expected, rtol=1e-4, atol=1e-5)


def test_gates_of_one_change_nothing_and_zero_closes_a_link():
    convolution = layer()
    x = torch.randn(6, 5)
    edges = torch.tensor([[0, 1, 2, 3], [1, 0, 4, 4]])
    with torch.no_grad():
        plain = convolution(x, edges)
        assert torch.equal(convolution(x, edges, torch.ones(4, 4)), plain)
        gate = torch.ones(4, 4)
        gate[2] = 0
        closed = convolution(x, edges, gate)
        assert torch.allclose(closed[4], convolution(x, edges[:, 3:])[4])


def test_a_gate_is_the_same_for_all_channels_of_a_head():
    convolution = layer()
    x, gate = torch.randn(6, 5), torch.randn(3, 2)
    edges = torch.tensor([[0, 1, 2], [3, 4, 5]])
    with torch.no_grad():
        expected = convolution.sent(x)[edges[0]] * gate[:, [0, 0, 1, 1]]
        assert torch.allclose(convolution(x, edges, gate)[edges[1]], expected, atol=1e-6)


def test_receivers_may_be_others_than_senders():
    convolution = layer()
    x = torch.randn(3, 5)
    with torch.no_grad():
        edges = torch.tensor([[2, 0, 2], [1, 5, 5]])
        received = convolution(x, edges, receivers=7)
        sent = convolution.sent(x)
    assert received.shape == (7, 4)
    assert torch.allclose(received[5], sent[0] + sent[2])
    assert torch.equal(received[1], sent[2])
    assert not received[[0, 2, 3, 4, 6]].any()


def test_each_pair_is_followed_by_its_way_back():
    pairs = torch.tensor([[0, 4], [1, 2]])
    assert both_ways(pairs).tolist() == [[0, 1, 4, 2], [1, 0, 2, 4]]


def test_messages_in_any_order_sum_to_the_same():
    convolution = layer()
    x, gate = torch.randn(6, 5), torch.randn(8, 4)
    edges, order = torch.randint(0, 6, (2, 8)), torch.randperm(8)
    with torch.no_grad():
        plain = convolution(x, edges, gate)
        assert torch.allclose(convolution(x, edges[:, order], gate[order]), plain, atol=1e-6)


def test_pools_share_the_mean_of_what_their_rows_send_and_so_do_gradients():
    torch.manual_seed(0)
    index = torch.tensor([[1, 0, 1, 1, 0], [0, 0, 1, 2, 2]])
    given = [torch.randn(size, requires_grad=True) for size in ((5, 3), (4, 3), (4,))]
    message = torch.nn.functional.linear(*given)
    expected = torch.zeros(5, 2)
    for part, numbers in zip(message.chunk(2, dim=1), index, strict=True):
        same = (numbers[:, None] == numbers).float()
        expected = expected + same @ part / same.sum(dim=1, keepdim=True)
    shared = shared_means(given[0], index, *given[1:])
    assert torch.allclose(shared, expected, atol=1e-6)
    wanted = torch.autograd.grad(expected.square().sum(), given)
    for one, other in zip(torch.autograd.grad(shared.square().sum(), given), wanted, strict=True):
        assert torch.allclose(one, other, atol=1e-5)


def slices_of(extents, image_of=1):
    rng = np.random.default_rng(0)
    graphs = [build_graph(np.unique(rng.integers(low, high, (90, 2)), axis=0)) for low, high in extents]
    pixels = graphs[image_of].points[graphs[image_of].observed].astype(int)
    seen = normalised_intensity(rng.normal(0, 1, (80, 80)), pixels)
    return graphs, [make_data(g, seen if n == image_of else None) for n, g in enumerate(graphs)]


def test_a_batch_keeps_its_slices_apart():
    graphs, slices = slices_of([(0, 30), (7, 80), (3, 50)])
    batch = Batch.from_data_list(slices)
    triangles = np.cumsum([0, *(len(graph.triangles) for graph in graphs)])
    sides = batch[TRIANGLE_LINKS].edge_index
    assert torch.equal(batch["triangle"].batch[sides[0]], batch["triangle"].batch[sides[1]])
    links = np.cumsum([0, *(len(graph.links) for graph in graphs)])
    for n, graph in enumerate(graphs):
        own = sides[:, links[n] : links[n + 1]] - triangles[n]
        assert np.array_equal(own.numpy(), graph.link_triangles.T)
    for name in ("triangle", "link"):
        pools, owner = batch[name].pool_index, batch[name].batch
        for pool in pools:
            assert len(torch.unique(torch.stack([pool, owner]), dim=1)[0]) == len(torch.unique(pool))


def test_a_slice_gets_the_same_logits_alone_and_among_others():
    torch.manual_seed(0)
    _, slices = slices_of([(0, 30), (7, 80), (3, 50)])
    model = JunctionNetwork(width=16, link_width=8, message_layers=2, heads=4)
    together = model.predict(slices)
    for data, found in zip(slices, together, strict=True):
        for one, other in zip(model.predict([data])[0], found, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4)


def test_every_link_and_triangle_gets_one_logit_and_every_weight_a_gradient():
    rng = np.random.default_rng(0)
    graph = build_graph(np.unique(rng.integers(0, 40, (90, 2)), axis=0))
    batch = Batch.from_data_list([make_data(graph, None)])
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
    slices = [make_data(graph, None)]
    model = JunctionNetwork()
    (here,) = model.predict(slices)
    (there,) = model.to("cuda").predict(slices)
    for ours, theirs in zip(here, there, strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=1e-3, atol=1e-3)
