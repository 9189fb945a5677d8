"""Masks from scans: segmentation networks, and segmenters that are installed beside."""
