"""Masks of scans that have none: thresholds, seeds, networks, and segmenters that are installed beside."""
