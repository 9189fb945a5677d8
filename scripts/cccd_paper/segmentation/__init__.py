"""The segmentation networks of Table 3."""
