"""How the network that estimates distances is trained: random bodies, their slices, and the way there."""
