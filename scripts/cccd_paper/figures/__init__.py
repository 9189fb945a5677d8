"""The paper's figures and ours beside them: SVG out of what comparisons left."""
