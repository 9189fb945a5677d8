"""Junctions: which pixels and links of a noisy boundary map belong to the organ's closed curves.

Delaunay links of the boundary pixels are classified by a graph network (eq. 11); a minimum cut then
labels what lies inside, and the border of the inside is closed and simple whatever the network says.
Only the network and its training import torch and PyTorch Geometric, on which both stand.

==================== ===============================================================================
module               holds
==================== ===============================================================================
``delaunay``         the graph: pixels, links and triangles of a Delaunay triangulation, ghost points
``branches``         branches of a boundary map and their good continuation
``intensity``        grey slices as the network reads them, and edges that the map lacks
``observation``      a slice's map and image to its graph
``columns``          tables of features with named columns
``features``         what the network reads at nodes, links and triangles
``graph_data``       graph and features as `torch_geometric` data
``layers``           message passing
``network``          the network
``energy``           unary and pairwise terms, for training and inference
``cut``              the labelling of least energy, by minimum cut
``decoding``         labelled triangles to closed chains
``alternatives``     other labellings, described as a whole
``reranking``        which of them is right; ``reranker_training``
``labelling``        a slice's labels, from the cut or an alternative of it
``parts``            no more pieces than an organ has on a slice; ``stacks``: slices beside others
``uncertainty``      how likely a slice's curves are wrong
``inference``        the forward path, batched over slices
``ordering``         a volume's boundary pixels to curves; ``contours``: a structure's
``random_masks``     synthetic organs; ``synthetic_images``, ``synthetic_maps``, ``labels``: images, noisy
                     boundary maps (`cccd.volumes.corruptions`) and labels of them
``grid``             the paper's graph, the pixel grid, and its decoder; ``paper_network``: its network
``frozen_graphs``    ``graphs.h5``: graphs drawn once
``data``             labelled maps; ``tasks``, ``loss``, ``loop``, ``checkpoint``: the rest of the training
``scoring``          when an ordered slice counts as correct
==================== ===============================================================================
"""

from cccd.junctions.inference import Predictor
from cccd.junctions.ordering import order_boundaries

__all__ = ["Predictor", "order_boundaries"]
