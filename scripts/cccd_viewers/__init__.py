"""What one looks at: pictures of what was read, the plugin of napari, the accessor of PyVista."""
