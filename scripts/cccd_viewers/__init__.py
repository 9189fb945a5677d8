"""What one looks at: pictures of what was read, what the page draws, plugins of napari and PyVista."""
