"""Segmentation networks: those of the paper's Table 3, their training, and masks from scans."""
