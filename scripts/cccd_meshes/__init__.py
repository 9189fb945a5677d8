"""Meshes of others, and contours in planes of several directions, as organs; meshes of even triangles."""
