"""The files that solids are written to: one module per format, as in `cccd.surface.formats`.

Each has a function ``write(path, surface, scan)``, which returns a report of what was written.
"""
