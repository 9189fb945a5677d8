"""Junctions: which pixels and links of a noisy boundary map belong to the organ's closed curves.

Delaunay links of the boundary pixels are classified by a graph network (eq. 11); a minimum cut then
labels what lies inside, and the border of the inside is closed and simple whatever the network says.
Only the network imports torch and PyTorch Geometric; `cccd_training.junctions` trains it.

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
``reranking``        which of them is right
``labelling``        a slice's labels, from the cut or an alternative of it
``stacks``           slices beside others
``uncertainty``      how likely a slice's curves are wrong
``checkpoint``       ``model.pt``
``inference``        the forward path, batched over slices
``ordering``         a volume's boundary pixels to curves; ``contours``: a structure's
==================== ===============================================================================
"""
