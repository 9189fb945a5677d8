"""Meshes of others, and contours in planes of several directions, as organs: mended, cut, smoothed."""
