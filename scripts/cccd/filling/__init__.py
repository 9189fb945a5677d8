"""What lies between the slices of a stack and below their pixels, by a network trained on random bodies."""

from cccd.filling.between_slices import Filling, fill_between_slices
from cccd.filling.network import FillingNetwork, shipped_network

__all__ = ["Filling", "FillingNetwork", "fill_between_slices", "shipped_network"]
