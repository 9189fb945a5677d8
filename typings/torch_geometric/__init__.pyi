"""The part of PyTorch Geometric that the junction networks use: it ships no types."""
