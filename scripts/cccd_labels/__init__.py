"""Whole label maps: all organs of a scan at once, with shared walls; scenes."""
