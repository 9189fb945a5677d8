"""How the network that fills between slices is trained: random bodies, their slices, and the way there."""
