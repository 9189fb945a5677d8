"""Junctions: which pixels and links of a dirty boundary map belong to the organ's closed curves.

Delaunay links of the boundary pixels are classified by a graph network (eq. 11); a minimum cut then
labels what lies inside, and the border of the inside is closed and simple whatever the network says.
"""

from cccd.junctions.inference import order_boundaries
from cccd.junctions.training import generate_graphs, load_model, train_model

__all__ = ["generate_graphs", "load_model", "order_boundaries", "train_model"]
