"""Splines through organs that share their walls: solids whose neighbours have the same faces."""
