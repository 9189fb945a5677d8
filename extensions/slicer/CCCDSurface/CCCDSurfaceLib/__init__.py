"""What the module does without a window."""  # noqa: N999 - as Slicer's own modules are named
