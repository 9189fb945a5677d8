"""The paper's own network for boundary pixels: its graph, its training, and the chains that it leaves."""
